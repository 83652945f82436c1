"""A newcomer's first five minutes: the keys are pressed, and the page is read.

What stands here is in no other test of the page. Those without Python are quick; the others run a
lab as a user does, and are slow.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from ropeode import Rope, simulate
from ropeode.laboratory.messages import FilmFile
from ropeode.progress import silent
from tests.laboratory.browser.conftest import running_lab
from tests.laboratory.browser.recorded_page import Python, opened, picture, scene_of
from tests.laboratory.conftest import csv_of

sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
expect = sync_api.expect

STILL = {"playing": False, "time": 3.5}
# Its reference takes a fraction of the time of the default rope's.
ROPES = (
    '#problem={"name":"rope","parameters":{"num_nodes":4},"frames":3}&playing=false'
    '&steppers=["semi-implicit-euler","rk4"]&steps=32&ladder=[32]'
)
DOCS = Path(__file__).parents[3] / "docs"
POINTS = ".plot-markers > g"
STEPS = ".tab-group:last-child"


def tab(page, name):
    page.locator(f"[role=tab][data-name={name}]").click()


def labels(page):
    return page.locator(POINTS).evaluate_all(
        "all => all.map((each) => each.getAttribute('aria-label'))"
    )


# ---- 0:00


def test_euler_flies_apart_beside_the_grey_reference_and_the_view_follows(alone, address):
    def drawn(time):
        alone.locator("#scrub").fill(str(time))
        svg = picture(alone)
        (length,) = re.findall(r'text-anchor="middle"[^>]*>([\d.]+)</text>', svg)
        bar = re.search(r'd="M([\d.]+),[\d.]+L\1,[\d.]+L([\d.]+)', svg)
        pixels = (float(bar[2]) - float(bar[1])) / float(length)
        return svg, pixels

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


def test_what_is_shown_first_is_certified(alone, address):
    opened(alone, address, **STILL)
    alone.click("#certificate summary")
    lines = alone.locator("#certificate li").all_inner_texts()
    assert re.match(r"Level \w+: .* Estimated error bound at the end: position", lines[0])
    assert any("apart" in each for each in lines[1:])


# ---- 0:30


def test_every_parameter_is_asked_for_as_it_is_set(page, address):
    python = Python(page)
    opened(page, address, **STILL)
    values = {"num_nodes": 12, "node_mass": 2, "stiffness": 50, "damping": 0.02}
    for name, value in values.items():
        page.fill(f"#parameter-{name}", str(value))
        page.keyboard.press("Enter")
    page.fill("#parameter-frames", "30")
    page.keyboard.press("Enter")
    assert scene_of(page.url)["problem"] == {"name": "rope", "parameters": values, "frames": 30}
    page.wait_for_timeout(100)
    truths = [each["problem"] for each in python.asked if each["kind"] == "truth"]
    assert truths[-1] == scene_of(page.url)["problem"]


def test_steppers_stand_by_family_with_their_options(page, address):
    Python(page)
    opened(page, address, **STILL)
    groups = page.locator("#stepper-add optgroup")
    families = groups.evaluate_all("all => all.map(({ label }) => label)")
    own = ["Runge-Kutta", "symplectic", "multistep", "implicit", "graphics", "rigid links"]
    assert families == [*own, "diffrax", "SciPy"]
    page.select_option("#stepper-add", "stormer-verlet")
    page.select_option("#option-3-damping", "lagged")
    assert scene_of(page.url)["steppers"][3] == "stormer-verlet:damping=lagged"


def test_five_steppers_differ_in_colours_and_in_dashes(page, address):
    Python(page)
    steppers = ["rk4", "explicit-euler", "semi-implicit-euler", "velocity-verlet", "stormer-verlet"]
    opened(page, address, **STILL, steppers=steppers)
    lines = page.locator(".steppers .sample line").evaluate_all(
        "all => all.map((each) => [each.getAttribute('stroke'), "
        "each.getAttribute('stroke-dasharray')])"
    )
    # Okabe and Ito, Color Universal Design (2008).
    assert [colour for colour, _ in lines] == [
        "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00",
    ]  # fmt: skip
    assert len({dash for _, dash in lines}) == 5


def test_time_is_played_stepped_scrubbed_and_sped_up(alone, address):
    opened(alone, address, **STILL)
    scrub, shown = alone.locator("#scrub"), alone.locator("#time-shown")
    scrub.fill("20")
    assert shown.inner_text() == "frame 20.0 of 40"
    alone.get_by_role("button", name="One sample forward").click()
    assert float(scrub.input_value()) == 20 + float(scrub.get_attribute("step"))
    # The plots have the values of the time that is shown, as the table has them.
    scrub.fill("30")
    scrub.fill("21")
    alone.wait_for_timeout(300)
    value = alone.locator(".plot-value").nth(1).inner_text()
    alone.locator(".plot-values summary").first.click()
    row = alone.locator(".plot-table").first.locator("tbody tr").nth(21).locator("td")
    expect(row.first).to_have_text("21.0")
    assert value == row.nth(3).inner_text()
    assert alone.input_value("#speed") == "4"
    alone.keyboard.press("ArrowUp")
    assert alone.input_value("#speed") == "8"
    for _ in range(2):
        alone.keyboard.press("ArrowDown")
    assert scene_of(alone.url)["speed"] == 2
    alone.get_by_role("button", name="Play").click()
    expect(shown).not_to_have_text("frame 21.0 of 40")
    alone.get_by_role("button", name="Pause").click()
    times = alone.locator("#magnified option").evaluate_all("all => all.map(({ value }) => value)")
    assert [float(each) for each in times] == [10.0**k for k in range(7)]


# ---- 1:00


def test_error_and_energy_are_drawn_with_what_is_not_known(alone, address):
    opened(alone, address, **STILL)
    group = alone.locator(".tab-group").first
    lines, band = group.locator(".plot-line"), group.locator(".plot-band")
    expect(lines).to_have_count(3)
    expect(band).to_have_count(1)
    ticks = group.locator(".plot-axes text").all_text_contents()
    assert {"10⁻¹⁰", "time [frames]"} <= set(ticks)
    assert "10 × the reference's estimated bound" in group.inner_text()
    before = [each.get_attribute("d") for each in lines.all()]
    tab(alone, "energy")
    expect(group.locator("h2")).to_have_text("Energy minus the reference's")
    expect(lines).to_have_count(3)
    expect(band).to_have_count(1)
    assert [each.get_attribute("d") for each in lines.all()] != before
    assert "largest difference" in group.locator(".plot-legend").inner_text()


# ---- 2:00


def test_points_that_are_left_out_say_why(alone, address):
    opened(alone, address, **STILL)
    alone.keyboard.press("=")
    alone.keyboard.press("=")
    expect(alone.locator(POINTS)).to_have_count(9)
    of_euler = [each for each in labels(alone) if each.startswith("explicit-euler")]
    assert len(of_euler) == 3
    assert all(each.endswith("; left out: unstable") for each in of_euler)
    meanings = alone.locator(f"{STEPS} .plot-meanings").inner_text()
    assert "left out: diverged, or above this plot" in meanings
    # Two that converge have their slopes, and theory's line is dashed.
    slopes = alone.locator(f"{STEPS} .plot-text").all_text_contents()
    assert [float(each) for each in slopes] == pytest.approx([1, 4], abs=0.2)
    assert "predicted by theory" in meanings
    assert alone.locator(f"{STEPS} .plot-line[stroke-dasharray='7 4']").count() == 3
    assert "predicted error 28.25 dt" in alone.locator(f"{STEPS} .plot-legend").inner_text()


def test_the_axis_of_the_order_plot_is_also_work_and_time(alone, address):
    opened(alone, address, **STILL)
    label = alone.locator(f"{STEPS} .plot-label").last
    for value, words in (
        ("evaluations", "evaluations of the right-hand side"),
        ("seconds", "time to compute [s]"),
    ):
        alone.select_option(f"{STEPS} select", value)
        expect(label).to_have_text(words)
        expect(alone.locator(POINTS)).to_have_count(3)


# ---- 3:00


def test_why_euler_explodes_leads_to_the_region_of_stability(page, address):
    Python(page)
    opened(page, address, **STILL, steppers=["rk4", "explicit-euler"])
    page.click("#why details:last-of-type summary")
    page.click("#why-euler")
    expect(page.locator("[role=tab][data-name=stability]")).to_have_attribute(
        "aria-selected", "true"
    )
    assert scene_of(page.url)["steppers"] == ["explicit-euler", "rk4"]
    assert "docs/explanation/stability.md" in page.inner_text("#why")
    region = page.locator(".tab-group:last-child select").first
    expect(region.locator("option:checked")).to_have_text("explicit-euler")


# ---- 5:00


def test_a_film_is_saved(page, address):
    python = Python(page)
    python.answers["film"] = FilmFile(gif="R0lGODlh"), {}
    opened(page, address, **STILL)
    page.click("#take")
    with page.expect_download() as download:
        page.click("#save-gif")
    assert download.value.suggested_filename == "ropeode.gif"
    assert download.value.path().read_bytes() == b"GIF89a"


def test_every_scene_has_three_sentences_in_both_languages(alone, address):
    opened(alone, address, **STILL)
    found = alone.evaluate(
        """async () => {
          const select = () => document.getElementById("scene");
          const names = [...select().options].map(({ value }) => value).filter(Boolean);
          const turn = () => new Promise((done) => setTimeout(done));
          const scenes = {};
          for (const language of ["en", "zh"]) {
            const choice = document.getElementById("language");
            choice.value = language;
            choice.dispatchEvent(new Event("change"));
            while (document.documentElement.lang !== language) await turn();
            await turn();
            // Figures have their texts from one function.
            for (const name of language === "en" ? names : names.slice(0, 10)) {
              select().value = name;
              select().dispatchEvent(new Event("change"));
              const lines = document.querySelectorAll("#scenes p");
              (scenes[name] ??= []).push([...lines].map((each) => each.textContent));
            }
          }
          return scenes;
        }"""
    )
    assert len(found) == 8 + 41
    groups = alone.locator("#scene optgroup").evaluate_all(
        "all => all.map((each) => each.children.length)"
    )
    assert groups == [8, 41]
    for shown in found.values():
        for lines, stop in zip(shown, (".", "。"), strict=False):
            # The fourth names a page of the documentation.
            assert len(lines) == 4
            assert all(each.endswith(stop) for each in lines)
    assert sum(len(each) for each in found.values()) == 49 + 10


def test_sentences_of_python_are_marked_as_english(page, address):
    python = Python(page)
    python.answers["truth"] = {"kind": "refused", "message": "damping: -1 given.", "line": None}
    opened(page, address, **STILL, language="zh")
    page.fill("#parameter-damping", "-1")
    page.keyboard.press("Enter")
    expect(page.locator("#parameter-damping-fault")).to_have_text("damping: -1 given.")
    # Every element with a sentence of Python's, and none with a text of the page.
    found = page.evaluate(
        """() => [...document.querySelectorAll("[lang=en]")].map((each) => each.textContent)"""
    )
    assert "rope, 16 nodes, damping 0.01, 40 frames" in found
    assert "damping: -1 given." in found
    assert any(each.startswith("Level ") for each in found)
    assert any("step sizes can be used" in each for each in found)
    assert not any(re.search(r"[\u4e00-\u9fff]", each) for each in found)
    assert "未定" in page.locator(f"{STEPS} .plot-legend").inner_text()
    assert "节点数" in page.inner_text("#problem-controls")


# ---- with a lab that computes


@pytest.mark.slow
def test_the_switches_take_verlet_from_order_2_to_1_to_none(page, lab):
    page.goto(lab + ROPES)
    page.click("#why summary")
    page.select_option("#why-damping", "centered")
    verdict = page.locator(f"{STEPS} .plot-legend .plot-more").last
    expect(verdict).to_have_text(re.compile(r"converges: observed order (1\.9|2\.0)"))
    page.select_option("#why-start", "rest")
    expect(verdict).to_have_text(re.compile(r"converges: observed order (0\.9|1\.0)"))
    page.select_option("#why-damping", "per-step")
    expect(verdict).to_have_text(re.compile("does not converge"))
    assert "docs/explanation/verlet.md" in page.inner_text("#why")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "drawn"),
    [
        # What moves, and what is fixed.
        ("inextensible-rope", {"circle": 15, "rect": 1}),
        ("pendulum", {"circle": 1, "rect": 1}),
        ("double-pendulum", {"circle": 2, "rect": 1}),
        ("kepler", {"circle": 1, "rect": 1}),
        ("lorenz", {"circle": 1, "rect": 0}),
    ],
)
def test_problems_are_drawn_as_what_they_are(page, lab, name, drawn):
    page.goto(lab + "#steppers=[]&playing=false")
    page.select_option("#problem", name)
    words = {"inextensible-rope": "inextensible rope", "double-pendulum": "double pendulum"}
    expect(page.locator("#problem-words")).to_contain_text(words.get(name, name), ignore_case=True)
    while page.locator("#remove-0").count():
        page.click("#remove-0")
    svg = picture(page)
    # One rectangle is the ground, and each clip has one.
    found = {"circle": svg.count("<circle"), "rect": svg.count("<rect") - 2}
    assert found == drawn


@pytest.mark.slow
def test_a_stepper_of_ones_own_reloads_on_save(page, needs_chromium, tmp_path):
    file = tmp_path / "steps.py"
    right = (DOCS / "examples/steps.py").read_text()
    file.write_text(right)
    requests = []
    page.on("request", lambda each: requests.append(each.url))
    with running_lab(f"{file}:velocity_verlet") as address:
        page.goto(address + ROPES)
        own, fault = page.locator("#own"), page.locator("#own .fault")
        expect(page.locator("#stepper-0")).to_have_value(re.compile("velocity_verlet"))
        expect(own).to_contain_text("all checks passed")
        file.write_text(right.replace("return x_new,", "return x_new x_new,"))
        expect(fault).to_contain_text("Line 9:")
        expect(fault).to_contain_text("The version before it stays.")
        expect(page.locator(POINTS)).to_have_count(3)
        # It falls too fast: the verdict changes with the file.
        file.write_text(right.replace("dt / 2 * (a", "dt * (a"))
        expect(fault).to_have_count(0)
        expect(own).to_contain_text("a check failed")
        # Not to complain of the lab's end.
        page.goto("about:blank")
    assert all(each.startswith(("http://127.0.0.1:", "ws://127.0.0.1:")) for each in requests)


@pytest.mark.slow
def test_files_of_another_program_are_graded_and_drawn(page, lab, tmp_path):
    problem = Rope(num_nodes=4).problem(frames=3)
    files = []
    for steps in (16, 32, 64):
        run = simulate(problem, "semi-implicit-euler", steps, progress=silent)
        files.append(tmp_path / f"mine-{steps}.csv")
        files[-1].write_text(csv_of(run))
    page.goto(lab + ROPES)
    expect(page.locator(POINTS)).to_have_count(2)
    page.locator("#file-choice").set_input_files(files)
    expect(page.locator("#files .report")).to_contain_text("order 1.0")
    expect(page.locator(POINTS)).to_have_count(5)
    # Of the same error as the page's own run of that stepper.
    own, same = (each.split(": ")[1].split(";")[0] for each in (labels(page)[0], labels(page)[3]))
    assert labels(page)[3].startswith("mine-32.csv, dt = 0.0313 frames")
    assert own == same


@pytest.mark.slow
def test_the_file_of_the_default_scene_has_all_that_its_keys_ask_for(page, tmp_path):
    file = tmp_path / "lecture.html"
    command = [sys.executable, "-m", "ropeode", "lab", "--out", str(file)]
    subprocess.run(command, check=True, capture_output=True)
    assert file.stat().st_size < 5e6
    page.context.set_offline(True)
    page.goto(file.as_uri() + "#playing=false&time=2")
    said, points = page.locator("#connection"), page.locator(POINTS)
    for pressed, key in enumerate(["-", "-", *["="] * 7]):
        page.keyboard.press(key)
        expect(said).to_have_text("")
        expect(points).to_have_count(3 * (2 + min(pressed, 1) + max(0, pressed - 3)))
    for name in ("energy", "phase", "error", "stability", "order"):
        tab(page, name)
        expect(said).to_have_text("")
        assert "being computed" not in page.inner_text("#plots")
    # What it does not have is said in words, where the reader looks.
    tab(page, "phase")
    page.select_option("#node", "3")
    expect(page.locator(".plot-notes").first).to_contain_text("the phase plane of one node")
    page.select_option("#node", "")
    expect(page.locator(".plot-line").nth(3)).to_be_attached()
    page.select_option("#scene", "chaos")
    expect(page.locator("#notes")).to_contain_text("This file does not have what you chose")
    expect(page.locator(".plot-legend").last).to_contain_text("not in this file")
    assert "being computed" not in page.inner_text("#plots")
