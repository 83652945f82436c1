"""The accuracy table for documents: Markdown, LaTeX and HTML."""

from __future__ import annotations

from ropeode.render import cells
from ropeode.render.markup import Block, Grid, Heading, Paragraph
from ropeode.study.accuracy_table import AccuracyTable


def blocks(table: AccuracyTable) -> list[Block]:
    """Runs and orders as tables, between paragraphs."""
    runs = [(row.stepper, *cells.run_cells(row)) for row in table.rows]
    orders = [
        (*cells.order_cells(table, each.stepper), _remarks(table, each.stepper))
        for each in table.orders
    ]
    return [
        Heading(cells.title(table)),
        Paragraph(cells.error_words(table)),
        Grid(("stepper", *cells.RUN_HEADERS), runs, left=frozenset({0})),
        Paragraph(f"Observed orders ({cells.RUN_HEADERS[2]}, as dt goes to 0):"),
        Grid(
            (*cells.ORDER_HEADERS, "left out"),
            orders,
            left=frozenset({0, 5, 6}),
            long=frozenset({6}),
        ),
        Paragraph(cells.reference_words(table)),
    ]


def _remarks(table: AccuracyTable, stepper: str) -> str:
    each = next(each for each in table.orders if each.stepper == stepper)
    left_out = cells.left_out_words(table, stepper, each.order)
    return "; ".join(filter(None, (cells.remark(each), each.order.why, left_out)))
