"""The accuracy table for a terminal of 80 columns."""

from __future__ import annotations

from ropeode.render import table_words
from ropeode.render.text_layout import columns, wrapped
from ropeode.study.accuracy_table import AccuracyTable, StepperOrder


def as_text(table: AccuracyTable) -> str:
    """A block of runs for each stepper, the observed orders, and the reference."""
    cells = [table_words.run_cells(row) for row in table.rows]
    header, *lines = columns([table_words.RUN_HEADERS, *cells], left=())
    runs = iter(lines)
    blocks = [header]
    for each in table.orders:
        blocks.append(each.stepper)
        blocks.extend(next(runs) for row in table.rows if row.stepper == each.stepper)
    return "\n".join(
        [
            *wrapped(table_words.title(table)),
            *wrapped(table_words.error_words(table)),
            "",
            *blocks,
            "",
            f"Observed orders ({table_words.RUN_HEADERS[2]}, as dt goes to 0)",
            *(line for each in table.orders for line in _order(table, each)),
            "",
            *wrapped(table_words.reference_words(table)),
            "",
        ]
    )


def _order(table: AccuracyTable, each: StepperOrder) -> list[str]:
    name, expected, observed, interval, used, verdict = table_words.order_cells(table, each)
    if each.order.observed is None:
        finding = f"{verdict}: {each.order.why}"
    else:
        finding = f"{verdict}, order {observed} {interval}, {used} steps/frame"
    claim = "" if expected == "-" else f"; expected {expected}"
    lines = [name, *wrapped(f"{finding}{claim}", indent=4)]
    if constant := table_words.constant_words(table, each):
        lines += wrapped(constant, indent=4)
    if remark := table_words.remark(each):
        lines += wrapped(remark, indent=4)
    if each.order.left_out:
        lines += wrapped(f"left out: {table_words.left_out_words(table, each)}", indent=4)
    return lines
