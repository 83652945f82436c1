"""What a page of the site holds, as its HTML says."""

from __future__ import annotations

import html
import re
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
    """By the attributes of tags in what Sphinx writes; in the text of a page quotes are escaped."""
    whole = path.read_text()
    article = whole.partition("<article")[2].rpartition("</article>")[0]

    def values(attribute: str, text: str = whole) -> set[str]:
        return {html.unescape(each) for each in re.findall(rf'\s{attribute}="([^"]*)"', text)}

    def inside(found: set[str]) -> frozenset[tuple[str, str]]:
        here = [urlsplit(each) for each in found]
        return frozenset(
            (str((path.parent / unquote(to) if to else path).resolve().relative_to(site)), anchor)
            for scheme, _, to, _, anchor in here
            if not scheme
        )

    return Page(
        anchors=frozenset(values("(?:id|name)")),
        links=inside(values("(?:href|src)")),
        text_links=frozenset(to for to, _ in inside(values("href", article))),
        text=html.unescape(re.sub("<[^>]*>", "", article)),
    )
