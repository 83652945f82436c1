"""The plots of the page, as a reader uses them."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

# What waits for a text of JavaScript is refused by the page's own rules.
expect = pytest.importorskip("playwright.sync_api").expect

SVG = "{http://www.w3.org/2000/svg}"
# Its reference takes a fraction of the time of the default rope's.
ROPES = (
    '#problem={"name":"rope","parameters":{"num_nodes":4},"frames":3}&playing=false'
    '&steppers=["semi-implicit-euler","rk4"]&steps=32&ladder=[32]'
)
POINTS = ".plot-markers > g"


def points(page, count):
    """Wait until the order plot has so many points."""
    expect(page.locator(POINTS)).to_have_count(count)


def tab(page, name):
    page.locator(f"[role=tab][data-name={name}]").click()


@pytest.mark.slow
def test_each_press_of_a_key_adds_a_point_and_three_have_an_order(page, lab):
    page.goto(lab + ROPES)
    points(page, 2)
    verdicts = page.locator(".tab-group:last-child .plot-more")
    for pressed in (1, 2):
        page.keyboard.press("=")
        points(page, 2 + 2 * pressed)
    expect(verdicts.first).to_contain_text("observed order")
    assert re.match(r"converges: observed order 1\.0\d\d, \[", verdicts.first.inner_text())
    # The keyboard reaches all points with one stop of Tab, and tells what each is.
    page.locator(f"{POINTS}[tabindex='0']").focus()
    page.keyboard.press("End")
    readout = page.locator(".tab-group:last-child .plot-readout")
    assert "rk4, 128 steps per frame, dt = 0.00781 frames" in readout.inner_text()
    assert (
        page.evaluate("document.activeElement.getAttribute('aria-label')") in readout.inner_text()
    )
    assert page.locator(f"{POINTS}[tabindex='0']").count() == 1
    # Evaluations in place of step sizes: rk4 needs four times as many.
    label = page.locator(".tab-group:last-child .plot-label").last
    assert label.text_content() == "step size dt [frames]"
    page.select_option(".tab-group:last-child select", "evaluations")
    assert label.text_content() == "evaluations of the right-hand side"
    # A click might miss it: answers that come in just then move it.
    page.locator(".tab-group:last-child summary").press("Enter")
    table = page.locator(".tab-group:last-child tbody tr")
    expect(table).to_have_count(6)
    rows = table.evaluate_all(
        "all => all.map((row) => [...row.cells].map((each) => each.innerText))"
    )
    assert [row[:2] for row in rows[:3]] == [
        ["semi-implicit-euler", steps] for steps in ("32", "64", "128")
    ]
    assert int(rows[3][4]) == 4 * int(rows[0][4])


def test_the_cursor_follows_the_motion_and_values_stand_in_the_legend(page, lab):
    page.goto(lab + ROPES)
    points(page, 2)
    cursor, value = page.locator(".plot-cursor").first, page.locator(".plot-value").first
    before = cursor.get_attribute("style")
    page.keyboard.press("ArrowRight")
    assert cursor.get_attribute("style") != before
    expect(value).to_have_text(re.compile("10⁻|0\\.0"))
    played = value.inner_text()
    area = page.locator(".plot-picture").first.bounding_box()
    page.mouse.move(area["x"] + 0.9 * area["width"], area["y"] + 0.5 * area["height"])
    expect(value).not_to_have_text(played)


def test_eigenvalues_move_with_the_step_size(page, lab):
    page.emulate_media(reduced_motion="reduce")
    page.goto(lab + ROPES)
    points(page, 2)
    tab(page, "stability")
    dots = page.locator(".tab-group:last-child .plot-moving i")
    dots.first.wait_for(state="attached")
    notes = page.locator(".tab-group:last-child .plot-notes")
    assert "largest stable step size" in notes.inner_text()

    def heights():
        return dots.evaluate_all("all => all.map((each) => new DOMMatrix(each.style.transform).f)")

    before = heights()
    page.keyboard.press("=")
    expect(page.locator(".tab-group:last-child .plot-meanings")).to_contain_text("dt = 0.0156")
    after = heights()
    assert max(after) - min(after) < 0.6 * (max(before) - min(before))


def test_the_phase_plane_of_a_node_and_of_a_mode(page, lab):
    page.goto(lab + ROPES)
    tab(page, "phase")
    group = page.locator(".tab-group").first
    paths = group.locator(".plot-line")
    named = group.locator(".plot-label").last
    # A free end, if none is chosen.
    expect(named).to_have_text("x of node 3")
    expect(paths).to_have_count(3)
    # As smooth as the motion.
    assert "C" in paths.first.get_attribute("d")
    page.select_option("#node", "1")
    expect(named).to_have_text("x of node 1")
    group.locator("select").select_option("mode 0")
    expect(named).to_have_text(re.compile("mode 0, .* rad"))
    expect(paths).to_have_count(3)


def test_plots_are_files_too(page, lab, tmp_path):
    page.goto(lab + ROPES)
    points(page, 2)
    for kind in ("SVG", "PNG"):
        with page.expect_download() as found:
            page.get_by_role("button", name=f"Download {kind}").first.click()
        assert found.value.suggested_filename == f"error-against-time.{kind.lower()}"
        found.value.save_as(tmp_path / kind)
    root = ET.fromstring((tmp_path / "SVG").read_text())
    assert len(root.findall(f".//{SVG}path")) >= 4
    assert "var(" not in (tmp_path / "SVG").read_text()
    assert Path(tmp_path / "PNG").read_bytes().startswith(b"\x89PNG")


def test_a_phone_shows_all_of_it(page, lab):
    page.set_viewport_size({"width": 360, "height": 740})
    page.goto(lab + ROPES)
    points(page, 2)
    for name in ("error", "energy", "phase", "order", "stability"):
        tab(page, name)
        assert page.evaluate("document.documentElement.scrollWidth") == 360, name
