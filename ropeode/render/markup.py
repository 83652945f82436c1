"""Headings, paragraphs and tables, written as plain text, Markdown, LaTeX or HTML."""

from __future__ import annotations

import base64
import hashlib
import html
import re
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from tabulate import tabulate

from ropeode.render import latex
from ropeode.render.text_layout import hanging, table, wrapped

_STYLE = """
:root { color-scheme: light }
body { font: 16px/1.5 system-ui, sans-serif; margin: 2rem auto; padding: 0 1rem;
  max-width: 72rem; color: #1a1a1a; background: #fff }
h1 { font-size: 1.6rem; line-height: 1.2 }
h2 { font-size: 1.2rem }
h1, h2 { overflow-wrap: anywhere }
table { border-collapse: collapse; display: block; font-variant-numeric: tabular-nums;
  margin: 1rem 0; max-width: 100%; overflow-x: auto; width: fit-content }
th, td { padding: .2rem .7rem; border-bottom: 1px solid #ccc; vertical-align: top }
td:not(.long) { white-space: nowrap }
td.long:not(:empty) { min-width: 10rem }
thead th, thead td { border-bottom: 2px solid #444 }
svg { max-width: 100%; height: auto }
pre { overflow-x: auto }
"""
_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>{style}</style>
</head>
<body>
<main>
{body}
</main>{script}
</body>
</html>
"""


_NO_COLOURS: Mapping[str, str] = {}


class Heading(NamedTuple):
    """A heading."""

    text: str


class Section(NamedTuple):
    """The heading of a part."""

    text: str


class Paragraph(NamedTuple):
    """A paragraph, which may have lines."""

    text: str


class Grid(NamedTuple):
    """A table.

    Fields:
        headers: of the columns.
        rows: cells as text.
        left: the columns whose text is flush left; numbers are flush right.
        long: the columns whose text may be broken into lines.
        colours: of cells with these texts, in HTML.
        folded: what a page shows in place of the table, until it is clicked; empty if it is not
            folded.
    """

    headers: Sequence[str]
    rows: Sequence[Sequence[str]]
    left: frozenset[int]
    long: frozenset[int] = frozenset()
    colours: Mapping[str, str] = _NO_COLOURS
    folded: str = ""


class Code(NamedTuple):
    """Lines of Python, as they are."""

    text: str


class Drawing(NamedTuple):
    """A picture as SVG, for pages alone."""

    svg: str


Block = Heading | Section | Paragraph | Grid | Code | Drawing


def plain(blocks: Sequence[Block]) -> str:
    """Text for a terminal of 80 columns."""
    lines: list[str] = []
    for block in blocks:
        if isinstance(block, Heading):
            lines += [*wrapped(block.text), ""]
        elif isinstance(block, Section):
            lines += [*[""] * (lines[-1] != ""), block.text, "-" * len(block.text)]
        elif isinstance(block, Paragraph):
            lines += [*_paragraph(block.text), ""]
        elif isinstance(block, Code):
            lines += [*block.text.splitlines(), ""]
        elif isinstance(block, Grid):
            lines += [*table(block.headers, block.rows, block.left, block.long), ""]
    return "\n".join(lines)


def _paragraph(text: str) -> list[str]:
    """Its lines; of several, each stays to the right of a word that it begins with, as `Fix:`."""
    if "\n" not in text:
        return wrapped(text)
    labelled = [re.fullmatch(r"(\w+: )?(.*)", each) for each in text.split("\n")]
    return [line for each in labelled if each for line in hanging(each[1] or "", each[2])]


def markdown(blocks: Sequence[Block], level: int = 1) -> str:
    """Markdown with pipe tables, and with headings of this level."""

    def cell(text: str) -> str:
        return text.replace("|", r"\|").replace("<", "&lt;")

    return _joined(
        blocks,
        heading=lambda text: f"{'#' * level} {text}",
        section=lambda text: f"{'#' * (level + 1)} {text}",
        paragraph=lambda text: text.replace("\n", "\\\n"),
        grid=lambda grid: _tabulated(grid, "pipe", cell),
        code=_fenced,
    )


def _fenced(text: str) -> str:
    """Code in Markdown, in a fence that is not in it."""
    longest = max(map(len, re.findall("`+", text)), default=0)
    fence = "`" * max(3, longest + 1)
    return f"{fence}python\n{text.rstrip()}\n{fence}"


def latex_part(blocks: Sequence[Block]) -> str:
    """Part of a LaTeX document, with tables in the style of the booktabs package."""

    def bold(words: str) -> str:
        return rf"\noindent\textbf{{{latex.text(words)}}}\par\medskip"

    def grid(grid: Grid) -> str:
        pieces = latex.tabulars(grid.headers, grid.rows, grid.left, grid.long)
        return "\n\n".join(
            rf"{{\noindent{latex.SMALL}{chr(10)}{piece}\par}}\medskip" for piece in pieces
        )

    return f"{latex.NEEDS}\n" + _joined(
        blocks,
        heading=bold,
        section=bold,
        paragraph=lambda words: "\\\\\n".join(map(latex.text, words.split("\n"))) + "\n",
        grid=grid,
        code=lambda words: f"\\begin{{verbatim}}\n{words.rstrip()}\n\\end{{verbatim}}",
    )


def html_page(blocks: Sequence[Block]) -> str:
    """A page that needs nothing beside it."""
    title = next(block.text for block in blocks if isinstance(block, Heading))
    return page_frame(title, html_part(blocks, 1))


def page_frame(title: str, body: str, style: str = "", script: str = "") -> str:
    """The frame of all pages. They load nothing, and run no script but their own.

    Arguments:
        title: as text.
        body: in HTML, with the heading.
        style: CSS beside that of all pages.
        script: JavaScript.
    """
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    scripts = f"'sha256-{digest}'" if script else "'none'"
    return _PAGE.format(
        title=html.escape(title),
        style=_STYLE + style,
        body=body.rstrip(),
        script=f"\n<script>{script}</script>" if script else "",
        policy="default-src 'none'; base-uri 'none'; form-action 'none'; "
        f"img-src data:; style-src 'unsafe-inline'; script-src {scripts}",
    )


def html_part(blocks: Sequence[Block], level: int) -> str:
    """The same as part of a page, such as a notebook's, with headings of this level."""
    return _joined(
        blocks,
        heading=lambda text: f"<h{level}>{html.escape(text)}</h{level}>",
        section=lambda text: f"<h{level + 1}>{html.escape(text)}</h{level + 1}>",
        paragraph=lambda text: f"<p>{html.escape(text)}</p>".replace("\n", "<br>\n"),
        grid=_html_grid,
        code=lambda text: f"<pre>{html.escape(text.rstrip())}</pre>",
    )


def _html_grid(grid: Grid) -> str:
    def style(column: int, cell: str) -> str:
        # Notebooks set all cells flush right.
        styles = [f"text-align: {'left' if column in grid.left else 'right'}"]
        if cell in grid.colours:
            styles.append(f"color: {html.escape(grid.colours[cell])}; font-weight: bold")
        words = ' class="long"' if column in grid.long else ""
        return f'{words} style="{"; ".join(styles)}"'

    def row(tag: str, cells: Sequence[str]) -> str:
        # A heading without words is none.
        tags = [tag if cell else "td" for cell in cells]
        inside = "".join(
            f"<{tag}{style(column, cell)}>{html.escape(cell)}</{tag}>"
            for column, (tag, cell) in enumerate(zip(tags, cells, strict=True))
        )
        return f"<tr>{inside}</tr>"

    head = row("th", grid.headers)
    body = "\n".join(row("td", cells) for cells in grid.rows)
    # With the keyboard, too, a table can be scrolled that is wider than the page.
    table = '<table tabindex="0">'
    table = f"{table}\n<thead>\n{head}\n</thead>\n<tbody>\n{body}\n</tbody>\n</table>"
    if not grid.folded:
        return table
    return f"<details>\n<summary>{html.escape(grid.folded)}</summary>\n{table}\n</details>"


def _tabulated(grid: Grid, style: str, cell: Callable[[str], str]) -> str:
    return tabulate(
        [[cell(entry) for entry in row] for row in grid.rows],
        headers=[cell(entry) for entry in grid.headers],
        tablefmt=style,
        disable_numparse=True,
        colalign=["left" if i in grid.left else "right" for i in range(len(grid.headers))],
    )


def _joined(
    blocks: Sequence[Block],
    *,
    heading: Callable[[str], str],
    section: Callable[[str], str],
    paragraph: Callable[[str], str],
    grid: Callable[[Grid], str],
    code: Callable[[str], str],
) -> str:
    written = []
    for block in blocks:
        if isinstance(block, Heading):
            written.append(heading(block.text))
        elif isinstance(block, Section):
            written.append(section(block.text))
        elif isinstance(block, Paragraph):
            written.append(paragraph(block.text))
        elif isinstance(block, Code):
            written.append(code(block.text))
        elif isinstance(block, Drawing):
            # What is before belongs to files.
            written.append(block.svg[block.svg.index("<svg") :].rstrip())
        else:
            written.append(grid(block))
    return "\n\n".join(written) + "\n"
