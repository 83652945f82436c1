"""The accuracy table for a terminal of 80 columns."""

from __future__ import annotations

import textwrap

from tabulate import tabulate

from ropeode.render import table_words
from ropeode.study.accuracy_table import AccuracyTable, StepperOrder

WIDTH = 80


def as_text(table: AccuracyTable) -> str:
    """A block of runs for each stepper, the observed orders, and the reference."""
    # The headers go in as a row: tabulate pads real headers, and the table would be too wide.
    header, *lines = tabulate(
        [table_words.RUN_HEADERS, *(table_words.run_cells(row) for row in table.rows)],
        tablefmt="plain",
        disable_numparse=True,
        colalign=("right",) * len(table_words.RUN_HEADERS),
    ).splitlines()
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
            *(line.rstrip() for line in blocks),
            "",
            f"Observed orders ({table_words.RUN_HEADERS[2]}, as dt goes to 0)",
            *(line for each in table.orders for line in _order(table, each)),
            "",
            *wrapped(table_words.reference_words(table)),
            "",
        ]
    )


def _order(table: AccuracyTable, each: StepperOrder) -> list[str]:
    order = each.order
    name, expected, observed, interval, used, verdict = table_words.order_cells(table, each.stepper)
    if order.observed is None:
        finding = f"{verdict}: {order.why}"
    else:
        finding = f"{verdict}, order {observed} {interval}, {used} steps/frame"
    claim = "" if expected == "-" else f"; expected {expected}"
    lines = [name, *wrapped(f"{finding}{claim}", indent=4)]
    if remark := table_words.remark(each):
        lines += wrapped(remark, indent=4)
    if order.left_out:
        lines += wrapped(f"left out: {table_words.left_out_words(table, name, order)}", indent=4)
    return lines


def wrapped(text: str, indent: int = 0) -> list[str]:
    """The lines of a paragraph, those after the first indented a little more.

    Arguments:
        text: of the paragraph.
        indent: of the first line; without one, no line is indented.
    """
    return textwrap.wrap(
        text,
        WIDTH,
        initial_indent=" " * indent,
        subsequent_indent=" " * (indent + 2 * bool(indent)),
    )
