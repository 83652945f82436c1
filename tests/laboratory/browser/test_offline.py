"""The lab in one file, opened from the disk, without Python and without a network."""

from __future__ import annotations

import pytest

from tests.laboratory.browser.recorded_page import POINTS

expect = pytest.importorskip("playwright.sync_api").expect


def test_the_order_is_built_with_keys(page, recorded_file, tmp_path):
    file = tmp_path / "lecture.html"
    file.write_text(recorded_file)
    requests = []
    page.on("request", lambda each: requests.append(each.url.partition(":")[0]))
    page.context.set_offline(True)
    page.goto(file.as_uri())
    for pressed in range(6):
        expect(page.locator(POINTS)).to_have_count(3 + 3 * pressed)
        expect(page.locator("#connection")).to_have_text("")
        page.keyboard.press("=")
    # The sixth press asks for what is not in the file. That says what it needs, and spoils nothing.
    assert page.input_value("#steps") == "1024"
    needs = page.locator("#connection")
    expect(needs).to_have_text('This needs Python: pip install "ropeode[lab]", then ropeode lab.')
    verdict = page.locator(".tab-group:last-child .plot-more").nth(1)
    expect(verdict).to_contain_text("observed order 1.0")
    expect(page.locator(POINTS)).to_have_count(18)
    page.keyboard.press("-")
    expect(needs).to_have_text("")
    page.reload()
    expect(page.locator(POINTS)).to_have_count(18)
    assert page.locator("#certificate details").get_attribute("open") is not None
    assert page.locator("#certificate li").count() > 1
    assert set(requests) <= {"file", "blob", "data"}
