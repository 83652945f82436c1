"""The grade book as a page, and a page of feedback for each submission."""

from __future__ import annotations

import html
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import quote

from ropeode.classroom.gradebook import HEADERS, GradeBook, Row
from ropeode.classroom.order_plot import order_plot
from ropeode.classroom.outcome import Outcome
from ropeode.files import make_folder, write_whole
from ropeode.render import (
    Block,
    Code,
    Drawing,
    Grid,
    Heading,
    Paragraph,
    formatted,
    html_part,
    markdown,
    page_frame,
)

_STYLE = """\
.book { overflow-x: auto }
.book table { display: table; max-width: none; overflow: visible }
.book td:first-child, .book th:first-child { position: sticky; left: 0; background: #fff;
  max-width: 10rem; overflow-wrap: anywhere; white-space: normal }
th { text-align: left }
td.number, th.number { text-align: right }
td.long { overflow-wrap: anywhere }
thead button { font: inherit; font-weight: bold; background: none; border: 0; padding: 0;
  color: inherit; cursor: pointer; white-space: nowrap }
thead button::after { content: " \\2195"; color: #767676 }
[aria-sort=ascending] button::after { content: " \\2191"; color: inherit }
[aria-sort=descending] button::after { content: " \\2193"; color: inherit }
.right { color: #00703c; font-weight: bold }
.wrong { color: #c00000; font-weight: bold }
.undetermined, .none { color: #a35200; font-weight: bold }
td svg { width: 110px; max-width: none; display: block }
td svg text, td svg g { display: none }
.cut { display: -webkit-box; -webkit-box-orient: vertical; -webkit-line-clamp: 3;
  overflow: hidden }
pre { background: #f5f5f5; padding: .7rem }
.mark { display: inline-block; background: #fff3d6; padding: 0 .4rem }
@media (max-width: 40rem) { .book { font-size: .875rem }
  .book td, .book th { padding: .2rem .15rem } .book td:first-child { max-width: 6rem }
  .book td:not(.number) { white-space: normal }
  th:not([aria-sort]) button::after { content: none } }
@media print { button::after { content: none !important } .cut { -webkit-line-clamp: none } }
"""
_SORT = """
for (const [column, button] of document.querySelectorAll("thead button").entries()) {
  button.addEventListener("click", () => {
    const head = button.closest("th"), body = document.querySelector("tbody");
    const down = head.getAttribute("aria-sort") === "ascending";
    for (const each of head.parentElement.children) each.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", down ? "descending" : "ascending");
    const key = (row) => row.children[column].textContent.trim();
    const numbers = head.classList.contains("number");
    const rows = [...body.children].sort((one, other) => {
      const [a, b] = [key(one), key(other)];
      if (a === "" || b === "") return (a === "") - (b === "");
      const order = numbers ? Number(a) - Number(b) : a.localeCompare(b);
      return down ? -order : order;
    });
    body.replaceChildren(...rows);
  });
}
"""
# A feedback page has headings of its own above the report.
_LEVEL = 2
_NUMBERS, _LONG = ("order", "points"), ("message", "marks")


def write_pages(book: GradeBook, folder: Path) -> None:
    """Write the grade book and the feedback.

    Arguments:
        book: of a class.
        folder: that gets the grade book as `gradebook.csv`, `gradebook.json` and `gradebook.html`,
            and a folder `feedback` with a page for each submission, in HTML and Markdown.
    """
    feedback = folder / "feedback"
    make_folder(feedback)
    for row in book.rows:
        name, head = row.outcome.name, _feedback_head(row, book)
        write_whole(feedback / f"{name}.html", _feedback_page(row, head))
        write_whole(feedback / f"{name}.md", _feedback_text(row, head))
    for form in ("csv", "json"):
        write_whole(folder / f"gradebook.{form}", formatted(book, form))
    write_whole(folder / "gradebook.html", _page(book))


def _page(book: GradeBook) -> str:
    heads = "".join(
        f'<th scope="col"{_kind(head)}><button type="button">{head}</button></th>'
        for head in HEADERS
    )
    lines = "\n".join(f"<tr>{_row_cells(row)}</tr>" for row in book.rows)
    return page_frame(
        "Grade book",
        f"<h1>Grade book</h1>\n<p>{html.escape(book.summary)}</p>\n"
        f'<div class="book" tabindex="0" role="region" aria-label="Grade book"><table>\n'
        f'<thead><tr>{heads}<th scope="col">errors</th></tr>'
        f"</thead>\n<tbody>\n{lines}\n</tbody>\n</table></div>",
        _STYLE,
        _SORT,
    )


def _kind(head: str) -> str:
    return ' class="number"' if head in _NUMBERS else ' class="long"' if head in _LONG else ""


def _row_cells(row: Row) -> str:
    cells = []
    for head, cell in zip(HEADERS, row.cells, strict=True):
        words = html.escape(cell)
        if head == "submission":
            words = f'<a href="feedback/{quote(cell)}.html">{words}</a>'
        elif head == "verdict" and cell:
            words = f'<span class="{words}">{words}</span>'
        elif head == "status" and cell != "checked":
            words = f'<span class="none">{words}</span>'
        elif head == "message":
            # The feedback has all of it.
            words = f'<span class="cut">{words}</span>'
        elif head == "marks" and cell:
            words = " ".join(f'<span class="mark">{html.escape(m)}</span>' for m in row.marks)
        cells.append(f"<td{_kind(head)}>{words}</td>")
    return "".join([*cells, f"<td>{_plot(row.outcome)[1]}</td>"])


def _plot(outcome: Outcome) -> tuple[str, str]:
    """The first check of order that failed, or else the first that there is, and its plot."""
    names = sorted(outcome.orders, key=lambda name: outcome.findings.get(name) != "fail")
    if not names:
        return "", ""
    try:
        return names[0], order_plot(names[0], outcome.orders[names[0]])
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError):
        # It came from the submission's process, and may be anything.
        return "", ""


def _feedback_head(row: Row, book: GradeBook) -> list[Block]:
    """What stands above the report: the points, in all and for each item."""
    points = [
        [item.name, f"{earned:g}", f"{item.points:g}"]
        for item, earned in zip(book.rubric, row.earned, strict=True)
    ]
    return [
        Heading(row.outcome.name),
        Paragraph(f"{row.points:g} of {book.total:g} points."),
        Grid(["part", "points", "of"], points, frozenset({0})),
    ]


def _feedback_page(row: Row, head: Sequence[Block]) -> str:
    check, plot = _plot(row.outcome)
    errors = [Heading(f"Errors: {check}"), Drawing(plot)] if plot else []
    report = html_part([*row.outcome.blocks, *errors], _LEVEL)
    return page_frame(row.outcome.name, f"{html_part(head, 1)}\n{report}", _STYLE)


def _feedback_text(row: Row, head: Sequence[Block]) -> str:
    parts = ((head, 1), (row.outcome.blocks, _LEVEL))
    return "\n".join(markdown([*map(_as_words, blocks)], level) for blocks, level in parts)


def _as_words(block: Block) -> Block:
    """A part of a report in which Markdown finds no link and no HTML."""
    if isinstance(block, Code | Drawing):
        return block
    if isinstance(block, Grid):
        rows = [[_links_apart(cell) for cell in row] for row in block.rows]
        return block._replace(headers=[*map(_links_apart, block.headers)], rows=rows)
    return block._replace(text=_inert(block.text))


def _inert(text: str) -> str:
    return _links_apart(text).replace("<", "&lt;")


def _links_apart(text: str) -> str:
    return text.replace("](", r"]\(").replace("]:", r"]\:")
