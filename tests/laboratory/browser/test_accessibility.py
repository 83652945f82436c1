"""What axe-core finds wrong with the page: nothing, in both languages and behind all tabs."""

from __future__ import annotations

import pytest

from tests.browser import VIOLATIONS

TABS = ("energy", "phase", "stability", "error", "order")


@pytest.mark.parametrize("language", ["en", "zh"])
def test_nothing_hinders_a_reader(page, lab, axe, language):
    if language == "zh":
        page.emulate_media(color_scheme="dark")
    page.goto(f'{lab}#language="{language}"&playing=false&node=3')
    page.wait_for_selector(".plot-markers > g")
    assert page.locator("html").get_attribute("lang") == language
    page.evaluate(axe)
    assert page.evaluate(VIOLATIONS) == []
    for name in TABS:
        page.locator(f"[role=tab][data-name={name}]").click()
        assert page.evaluate(VIOLATIONS, "#plots") == [], name
