"""What hinders a reader of the page: nothing, in both languages and behind all tabs."""

from __future__ import annotations

import pytest

from tests.browser import VIOLATIONS
from tests.laboratory.browser.recorded_page import STILL, opened, tab

expect = pytest.importorskip("playwright.sync_api").expect


@pytest.mark.parametrize(
    ("size", "dark", "language"),
    [((1280, 720), False, "en"), ((360, 740), True, "zh")],
    ids=["wide", "phone"],
)
def test_nothing_hinders_a_reader(alone, address, axe, size, dark, language):
    alone.set_viewport_size({"width": size[0], "height": size[1]})
    alone.emulate_media(color_scheme="dark" if dark else "light")
    opened(alone, address, **STILL, node=3, language=language)
    expect(alone.locator("html")).to_have_attribute("lang", language)
    alone.evaluate(
        "document.querySelectorAll('#controls details').forEach((each) => (each.open = true))"
    )
    alone.evaluate(axe)
    assert alone.evaluate(VIOLATIONS) == []
    for name in ("energy", "phase", "stability", "error", "order"):
        tab(alone, name)
        assert alone.evaluate(VIOLATIONS, "#plots") == [], name
        assert alone.evaluate("document.documentElement.scrollWidth") <= size[0], name


def test_the_keyboard_alone_reaches_every_control(alone, address):
    opened(alone, address, **STILL)
    wanted = alone.evaluate(
        """() => [...document.querySelectorAll("header button, header select, #controls button, "
          + "#controls input, #controls select, #controls summary, #stage button, #stage input, "
          + "#stage select")].filter((each) => each.checkVisibility()).length"""
    )
    seen = set()
    for _ in range(wanted + 20):
        alone.keyboard.press("Tab")
        seen.add(
            alone.evaluate("[...document.querySelectorAll('*')].indexOf(document.activeElement)")
        )
    reached = alone.evaluate(
        """(seen) => { const all = [...document.querySelectorAll("*")];
          const places = "header *, #controls *, #stage *";
          return seen.filter((i) => all[i]?.matches(places)).length; }""",
        list(seen),
    )
    assert reached >= wanted
