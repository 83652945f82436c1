"""The grade book in Chromium: sorted by a click, without a fault that axe-core finds."""

from __future__ import annotations

import pytest

from ropeode.classroom import Item, Outcome, Submission, grade_book, parts, write_pages
from ropeode.render import Grid

pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
from tests.browser import VIOLATIONS
from tests.laboratory.browser.conftest import axe, chromium, needs_chromium, page  # noqa: F401

ERRORS = {"position": {"errors": [4e-2, 2e-2, 1e-2], "observed": 1.0}}
ORDERS = {"order": {"dt": [0.1, 0.05, 0.025], "expected": 2, "quantities": ERRORS}}
REPORT = parts(Grid(["", "finding"], [["ok", "words"]], frozenset({0, 1}), frozenset({1})))


@pytest.fixture
def book(tmp_path):
    outcomes = [
        Outcome("anna", "checked", "right", 2.0, findings={"order": "pass"}, orders=ORDERS),
        Outcome("bert", "out of time", message="it did not finish " * 20),
        Outcome("carla", "checked", "wrong", 10.0, findings={"order": "fail"}, report=REPORT),
        Outcome("dora", "checked", "undetermined", -0.5, findings={"order": "undetermined"}),
    ]
    submissions = [Submission(each.name, (), "", "") for each in outcomes]
    rubric = (Item("runs", 2.0), Item("order", 8.0, ("order",)))
    write_pages(grade_book(submissions, outcomes, rubric), tmp_path)
    return tmp_path


def test_nothing_hinders_a_reader(page, book, axe):  # noqa: F811
    for width in (1280, 400):
        page.set_viewport_size({"width": width, "height": 900})
        for name in ("feedback/anna", "feedback/bert", "feedback/carla", "gradebook"):
            page.goto(f"file://{book / name}.html")
            # Wide tables scroll by themselves.
            assert page.evaluate("document.documentElement.scrollWidth") == width
            if width == 400 or name == "gradebook":
                page.evaluate(axe)
                assert page.evaluate(VIOLATIONS) == [], name
        # On a phone, too, the points are seen at once.
        box = page.get_by_role("button", name="points").bounding_box()
        assert box["x"] + box["width"] <= width


def test_a_click_sorts(page, book):  # noqa: F811
    page.goto(f"file://{book / 'gradebook.html'}")

    def names():
        return page.locator("tbody tr td:first-child").all_text_contents()

    order = page.get_by_role("button", name="order")
    order.click()
    # As numbers; what has none comes last.
    assert names() == ["dora", "anna", "carla", "bert"]
    assert order.locator("..").get_attribute("aria-sort") == "ascending"
    order.click()
    assert names() == ["carla", "anna", "dora", "bert"]
    page.get_by_role("button", name="submission").click()
    assert names() == ["anna", "bert", "carla", "dora"]
    assert order.locator("..").get_attribute("aria-sort") is None
    page.get_by_role("link", name="anna").click()
    assert page.get_by_role("heading", level=1).text_content() == "anna"
    assert page.get_by_role("img").get_attribute("aria-label") == "Errors over step sizes, order"
