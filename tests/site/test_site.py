"""The site: nothing is missing, nothing leads nowhere, nothing hinders a reader."""

from __future__ import annotations

import pytest

from ropeode.cli import cli
from tests.browser import VIOLATIONS
from tests.test_docstring_examples import PUBLIC
from tools.site_scenes import DOCS, NAMED

DOORS = {
    *("tutorials", "gallery", "teach", "zh"),
    *("howto", "reference", "explanation", "validation", "performance"),
}
# What Sphinx makes beside the pages.
MADE = {"genindex.html", "py-modindex.html", "search.html"}
LOOKED_AT = [
    "index.html",
    "tutorials/verlet.html",
    "reference/api/names/ropeode.accuracy_table.html",
    "reference/table.html",
    "gallery/index.html",
    "zh/verlet.html",
]


def test_every_link_leads_somewhere(pages, site):
    broken = [
        (name, to, anchor)
        for name, page in pages.items()
        for to, anchor in page.links
        if not (site / to).exists() or (anchor and to in pages and anchor not in pages[to].anchors)
    ]
    assert broken == []


def test_every_page_is_two_clicks_from_a_door(pages):
    doors = {f"{each}/index.html" for each in DOORS}
    assert doors <= pages["index.html"].text_links
    once = doors.union(*(pages[each].text_links & pages.keys() for each in doors))
    twice = once.union(*(pages[each].text_links & pages.keys() for each in once))
    assert pages.keys() - twice - MADE - pages["index.html"].text_links <= {"index.html"}


def test_every_public_name_has_a_page_with_an_example(pages):
    listed = pages["reference/api/index.html"].text_links
    for name, value in PUBLIC.items():
        page = f"reference/api/names/ropeode.{name}.html"
        page = page if page in pages else page.replace(".html", "-class.html")
        assert page in listed, name
        assert ">>> " in pages[page].text, name
        assert value.__doc__.split()[0] in pages[page].text, name


def test_every_command_and_option_is_on_its_page(pages):
    text = pages["reference/cli.html"].text
    for name, command in cli.commands.items():
        assert command.get_short_help_str(1000).split(".")[0].split("`")[0] in text, name
        for option in command.params:
            assert all(each in text for each in option.opts if each.startswith("--")), option


def test_tutorials_were_run_and_have_their_scenes(pages, site):
    for name in pages:
        if name.startswith("tutorials/") and name != "tutorials/index.html":
            was_run = "cell_output" in (site / name).read_text()
            assert was_run or "```python" not in (DOCS / name).with_suffix(".md").read_text(), name
    for source in DOCS.glob("tutorials/*.md"):
        played = {to for to, _ in pages[f"tutorials/{source.stem}.html"].links}
        for scene in NAMED.findall(source.read_text()):
            assert f"lab/{scene}.html" in played, source


def test_chinese_pages_say_that_they_are_chinese(pages, site):
    for name in pages:
        lang = '<html lang="zh"' if name.startswith("zh/") else '<html lang="en"'
        assert lang in (site / name).read_text(), name


@pytest.mark.parametrize("name", LOOKED_AT)
def test_nothing_hinders_a_reader(page, address, axe, name):
    for width, scheme in ((1280, "light"), (1280, "dark"), (390, "light")):
        page.set_viewport_size({"width": width, "height": 800})
        page.emulate_media(color_scheme=scheme)
        page.goto(f"{address}{name}")
        page.evaluate(axe)
        assert page.evaluate(VIOLATIONS) == [], (width, scheme)
        assert page.evaluate("document.documentElement.scrollWidth") <= width
