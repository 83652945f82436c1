"""The accuracy table for documents: Markdown, LaTeX and HTML."""

from __future__ import annotations

from ropeode.render import table_words
from ropeode.render.markup import Block, Grid, Heading, Paragraph
from ropeode.study.accuracy_table import AccuracyTable, StepperOrder


def blocks(table: AccuracyTable) -> list[Block]:
    """Runs and orders as tables, between paragraphs."""
    runs = [(row.stepper, *table_words.run_cells(row)) for row in table.rows]
    orders = [
        (*table_words.order_cells(table, each), _remarks(table, each)) for each in table.orders
    ]
    return [
        Heading(table_words.title(table)),
        Paragraph(table_words.error_words(table)),
        Grid(("stepper", *table_words.RUN_HEADERS), runs, left=frozenset({0})),
        Paragraph(f"Observed orders ({table_words.RUN_HEADERS[2]}, as dt goes to 0):"),
        Grid(
            (*table_words.ORDER_HEADERS, "left out"),
            orders,
            left=frozenset({0, 5, 6}),
            long=frozenset({6}),
        ),
        *_constants(table),
        Paragraph(table_words.reference_words(table)),
    ]


def _remarks(table: AccuracyTable, each: StepperOrder) -> str:
    left_out = table_words.left_out_words(table, each)
    return "; ".join(filter(None, (table_words.remark(each), each.order.why, left_out)))


def _constants(table: AccuracyTable) -> list[Block]:
    """The predicted errors beside the measured ones, where they were asked for."""
    words = [(each.stepper, table_words.constant_words(table, each)) for each in table.orders]
    rows = [(stepper, word) for stepper, word in words if word]
    if not rows:
        return []
    grid = Grid(("stepper", "theory"), rows, left=frozenset({0, 1}), long=frozenset({1}))
    return [Paragraph("The leading term of the error, by theory:"), grid]
