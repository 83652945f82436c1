"""What the page shows without Python, by pressing its keys and reading it."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

import pytest

from tests.browser import VIOLATIONS
from tests.laboratory.browser import recorded_page as lab

# What waits for a text of JavaScript is refused by the page's own rules.
expect = pytest.importorskip("playwright.sync_api").expect


def is_drawn(page):
    """Whether the colour of the first stepper is on the canvas."""
    return page.evaluate(
        """() => {
          const canvas = document.getElementById("canvas"), context = canvas.getContext("2d");
          const { data } = context.getImageData(0, 130, canvas.width, canvas.height - 200);
          const is = (each, i) => i % 4 === 0 && data.slice(i, i + 3).join() === "0,114,178";
          return data.some(is);
        }"""
    )


def test_the_motion_begins_at_once_and_keys_play_step_hide_and_restart(alone, address):
    lab.opened(alone, address)
    shown, scrub = alone.locator("#time-shown"), alone.locator("#scrub")
    alone.wait_for_function(
        "parseFloat(document.querySelector('#time-shown').textContent.split(' ')[1]) > 0.3"
    )
    first = alone.evaluate("performance.getEntriesByName('first picture')[0].startTime")
    assert first < 3000
    assert is_drawn(alone)
    alone.keyboard.press("Space")
    still = shown.inner_text()
    alone.wait_for_timeout(150)
    assert shown.inner_text() == still
    assert lab.scene_of(alone.url)["playing"] is False
    # An arrow moves by a sample; the plots move along.
    scrub.fill("3.5")
    cursor, sample = alone.locator(".plot-cursor").first, float(scrub.get_attribute("step"))
    before = cursor.get_attribute("style")
    alone.evaluate("document.activeElement.blur()")
    alone.keyboard.press("ArrowRight")
    assert float(scrub.input_value()) == 3.5 + sample
    assert cursor.get_attribute("style") != before
    for _ in range(2):
        alone.keyboard.press("ArrowLeft")
    assert float(scrub.input_value()) == 3.5 - sample
    for key, speed in (("ArrowUp", 8), ("ArrowDown", 4)):
        alone.keyboard.press(key)
        assert alone.input_value("#speed") == str(speed)
    for is_shown in (False, True):
        alone.keyboard.press("1")
        assert is_drawn(alone) == alone.is_checked("#shown-0") == is_shown
    # Keys that an element needs are left to it.
    alone.focus("#parameter-damping")
    alone.keyboard.press("=")
    alone.keyboard.press("1")
    assert alone.input_value("#steps") == "16"
    alone.focus("#more")
    alone.keyboard.press("Space")
    assert alone.input_value("#steps") == "32"
    # Help takes them all.
    alone.keyboard.press("?")
    assert "Space" in alone.inner_text("#help")
    alone.keyboard.press("=")
    assert alone.input_value("#steps") == "32"
    alone.keyboard.press("Escape")
    assert not alone.is_visible("#help")
    alone.keyboard.press("r")
    expect(shown).to_have_text(re.compile(r"frame (0\.[2-9]|1\.)"))


def test_each_press_halves_the_step_and_adds_points_that_say_what_they_are(alone, address):
    lab.opened(alone, address, **lab.STILL)
    points, plot = alone.locator(lab.POINTS), alone.locator(lab.STEPS)
    for pressed in range(3):
        assert alone.input_value("#steps") == str(16 * 2**pressed)
        expect(points).to_have_count(3 + 3 * pressed)
        alone.keyboard.press("=" if pressed < 2 else "-")
    assert lab.scene_of(alone.url)["ladder"] == [16, 32, 64]
    expect(points).to_have_count(9)
    assert "explicit-euler, 32 steps/frame" in lab.picture(alone)
    # Points that are left out say why.
    of_euler = [each for each in lab.labels(alone) if each.startswith("explicit-euler")]
    assert [each.partition("; ")[2] for each in of_euler] == 3 * ["left out: unstable"]
    # Two that converge have their slopes, and theory's lines are dashed.
    slopes = plot.locator(".plot-text").all_text_contents()
    assert [float(each) for each in slopes] == pytest.approx([1, 4], abs=0.2)
    expect(plot.locator(".plot-line[stroke-dasharray='7 4']")).to_have_count(3)
    # The keyboard reaches all points with one stop of Tab, and tells what each is.
    stops = plot.locator(f"{lab.POINTS}[tabindex='0']")
    stops.focus()
    alone.keyboard.press("End")
    readout = plot.locator(".plot-readout").inner_text()
    assert "rk4, 64 steps per frame, dt = 0.0156 frames" in readout
    assert alone.evaluate("document.activeElement.getAttribute('aria-label')") in readout
    expect(stops).to_have_count(1)
    # Their numbers stand in a table: rk4 evaluates four times as often.
    plot.locator("summary").press("Enter")
    expect(plot.locator("tbody tr")).to_have_count(9)
    rows = [row.split("\t") for row in plot.locator("tbody tr").all_inner_texts()]
    assert [row[1] for row in rows] == 3 * ["16", "32", "64"]
    assert int(rows[6][4]) == 4 * int(rows[3][4])
    plot.locator("select").select_option("seconds")
    expect(plot.locator(".plot-label").last).to_have_text("time to compute [s]")


def test_error_and_energy_are_drawn_with_their_values_and_what_is_not_known(
    alone, address, tmp_path
):
    lab.opened(alone, address, **lab.STILL)
    group = alone.locator(".tab-group").first
    lines, band = group.locator(".plot-line"), group.locator(".plot-band")
    expect(lines).to_have_count(3)
    expect(band).to_have_count(1)
    assert "10 × the reference's estimated bound" in group.inner_text()
    # The values are those of the time that is shown, or of the pointer's, as the table has them.
    value, area = group.locator(".plot-value").nth(1), group.locator(".plot-picture").bounding_box()
    before = value.inner_text()
    alone.mouse.move(area["x"] + 0.9 * area["width"], area["y"] + 0.5 * area["height"])
    expect(value).not_to_have_text(before)
    alone.locator("#scrub").fill("21")
    assert alone.inner_text("#time-shown") == "frame 21.0 of 40"
    group.locator(".plot-values summary").click()
    row = group.locator(".plot-table tbody tr").nth(21).locator("td")
    expect(row.first).to_have_text("21.0")
    expect(value).to_have_text(row.nth(3).inner_text())
    # They are files too.
    for kind in ("SVG", "PNG"):
        with alone.expect_download() as found:
            alone.get_by_role("button", name=f"Download {kind}").first.click()
        assert found.value.suggested_filename == f"error-against-time.{kind.lower()}"
        found.value.save_as(tmp_path / kind)
    text = (tmp_path / "SVG").read_text()
    assert len(ET.fromstring(text).findall(".//{http://www.w3.org/2000/svg}path")) >= 4
    assert "var(" not in text
    assert (tmp_path / "PNG").read_bytes().startswith(b"\x89PNG")
    lab.tab(alone, "energy")
    expect(group.locator("h2")).to_have_text("Energy minus the reference's")
    expect(lines).to_have_count(3)
    expect(band).to_have_count(1)


def test_euler_flies_apart_and_a_link_shows_all_that_was_chosen(alone, address):
    lab.opened(alone, address, playing=False, time=0)
    before = lab.picture(alone)
    # The reference is broad and grey, explicit Euler is blue, and the node that is fixed a square
    # beside those of the ground and of the clip.
    assert 'stroke="#8a939c" stroke-width="7"' in before
    assert 'stroke="#0072B2" stroke-width="2.2"' in before
    assert before.count("<rect") == 3
    # Where Euler's nodes leave, each of them is marked.
    cross = 'stroke="#0072B2" stroke-width="2"'
    assert cross not in before
    alone.locator("#scrub").fill("3.75")
    assert cross in lab.picture(alone)
    alone.locator("#scrub").fill("30")
    notes = "explicit-euler: 15 of 15 nodes have left the view, the first at frame 3"
    assert notes in alone.inner_text("#notes")
    # A node by a click, and by the keyboard.
    alone.locator("#scrub").fill("0")
    circles = re.findall(r'<circle cx="([\d.]+)" cy="([\d.]+)"', before)
    x, y = map(float, circles[5])
    alone.click("#canvas", position={"x": x, "y": y})
    node = int(alone.input_value("#node"))
    assert node in (5, 6)
    alone.focus("#node")
    alone.keyboard.press("ArrowDown")
    assert alone.input_value("#node") == str(node + 1)
    alone.select_option("#magnified", "1000")
    assert "1000 times the error" in alone.inner_text("#notes")
    assert lab.picture(alone).count("<clipPath") == 1
    alone.select_option("#layout", "beside")
    shown = lab.picture(alone)
    assert shown.count("<clipPath") == 3
    assert "errors drawn × 1000" in shown
    # Its link shows it again.
    alone.keyboard.press("=")
    alone.keyboard.press("2")
    link = alone.url
    alone.goto("about:blank")
    alone.goto(link)
    expect(alone.locator("#time-shown")).to_have_text(re.compile("frame 0.0"))
    assert alone.url == link
    chosen = {"steps": 32, "layout": "beside", "magnified": 1000, "node": node + 1}
    assert chosen.items() <= lab.scene_of(link).items()
    assert [alone.input_value(f"#{each}") for each in chosen] == [*map(str, chosen.values())]
    assert not alone.is_checked("#shown-1")


@pytest.mark.slow
def test_lessons_in_both_languages_and_what_needs_python(alone, address):
    alone.goto(f"{address}?scene=verlet-start")
    expect(alone.locator("#time-shown")).to_be_attached()
    assert alone.input_value("#scene") == "verlet-start"
    assert "stormer-verlet:start=rest" in lab.scene_of(alone.url)["steppers"]
    alone.select_option("#scene", "first-order-plot")
    assert lab.scene_of(alone.url)["steppers"] == ["semi-implicit-euler", "stormer-verlet", "rk4"]
    groups = alone.locator("#scene optgroup")
    assert groups.evaluate_all("all => all.map((each) => each.children.length)") == [8, 41]
    # What is shown is certified.
    alone.click("#certificate summary")
    expect(alone.locator("#certificate li").first).to_contain_text("Estimated error bound")
    alone.click("#take")
    alone.click("#save-gif")
    assert "pip install" in alone.inner_text("#take-along")
    with alone.expect_download() as download:
        alone.click("#save-png")
    assert download.value.path().read_bytes().startswith(b"\x89PNG")
    alone.keyboard.press("Escape")
    alone.fill("#parameter-damping", "0.5")
    alone.keyboard.press("Enter")
    expect(alone.locator("#connection")).to_contain_text("pip install")
    alone.select_option("#language", "zh")
    expect(alone.locator("html")).to_have_attribute("lang", "zh")
    assert "每帧步数" in alone.inner_text("#transport")
    # Three sentences, and a page of the documentation.
    sentences = alone.locator("#scenes p").all_inner_texts()
    assert [each[-1] for each in sentences] == 4 * ["。"]


def test_nothing_hinders_a_reader(alone, address, axe):
    lab.opened(alone, address, **lab.STILL, node=3)
    alone.evaluate(
        "document.querySelectorAll('#controls details').forEach((each) => (each.open = true))"
    )
    alone.evaluate(axe)
    for width, language, scheme in ((1280, "en", "light"), (360, "zh", "dark")):
        alone.set_viewport_size({"width": width, "height": 740})
        alone.emulate_media(color_scheme=scheme)
        alone.select_option("#language", language)
        expect(alone.locator("html")).to_have_attribute("lang", language)
        for name in ("energy", "phase", "stability", "error", "order"):
            lab.tab(alone, name)
            assert alone.evaluate("document.documentElement.scrollWidth") <= width, name
            if scheme == "light":
                assert alone.evaluate(VIOLATIONS, "#plots") == [], name
        assert alone.evaluate(VIOLATIONS) == []


@pytest.mark.slow
def test_the_keyboard_alone_reaches_every_control(alone, address):
    lab.opened(alone, address, **lab.STILL)
    controls = ":is(header, #controls, #stage) :is(button, input, select, summary)"
    alone.evaluate(
        """window.reached = new Set();
        document.addEventListener("focusin", ({ target }) => window.reached.add(target));"""
    )
    for _ in range(alone.locator(controls).count()):
        alone.keyboard.press("Tab")
    missed = alone.locator(controls).evaluate_all(
        """all => all.filter((each) => each.checkVisibility() && !window.reached.has(each))
          .map((each) => each.outerHTML)"""
    )
    assert missed == []


@pytest.mark.slow
def test_one_file_has_all_that_its_keys_and_plots_ask_for_without_a_network(
    page, recorded_file, tmp_path
):
    file = tmp_path / "lecture.html"
    file.write_text(recorded_file)
    requests = []
    page.on("request", lambda each: requests.append(each.url.partition(":")[0]))
    page.context.set_offline(True)
    page.goto(file.as_uri())
    said, points = page.locator("#connection"), page.locator(lab.POINTS)
    for pressed, key in enumerate([*"--=======", "="]):
        expect(points).to_have_count(3 * (1 + min(pressed, 2) + max(0, pressed - 4)))
        expect(said).to_have_text("")
        page.keyboard.press(key)
    # The last press asks for what is not in the file. That says what it needs, and spoils nothing.
    assert page.input_value("#steps") == "1024"
    expect(said).to_have_text('This needs Python: pip install "ropeode[lab]", then ropeode lab.')
    expect(points).to_have_count(24)
    page.keyboard.press("-")
    expect(said).to_have_text("")
    for name in ("energy", "phase", "error", "stability", "order"):
        lab.tab(page, name)
        expect(said).to_have_text("")
        assert "being computed" not in page.inner_text("#plots")
    expect(page.locator(f"{lab.STEPS} .plot-more").nth(1)).to_contain_text("observed order 1.0")
    page.click("#take")
    page.click("#copy-command")
    assert page.input_value("#take-along textarea").startswith("ropeode table")
    page.reload()
    expect(points).to_have_count(24)
    # What it does not have is said where the reader looks.
    lab.tab(page, "phase")
    page.select_option("#node", "3")
    expect(page.locator(".plot-notes").first).to_contain_text("the phase plane of one node")
    page.select_option("#scene", "chaos")
    expect(page.locator("#notes")).to_contain_text("This file does not have what you chose")
    assert "being computed" not in page.inner_text("#plots")
    assert set(requests) <= {"file", "blob", "data"}
