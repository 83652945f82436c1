"""What the page shows without Python, by pressing its keys and reading it."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

import pytest

from tests.laboratory.browser.recorded_page import (
    POINTS,
    STEPS,
    STILL,
    labels,
    opened,
    picture,
    scene_of,
    tab,
)

# What waits for a text of JavaScript is refused by the page's own rules.
expect = pytest.importorskip("playwright.sync_api").expect

SVG = "{http://www.w3.org/2000/svg}"


def colours(page):
    """Which colours of steppers are on the canvas."""
    return page.evaluate(
        """() => {
          const canvas = document.getElementById("canvas");
          const context = canvas.getContext("2d");
          const { data } = context.getImageData(0, 130, canvas.width, canvas.height - 200);
          const seen = new Set();
          for (let i = 0; i < data.length; i += 4) seen.add(data.slice(i, i + 3).join());
          return ["0,114,178", "213,94,0", "0,158,115"].map((each) => seen.has(each));
        }"""
    )


def test_the_motion_begins_at_once(alone, address):
    opened(alone, address)
    alone.wait_for_function(
        "parseFloat(document.querySelector('#time-shown').textContent.split(' ')[1]) > 0.3"
    )
    first = alone.evaluate("performance.getEntriesByName('first picture')[0].startTime")
    assert first < 3000
    assert colours(alone)[0]


def test_each_press_halves_the_step_and_adds_points_that_say_what_they_are(alone, address):
    opened(alone, address, **STILL)
    points, plot = alone.locator(POINTS), alone.locator(STEPS)
    for pressed in range(3):
        assert alone.input_value("#steps") == str(16 * 2**pressed)
        expect(points).to_have_count(3 + 3 * pressed)
        alone.keyboard.press("=" if pressed < 2 else "-")
    assert scene_of(alone.url)["ladder"] == [16, 32, 64]
    assert "dt = 0.0313" in alone.inner_text("#dt")
    expect(points).to_have_count(9)
    assert "explicit-euler, 32 steps/frame" in picture(alone)
    # Points that are left out say why.
    of_euler = [each for each in labels(alone) if each.startswith("explicit-euler")]
    assert len(of_euler) == 3
    assert all(each.endswith("; left out: unstable") for each in of_euler)
    meanings = plot.locator(".plot-meanings").inner_text()
    assert "left out: diverged, or above this plot" in meanings
    # Two that converge have their slopes, and theory's lines are dashed.
    slopes = plot.locator(".plot-text").all_text_contents()
    assert [float(each) for each in slopes] == pytest.approx([1, 4], abs=0.2)
    assert "predicted by theory" in meanings
    expect(plot.locator(".plot-line[stroke-dasharray='7 4']")).to_have_count(3)
    legend = plot.locator(".plot-legend").inner_text()
    assert "predicted error 28.25 dt" in legend
    assert re.search(r"converges: observed order 1\.0\d\d, \[", legend)
    # The keyboard reaches all points with one stop of Tab, and tells what each is.
    stops = plot.locator(f"{POINTS}[tabindex='0']")
    stops.focus()
    alone.keyboard.press("End")
    readout = plot.locator(".plot-readout").inner_text()
    assert "rk4, 64 steps per frame, dt = 0.0156 frames" in readout
    assert alone.evaluate("document.activeElement.getAttribute('aria-label')") in readout
    expect(stops).to_have_count(1)
    # Their numbers stand in a table: rk4 evaluates four times as often.
    plot.locator("summary").press("Enter")
    expect(plot.locator("tbody tr")).to_have_count(9)
    rows = plot.locator("tbody tr").evaluate_all(
        "all => all.map((row) => [...row.cells].map((each) => each.innerText))"
    )
    assert [row[:2] for row in rows[3:6]] == [
        ["semi-implicit-euler", steps] for steps in ("16", "32", "64")
    ]
    assert int(rows[6][4]) == 4 * int(rows[3][4])
    # The axis is also work and time.
    label = plot.locator(".plot-label").last
    expect(label).to_have_text("step size dt [frames]")
    for value, words in (
        ("evaluations", "evaluations of the right-hand side"),
        ("seconds", "time to compute [s]"),
    ):
        plot.locator("select").select_option(value)
        expect(label).to_have_text(words)
        expect(points).to_have_count(9)
    # Eigenvalues stand where the step size that is shown puts them.
    tab(alone, "stability")
    plot.locator(".plot-moving i").first.wait_for(state="attached")
    expect(plot.locator(".plot-meanings")).to_contain_text("dt = 0.0313")
    assert "largest stable step size" in plot.locator(".plot-notes").inner_text()


def test_keys_play_step_hide_and_restart(alone, address):
    opened(alone, address, **STILL)
    shown, scrub = alone.locator("#time-shown"), alone.locator("#scrub")
    cursor = alone.locator(".plot-cursor").first
    sample, before = float(scrub.get_attribute("step")), cursor.get_attribute("style")
    alone.keyboard.press("ArrowRight")
    assert float(scrub.input_value()) == 3.5 + sample
    assert cursor.get_attribute("style") != before
    for _ in range(2):
        alone.keyboard.press("ArrowLeft")
    assert float(scrub.input_value()) == 3.5 - sample
    assert re.fullmatch(r"frame 3\.[1-4] of 40", shown.inner_text())
    assert colours(alone)[0]
    alone.keyboard.press("1")
    assert not colours(alone)[0]
    assert not alone.is_checked("#shown-0")
    alone.keyboard.press("1")
    assert colours(alone)[0]
    assert alone.input_value("#speed") == "4"
    alone.keyboard.press("ArrowUp")
    assert alone.input_value("#speed") == "8"
    for _ in range(2):
        alone.keyboard.press("ArrowDown")
    assert scene_of(alone.url)["speed"] == 2
    alone.keyboard.press("r")
    expect(shown).to_have_text(re.compile(r"frame (0\.[2-9]|1\.)"))
    alone.keyboard.press("Space")
    still = shown.inner_text()
    alone.wait_for_timeout(150)
    assert shown.inner_text() == still
    assert scene_of(alone.url)["playing"] is False
    alone.get_by_role("button", name="Play").click()
    expect(shown).not_to_have_text(still)


def test_plots_have_the_values_of_the_time_that_is_shown_as_the_table_has_them(alone, address):
    opened(alone, address, **STILL)
    value, picture = alone.locator(".plot-value").nth(1), alone.locator(".plot-picture").first
    # The pointer shows those of another time.
    before, area = value.inner_text(), picture.bounding_box()
    alone.mouse.move(area["x"] + 0.9 * area["width"], area["y"] + 0.5 * area["height"])
    expect(value).not_to_have_text(before)
    alone.locator("#scrub").fill("21")
    assert alone.inner_text("#time-shown") == "frame 21.0 of 40"
    alone.locator(".plot-values summary").first.click()
    row = alone.locator(".plot-table").first.locator("tbody tr").nth(21).locator("td")
    expect(row.first).to_have_text("21.0")
    expect(value).to_have_text(row.nth(3).inner_text())


def test_keys_that_an_element_needs_are_left_to_it_and_help_names_every_key(alone, address):
    opened(alone, address, **STILL)
    alone.focus("#parameter-damping")
    alone.keyboard.press("=")
    alone.keyboard.press("1")
    assert alone.input_value("#steps") == "16"
    assert alone.is_checked("#shown-0")
    alone.focus("#scrub")
    alone.keyboard.press("ArrowRight")
    sample = float(alone.get_attribute("#scrub", "step"))
    assert float(alone.input_value("#scrub")) == 3.5 + sample
    alone.focus("#more")
    alone.keyboard.press("Space")
    assert alone.input_value("#steps") == "32"
    alone.keyboard.press("?")
    text = alone.inner_text("#help")
    assert all(key in text for key in ("=", "-", "Space", "←", "→", "1", "5", "r", "?"))
    alone.keyboard.press("=")
    assert alone.input_value("#steps") == "32"
    alone.keyboard.press("Escape")
    assert not alone.is_visible("#help")


def test_euler_flies_apart_beside_the_grey_reference_and_the_view_follows(alone, address):
    def drawn(time):
        alone.locator("#scrub").fill(str(time))
        svg = picture(alone)
        (length,) = re.findall(r'text-anchor="middle"[^>]*>([\d.]+)</text>', svg)
        bar = re.search(r'd="M([\d.]+),[\d.]+L\1,[\d.]+L([\d.]+)', svg)
        return svg, (float(bar[2]) - float(bar[1])) / float(length)

    opened(alone, address, playing=False, time=0)
    before, scale = drawn(0)
    # The reference is broad and grey, explicit Euler is blue.
    assert re.search(r'stroke="#8a939c" stroke-width="7"', before)
    assert re.search(r'stroke="#0072B2" stroke-width="2.2"', before)
    crosses = r'stroke="#0072B2" stroke-width="2"'
    assert not re.search(crosses, before)
    # It grows while Euler's nodes leave, each of them marked, and returns when they are gone.
    left, wide = drawn(3.75)
    assert wide < 0.8 * scale
    assert re.search(crosses, left)
    _, returned = drawn(30)
    assert returned == pytest.approx(scale, rel=0.01)
    notes = "explicit-euler: 15 of 15 nodes have left the view, the first at frame 3"
    assert notes in alone.inner_text("#notes")


def test_the_stage_shows_what_is_chosen_and_its_link_shows_it_again(alone, address):
    opened(alone, address, playing=False, time=0)
    # A node by a click, and by the keyboard.
    circles = re.findall(r'<circle cx="([\d.]+)" cy="([\d.]+)"', picture(alone))
    x, y = map(float, circles[5])
    alone.click("#canvas", position={"x": x, "y": y})
    node = int(alone.input_value("#node"))
    assert node in (5, 6)
    alone.focus("#node")
    alone.keyboard.press("ArrowDown")
    assert alone.input_value("#node") == str(node + 1)
    alone.select_option("#magnified", "1000")
    assert "1000 times the error" in alone.inner_text("#notes")
    assert picture(alone).count("<clipPath") == 1
    alone.select_option("#layout", "beside")
    shown = picture(alone)
    assert shown.count("<clipPath") == 3
    assert "errors drawn × 1000" in shown
    alone.keyboard.press("=")
    alone.keyboard.press("2")
    link = alone.url
    alone.goto("about:blank")
    alone.goto(link)
    expect(alone.locator("#time-shown")).to_have_text(re.compile("frame 0.0"))
    assert alone.url == link
    for name, value in (("steps", 32), ("layout", "beside"), ("magnified", 1000)):
        assert alone.input_value(f"#{name}") == str(value)
        assert scene_of(link)[name] == value
    assert scene_of(link)["node"] == node + 1
    assert not alone.is_checked("#shown-1")


def test_lessons_are_chosen_or_named_in_the_address_in_both_languages(alone, address):
    alone.goto(f"{address}?scene=verlet-start")
    expect(alone.locator("#time-shown")).to_be_attached()
    assert alone.input_value("#scene") == "verlet-start"
    assert "Verlet needs two positions" in alone.inner_text("#scenes")
    assert "stormer-verlet:start=rest" in scene_of(alone.url)["steppers"]
    alone.select_option("#scene", "first-order-plot")
    # Three sentences, and a page of the documentation.
    assert alone.locator("#scenes p").count() == 4
    assert scene_of(alone.url)["steppers"] == ["semi-implicit-euler", "stormer-verlet", "rk4"]
    groups = alone.locator("#scene optgroup")
    assert groups.evaluate_all("all => all.map((each) => each.children.length)") == [8, 41]
    alone.select_option("#language", "zh")
    expect(alone.locator("html")).to_have_attribute("lang", "zh")
    assert "每帧步数" in alone.inner_text("#transport")
    assert all(each.endswith("。") for each in alone.locator("#scenes p").all_inner_texts())
    assert alone.title() == "ropeode 实验室"
    assert scene_of(alone.url)["language"] == "zh"


def test_what_needs_python_says_so(alone, address):
    opened(alone, address, **STILL)
    # What is shown is certified.
    alone.click("#certificate summary")
    lines = alone.locator("#certificate li").all_inner_texts()
    assert re.match(r"Level \w+: .* Estimated error bound at the end: position", lines[0])
    assert any("apart" in each for each in lines[1:])
    alone.click("#take")
    alone.click("#copy-command")
    assert alone.input_value("#take-along textarea").startswith("ropeode table")
    alone.click("#save-gif")
    assert "pip install" in alone.inner_text("#take-along")
    with alone.expect_download() as download:
        alone.click("#save-png")
    assert download.value.path().read_bytes().startswith(b"\x89PNG")
    alone.keyboard.press("Escape")
    alone.fill("#parameter-damping", "0.5")
    alone.keyboard.press("Enter")
    expect(alone.locator("#connection")).to_contain_text("pip install")


def test_error_and_energy_are_drawn_with_what_is_not_known(alone, address, tmp_path):
    opened(alone, address, **STILL)
    group = alone.locator(".tab-group").first
    lines, band = group.locator(".plot-line"), group.locator(".plot-band")
    expect(lines).to_have_count(3)
    expect(band).to_have_count(1)
    ticks = group.locator(".plot-axes text").all_text_contents()
    assert {"10⁻¹⁰", "time [frames]"} <= set(ticks)
    assert "10 × the reference's estimated bound" in group.inner_text()
    # They are files too.
    for kind in ("SVG", "PNG"):
        with alone.expect_download() as found:
            alone.get_by_role("button", name=f"Download {kind}").first.click()
        assert found.value.suggested_filename == f"error-against-time.{kind.lower()}"
        found.value.save_as(tmp_path / kind)
    root = ET.fromstring((tmp_path / "SVG").read_text())
    assert len(root.findall(f".//{SVG}path")) >= 4
    assert "var(" not in (tmp_path / "SVG").read_text()
    assert (tmp_path / "PNG").read_bytes().startswith(b"\x89PNG")
    before = [each.get_attribute("d") for each in lines.all()]
    tab(alone, "energy")
    expect(group.locator("h2")).to_have_text("Energy minus the reference's")
    expect(lines).to_have_count(3)
    expect(band).to_have_count(1)
    assert [each.get_attribute("d") for each in lines.all()] != before
    assert "largest difference" in group.locator(".plot-legend").inner_text()
