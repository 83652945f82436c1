"""What a page of the site holds, as its HTML says."""

from __future__ import annotations

from html.parser import HTMLParser
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote, urlsplit


class Page(NamedTuple):
    """A page.

    Fields:
        anchors: that links may lead to.
        links: paths within the site, and anchors, from all of the page.
        text_links: the paths of those that stand in its text, not in a menu.
        text: the words between its tags.
    """

    anchors: frozenset[str]
    links: frozenset[tuple[str, str]]
    text_links: frozenset[str]
    text: str


def read_page(path: Path, site: Path) -> Page:
    reader = _Reader()
    reader.feed(path.read_text())

    def inside(found: set[str]) -> set[tuple[str, str]]:
        here = [urlsplit(each) for each in found]
        return {
            (str((path.parent / unquote(to) if to else path).resolve().relative_to(site)), anchor)
            for scheme, _, to, _, anchor in here
            if not scheme
        }

    return Page(
        anchors=frozenset(reader.anchors),
        links=frozenset(inside(reader.links)),
        text_links=frozenset(to for to, _ in inside(reader.text_links)),
        text="".join(reader.text),
    )


class _Reader(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.anchors, self.links, self.text_links = set[str](), set[str](), set[str]()
        self.text: list[str] = []
        self.inside = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        self.anchors |= {given[each] or "" for each in ("id", "name") if each in given}
        self.inside += tag == "article"
        for each in ("href", "src"):
            if (to := given.get(each)) is not None:
                self.links.add(to)
                if self.inside and tag == "a":
                    self.text_links.add(to)

    def handle_endtag(self, tag: str) -> None:
        self.inside -= tag == "article"

    def handle_data(self, data: str) -> None:
        if self.inside:
            self.text.append(data)
