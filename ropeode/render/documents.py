"""The accuracy table for documents: Markdown, LaTeX and HTML."""

from __future__ import annotations

import html
from collections.abc import Callable

from tabulate import tabulate

from ropeode.render import cells
from ropeode.study.accuracy_table import AccuracyTable

_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
body {{ font: 16px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 72rem }}
table {{ border-collapse: collapse; margin: 1rem 0; font-variant-numeric: tabular-nums }}
th, td {{ padding: 0.2rem 0.8rem; border-bottom: 1px solid #ccc }}
td:not(:last-child) {{ white-space: nowrap }}
thead th {{ border-bottom: 2px solid #444 }}
</style>
</head>
<body>
{body}
</body>
</html>
"""


def as_markdown(table: AccuracyTable) -> str:
    """Two pipe tables between paragraphs."""
    return _document(
        table,
        "pipe",
        heading=lambda text: f"# {text}",
        paragraph=lambda text: text,
        cell=lambda text: text.replace("|", r"\|").replace("<", "&lt;"),
    )


def as_latex(table: AccuracyTable) -> str:
    """Two tabulars in the style of the booktabs package."""
    escape = {
        "\\": r"\textbackslash{}",
        **{c: f"\\{c}" for c in "&%$#_{}"},
        "<": "$<$",
        "~": r"\~{}",
    }

    def text(words: str) -> str:
        return "".join(escape.get(c, c) for c in words)

    return _document(
        table,
        "latex_booktabs",
        heading=lambda words: f"% needs \\usepackage{{booktabs}}\n\\section*{{{text(words)}}}",
        paragraph=lambda words: text(words) + "\n",
    )


def as_html(table: AccuracyTable) -> str:
    """A page that needs nothing beside it."""
    body = _document(
        table,
        "html",
        heading=lambda text: f"<h1>{html.escape(text)}</h1>",
        paragraph=lambda text: f"<p>{html.escape(text)}</p>",
    )
    return _PAGE.format(title=html.escape(cells.title(table)), body=body)


def _document(
    table: AccuracyTable,
    style: str,
    *,
    heading: Callable[[str], str],
    paragraph: Callable[[str], str],
    cell: Callable[[str], str] = str,
) -> str:
    """Both tables with their words; tabulate escapes what LaTeX and HTML need in cells."""

    def grid(headers: tuple[str, ...], rows: list[tuple[str, ...]], left: set[int]) -> str:
        return tabulate(
            [[cell(entry) for entry in row] for row in rows],
            headers=[cell(entry) for entry in headers],
            tablefmt=style,
            disable_numparse=True,
            colalign=["left" if i in left else "right" for i in range(len(headers))],
        )

    runs = [(row.stepper, *cells.run_cells(row)) for row in table.rows]
    orders = [
        (*cells.order_cells(table, each.stepper), _remarks(table, each.stepper))
        for each in table.orders
    ]
    return "\n\n".join(
        [
            heading(cells.title(table)),
            paragraph(cells.error_words(table)),
            grid(("stepper", *cells.RUN_HEADERS), runs, left={0}),
            paragraph(f"Observed orders ({cells.RUN_HEADERS[2]}, as dt goes to 0):"),
            grid((*cells.ORDER_HEADERS, "left out"), orders, left={0, 5, 6}),
            paragraph(cells.reference_words(table)) + "\n",
        ]
    )


def _remarks(table: AccuracyTable, stepper: str) -> str:
    order = next(each.order for each in table.orders if each.stepper == stepper)
    return "; ".join(filter(None, (order.why, cells.left_out_words(table, stepper, order))))
