"""The accuracy table: runs, and the orders that they show."""

from __future__ import annotations

from typing import Any

from ropeode.render import table_words
from ropeode.render.markup import Block, Grid, Heading, Paragraph
from ropeode.render.results import blocks, line, rows
from ropeode.study import AccuracyTable, StepperOrder
from ropeode.study.error_constant import ErrorConstant
from ropeode.validation import counted


@line.register
def _(table: AccuracyTable) -> str:
    orders = ", ".join(
        f"{each.stepper} {table_words.observed_words(each.order)}" for each in table.orders
    )
    problem = table_words.problem_words(table.problem)
    return f"{problem}; {counted(len(table.rows), 'run')}; orders: {orders}"


@blocks.register
def _(table: AccuracyTable) -> list[Block]:
    runs = [(row.stepper, *table_words.run_cells(row)) for row in table.rows]
    sentences = {
        "left out": [table_words.left_out_words(table, each) for each in table.orders],
        "remarks": [_remarks(each) for each in table.orders],
        "theory": [table_words.constant_words(table, each) or "" for each in table.orders],
    }
    said = {name: words for name, words in sentences.items() if any(words)}
    facts = [table_words.order_cells(table, each) for each in table.orders]
    orders = [(*cells, *words) for cells, *words in zip(facts, *said.values(), strict=True)]
    first = len(table_words.ORDER_HEADERS)
    long = frozenset(range(first, first + len(said)))
    return [
        Heading(table_words.title(table)),
        Paragraph(table_words.error_words(table)),
        Grid(("stepper", *table_words.RUN_HEADERS), runs, left=frozenset({0})),
        Paragraph(f"Observed orders ({table_words.RUN_HEADERS[2]}, as dt goes to 0):"),
        Grid((*table_words.ORDER_HEADERS, *said), orders, left=long | {0, first - 1}, long=long),
        Paragraph(table_words.reference_words(table)),
    ]


def _remarks(each: StepperOrder) -> str:
    return "; ".join(filter(None, (table_words.order_remark(each), each.order.why)))


@rows.register
def _(table: AccuracyTable) -> list[dict[str, Any]]:
    """One for each run, with the order of its stepper and the reference's bound."""
    orders = {each.stepper: each for each in table.orders}
    lines = []
    for row in table.rows:
        each = orders[row.stepper]
        low, high = each.order.ci95 or (None, None)
        lines.append(
            {
                **vars(row),
                "expected_order": each.expected,
                "observed_order": each.order.observed,
                "order_low": low,
                "order_high": high,
                "verdict": each.order.verdict,
                "used_for_order": row.dt in each.order.used,
                "error_predicted": _error_predicted(row.dt, each.constant),
                "reference_bound": float(table.reference.bound(table.norm)[-1]),
            }
        )
    return lines


def _error_predicted(dt: float, constant: ErrorConstant | None) -> float | None:
    """The leading term of the error of a run."""
    if constant is None or constant.predicted is None or constant.order is None:
        return None
    return constant.predicted * dt**constant.order
