"""What the page asks of Python and makes of the answers, none of which is computed."""

from __future__ import annotations

import re

import numpy as np
import pytest

from ropeode.laboratory.messages import FilmFile, Graded, Line, Run
from tests.laboratory.browser.recorded_page import (
    NOT_RECORDED,
    POINTS,
    STEPS,
    STILL,
    Python,
    labels,
    library,
    opened,
    picture,
    scene_of,
)

expect = pytest.importorskip("playwright.sync_api").expect


def test_a_lost_connection_is_said_and_mended(page, address):
    python = Python(page)
    opened(page, address, **STILL, problem=NOT_RECORDED)
    said = page.locator("#connection")
    expect(said).to_have_text("")
    python.sockets[-1].close()
    expect(said).to_contain_text("lost")
    expect(said).to_have_text("")
    assert len(python.sockets) == 2
    assert python.asked[-1]["kind"] != python.asked[0]["kind"]


def test_a_wrong_value_shows_the_sentence_of_python_marked_as_english(page, address):
    python = Python(page)
    sentence = "damping: -1 given; allowed: numbers >= 0. Fix: use 0.01."
    python.answers["truth"] = {"kind": "refused", "message": sentence, "line": None}
    opened(page, address, **STILL, language="zh")
    before = picture(page)
    page.fill("#parameter-damping", "-1")
    page.keyboard.press("Enter")
    fault = page.locator("#parameter-damping-fault")
    expect(fault).to_have_text(sentence)
    assert page.get_attribute("#parameter-damping", "aria-invalid") == "true"
    assert picture(page) == before, "the last picture stays"
    # Every element with a sentence of Python's, and none with a text of the page.
    found = page.evaluate(
        """() => [...document.querySelectorAll("[lang=en]")].map((each) => each.textContent)"""
    )
    assert {"rope, 16 nodes, damping 0.01, 40 frames", sentence} <= {*found}
    assert any(each.startswith("Level ") for each in found)
    assert any("step sizes can be used" in each for each in found)
    assert not any(re.search(r"[\u4e00-\u9fff]", each) for each in found)
    assert "未定" in page.inner_text(f"{STEPS} .plot-legend")
    assert "节点数" in page.inner_text("#problem-controls")
    page.fill("#parameter-damping", "0.01")
    page.keyboard.press("Enter")
    expect(fault).to_have_text("")


def test_every_parameter_is_asked_for_as_it_is_set(page, address):
    python = Python(page)
    opened(page, address, **STILL)
    values = {"num_nodes": 12, "node_mass": 2, "stiffness": 50, "damping": 0.02}
    for name, value in (*values.items(), ("frames", 30)):
        page.fill(f"#parameter-{name}", str(value))
        page.keyboard.press("Enter")
    assert scene_of(page.url)["problem"] == {"name": "rope", "parameters": values, "frames": 30}
    page.wait_for_timeout(100)
    truths = [each["problem"] for each in python.asked if each["kind"] == "truth"]
    assert truths[-1] == scene_of(page.url)["problem"]
    page.select_option("#problem", "kepler")
    page.wait_for_timeout(100)
    assert python.asked[-1]["problem"]["name"] == "kepler"


def test_up_to_five_steppers_by_family_with_their_options(page, address):
    Python(page)
    opened(page, address, **STILL)
    groups = page.locator("#stepper-add optgroup")
    families = groups.evaluate_all("all => all.map(({ label }) => label)")
    own = ["Runge-Kutta", "symplectic", "multistep", "implicit", "graphics", "rigid links"]
    assert families == [*own, "diffrax", "SciPy"]
    for name in ("stormer-verlet", "velocity-verlet"):
        page.select_option("#stepper-add", name)
    page.select_option("#option-3-damping", "lagged")
    assert scene_of(page.url)["steppers"][3:] == [
        "stormer-verlet:damping=lagged",
        "velocity-verlet",
    ]
    assert page.locator("#stepper-add").count() == 0
    lines = page.locator(".steppers .sample line").evaluate_all(
        "all => all.map((each) => [each.getAttribute('stroke'), "
        "each.getAttribute('stroke-dasharray')])"
    )
    # Okabe and Ito, Color Universal Design (2008).
    assert [colour for colour, _ in lines] == [
        *("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00")
    ]
    assert len({dash for _, dash in lines}) == 5
    page.click("#remove-0")
    assert page.locator("#stepper-add").count() == 1
    assert page.input_value("#stepper-0") == "semi-implicit-euler"


def test_why_verlet_has_two_switches_and_euler_a_region_of_stability(page, address):
    python = Python(page)
    opened(page, address, **STILL, steppers=["rk4", "explicit-euler"])
    page.click("#why summary")
    page.select_option("#why-start", "rest")
    assert "order is 1" in page.inner_text("#why-sentence")
    assert scene_of(page.url)["steppers"][-1] == "stormer-verlet:start=rest"
    page.select_option("#why-damping", "per-step")
    assert scene_of(page.url)["steppers"][-1] == "stormer-verlet:start=rest,damping=per-step"
    assert "stands still" in page.inner_text("#why-sentence")
    assert page.input_value("#option-2-damping") == "per-step"
    assert any(each.get("stepper") == "stormer-verlet:start=rest" for each in python.asked)
    assert python.longest <= 64
    page.click("#why details:last-of-type summary")
    page.click("#why-euler")
    stability = page.locator("[role=tab][data-name=stability]")
    expect(stability).to_have_attribute("aria-selected", "true")
    assert scene_of(page.url)["steppers"][0] == "explicit-euler"
    assert "docs/explanation/stability.md" in page.inner_text("#why")
    region = page.locator(f"{STEPS} select").first
    expect(region.locator("option:checked")).to_have_text("explicit-euler")


def test_ones_own_stepper_its_verdict_and_its_faults(page, address):
    python = Python(page)
    own = {"name": "mine", "version": "a1", "fault": None, "line": None}
    python.answers["library"] = library(own=[own])
    lines = [{"status": "pass", "text": "order: 2.0"}, {"status": "right", "text": "converges"}]
    part = {"kind": "check", "stepper": "mine", "made": 20, "checks": 21, "lines": lines[:1]}
    python.answers["check mine"] = part
    opened(page, address, **STILL)
    shown, fault = page.locator("#own"), page.locator("#own .fault")
    expect(shown).to_contain_text("order: 2.0")
    assert page.input_value("#stepper-0") == "mine"
    # No summary of a check before its end.
    assert "20 of 21" in shown.inner_text()
    assert "all checks passed" not in shown.inner_text()
    python.answers["check mine"] = {**part, "made": 21, "lines": lines}
    assert {"a1"} == {each["version"] for each in python.asked if each.get("stepper") == "mine"}
    python.say(kind="reloaded", own=[{**own, "fault": "SyntaxError: invalid syntax", "line": 7}])
    expect(fault).to_contain_text("Line 7: SyntaxError")
    expect(fault).to_contain_text("stays")
    python.say(kind="reloaded", own=[{**own, "version": "b2"}])
    expect(fault).to_have_count(0)
    assert any(each.get("version") == "b2" for each in python.asked)
    expect(shown).to_contain_text("all checks passed")


def drop(page, *names):
    """Drop files on the page."""
    page.evaluate(
        """(names) => { const files = new DataTransfer();
          for (const name of names) files.items.add(new File(["t,x\\n0,1\\n"], name));
          const drop = new DragEvent("drop", { dataTransfer: files, bubbles: true });
          document.body.dispatchEvent(drop); }""",
        list(names),
    )


def given_run(name, dt, error, every):
    """A run of a file, of which steps and costs are not known; without an error it diverged."""
    unknown = ("steps_per_frame", "round_off", "rhs_evaluations", "seconds")
    errors = dict.fromkeys(("error_final", "error_max", "error_rms"), error)
    status = {"status": "ok" if error else "diverged", "diverged_at": None if error else 2}
    known = {"stepper": name, "dt": dt, "every": every, "resolution": 1e-9}
    return Run(**known, **errors, **status, **dict.fromkeys(unknown))


def test_dropped_files_are_graded_drawn_and_points_of_the_order_plot(page, address):
    def answer(status, words, *runs):
        arrays = {}
        for index, run in enumerate(runs):
            samples = 41 if run.status == "ok" else 5
            arrays[f"{index}.differences"] = np.full((samples, 16, 2), 30.0)
            arrays[f"{index}.errors"] = np.full(samples, run.error_max or 42.0)
        graded = Graded(passed=False, lines=(Line(status=status, text=words),), runs=runs)
        python.answers["grade"] = graded, arrays

    python = Python(page)
    opened(page, address, **STILL)
    points, report = page.locator(POINTS), page.locator("#files .report")
    answer("wrong", "mine.csv: order 1", given_run("mine.csv", 0.1, None, every=1))
    drop(page, "mine.csv")
    expect(report).to_contain_text("order 1")
    asked = [each for each in python.asked if each["kind"] == "grade"]
    assert asked[-1]["files"] == [{"name": "mine.csv", "text": "t,x\n0,1\n"}]
    assert "mine" not in page.url
    # Finite at five samples, and drawn up to there.
    assert "mine.csv diverged" in page.inner_text("#notes")
    last = 4 * float(page.get_attribute("#scrub", "step"))
    assert f"finite up to frame {last:g}" in picture(page)
    page.click("#files button")
    expect(points).to_have_count(3)
    names = [f"mine-{index}.csv" for index in range(3)]
    errors = zip(names, (0.1, 0.05, 0.025), (0.08, 0.02, 0.005), strict=True)
    answer("right", "Right.", *(given_run(*each, every=4) for each in errors))
    drop(page, *names)
    expect(points).to_have_count(6)
    assert labels(page)[3:] == [
        "mine-0.csv, dt = 0.100 frames: 0.0800; from a file",
        "mine-1.csv, dt = 0.0500 frames: 0.0200; from a file",
        "mine-2.csv, dt = 0.0250 frames: 0.00500; from a file",
    ]
    assert "from a file" in page.inner_text(f"{STEPS} .plot-meanings")


def test_command_code_and_film_are_taken_along(page, address):
    python = Python(page)
    python.answers["command"] = {
        "kind": "command",
        "command": "ropeode table --frames 40",
        "python": "import ropeode",
    }
    python.answers["film"] = FilmFile(gif="R0lGODlh"), {}
    opened(page, address, **STILL, problem=NOT_RECORDED)
    page.click("#take")
    text = page.locator("#take-along textarea")
    page.click("#copy-command")
    expect(text).to_have_value("ropeode table --frames 40")
    page.click("#copy-python")
    expect(text).to_have_value("import ropeode")
    with page.expect_download() as download:
        page.click("#save-gif")
    assert download.value.suggested_filename == "ropeode.gif"
    assert download.value.path().read_bytes() == b"GIF89a"
