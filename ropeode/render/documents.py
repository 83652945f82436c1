"""The accuracy table for documents: Markdown, LaTeX and HTML."""

from __future__ import annotations

from ropeode.render import table_words
from ropeode.render.markup import Block, Grid, Heading, Paragraph
from ropeode.study.accuracy_table import AccuracyTable, StepperOrder
from ropeode.validation import counted


def line(table: AccuracyTable) -> str:
    """The problem, the runs, and the order of each stepper."""
    orders = ", ".join(
        f"{each.stepper} {table_words.observed_words(each.order)}" for each in table.orders
    )
    problem = table_words.problem_words(table.problem)
    return f"{problem}; {counted(len(table.rows), 'run')}; orders: {orders}"


def blocks(table: AccuracyTable) -> list[Block]:
    """Runs and orders as tables, between paragraphs."""
    runs = [(row.stepper, *table_words.run_cells(row)) for row in table.rows]
    orders = [
        (*table_words.order_cells(table, each), _remarks(table, each)) for each in table.orders
    ]
    headers = (*table_words.ORDER_HEADERS, "left out")
    theory = [table_words.constant_words(table, each) or "" for each in table.orders]
    if any(theory):
        headers = (*headers, "theory")
        orders = [(*cells, words) for cells, words in zip(orders, theory, strict=True)]
    return [
        Heading(table_words.title(table)),
        Paragraph(table_words.error_words(table)),
        Grid(("stepper", *table_words.RUN_HEADERS), runs, left=frozenset({0})),
        Paragraph(f"Observed orders ({table_words.RUN_HEADERS[2]}, as dt goes to 0):"),
        Grid(headers, orders, left=frozenset({0, 5, 6, 7}), long=frozenset({6, 7})),
        Paragraph(table_words.reference_words(table)),
    ]


def _remarks(table: AccuracyTable, each: StepperOrder) -> str:
    left_out = table_words.left_out_words(table, each)
    return "; ".join(filter(None, (table_words.remark(each), each.order.why, left_out)))
