"""The grade book in Chromium: sorted by a click, without a fault that axe-core finds."""

from __future__ import annotations

import pytest

from ropeode.classroom import write_pages
from tests.classroom.test_gradebook import CLASS, book_of

pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
from tests.browser import VIOLATIONS
from tests.laboratory.browser.conftest import axe, chromium, needs_chromium, page  # noqa: F401


@pytest.fixture
def book(tmp_path):
    write_pages(book_of(*CLASS), tmp_path)
    return tmp_path


@pytest.mark.slow
def test_nothing_hinders_a_reader(page, book, axe):  # noqa: F811
    for width in (1280, 400):
        page.set_viewport_size({"width": width, "height": 900})
        for name in (*(f"feedback/{each.name}" for each in CLASS), "gradebook"):
            page.goto(f"file://{book / name}.html")
            # Wide tables scroll by themselves.
            assert page.evaluate("document.documentElement.scrollWidth") == width
            if width == 400 or name == "gradebook":
                page.evaluate(axe)
                assert page.evaluate(VIOLATIONS) == [], name
        # On a phone, too, the points are seen at once, whatever the status.
        box = page.get_by_role("button", name="points").bounding_box()
        assert box["x"] + box["width"] <= width


def test_a_click_sorts(page, book):  # noqa: F811
    page.goto(f"file://{book / 'gradebook.html'}")

    def names():
        return page.locator("tbody tr td:first-child").all_text_contents()

    order = page.get_by_role("button", name="order")
    order.click()
    # As numbers; what has none comes last.
    without = ["dora", "e" * 60]
    assert names() == ["bert", "anna", "carla", *without]
    assert order.locator("..").get_attribute("aria-sort") == "ascending"
    order.click()
    assert names() == ["carla", "anna", "bert", *without]
    page.get_by_role("button", name="submission").click()
    assert names() == ["anna", "bert", "carla", *without]
    assert order.locator("..").get_attribute("aria-sort") is None
    page.get_by_role("link", name="anna").click()
    assert page.get_by_role("heading", level=1).text_content() == "anna"
    assert (
        page.get_by_role("img").get_attribute("aria-label")
        == "Errors over step sizes, order-damped"
    )
