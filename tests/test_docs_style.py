"""Long pages say first what comes out, and the prose keeps to a width."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[1] / "docs"
PAGES = sorted(
    page
    for room in ("explanation", "performance", "validation")
    for page in (DOCS / room).glob("*.md")
)
LONG = 100
SUMMARY = 5
WIDTH = 120


# What else may come first: a heading, a table, a list, code, a comment, a picture, a formula.
NO_SUMMARY = re.compile(r"#|\||- |\d+\. |```|<|!\[|\$\$")
NO_PROSE = re.compile(r"^```.*?^```|^<!-- \[\[\[cog.*?\[\[\[end\]\]\] -->|^\|.*?$", re.M | re.S)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_long_page_begins_with_a_summary_and_prose_keeps_to_a_width(page):
    text = page.read_text()
    if text.count("\n") > LONG:
        first = text.split("\n\n")[1]
        assert not NO_SUMMARY.match(first)
        assert 1 < len(first.splitlines()) <= SUMMARY
    assert [line for line in NO_PROSE.sub("", text).splitlines() if len(line) > WIDTH] == []
