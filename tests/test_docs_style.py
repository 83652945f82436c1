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


def summary_of(text: str) -> list[str]:
    """The lines of the first paragraph after the title; none if something else comes first."""
    first = text.partition("\n\n")[2].partition("\n\n")[0]
    return [] if re.match(r"#|\||- |\d+\. |```|<|!\[|\$\$", first) else first.splitlines()


def prose(text: str) -> list[str]:
    """The lines that were written by hand: no code, no tables, nothing computed."""
    text = re.sub(r"^```.*?^```|^<!-- \[\[\[cog.*?\[\[\[end\]\]\] -->", "", text, flags=re.M | re.S)
    return [line for line in text.splitlines() if not line.startswith("|")]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_long_page_begins_with_a_summary_and_prose_keeps_to_a_width(page):
    text = page.read_text()
    if text.count("\n") > LONG:
        assert 1 < len(summary_of(text)) <= SUMMARY
    assert [line for line in prose(text) if len(line) > WIDTH] == []


def test_what_counts_as_a_summary():
    assert summary_of("# A\n\nOne.\nTwo.\n\n## B\n") == ["One.", "Two."]
    for first in ("## B", "| a | b |", "```sh\nmake\n```", "- one", "$$ x $$", "<!-- [[[cog"):
        assert summary_of(f"# A\n\n{first}\n\nOne.\n") == []
    computed = "<!-- [[[cog\n]]] -->\nc\n<!-- [[[end]]] -->"
    assert "".join(prose(f"a\n```sh\nb\n```\n{computed}\n| d |\ne\n")) == "ae"
