"""The stage and the controls, by pressing the keys and reading the page. No Python answers here."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from playwright import sync_api

from ropeode.laboratory.messages import Graded, Line, Run
from tests.laboratory.browser.recorded_page import (
    NOT_RECORDED,
    Python,
    library,
    opened,
    picture,
    scene_of,
)

STILL = {"playing": False, "time": 3.5}


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


def test_the_motion_begins_at_once_without_python(alone, address):
    opened(alone, address)
    alone.wait_for_function(
        "parseFloat(document.querySelector('#time-shown').textContent.split(' ')[1]) > 0.3"
    )
    first = alone.evaluate("performance.getEntriesByName('first picture')[0].startTime")
    assert first < 3000
    assert colours(alone)[0]


def test_each_press_halves_the_step_and_adds_a_point_to_the_order_plot(alone, address):
    opened(alone, address, **STILL)
    assert alone.input_value("#steps") == "16"
    points = []
    for _ in range(2):
        points.append(alone.locator(".plot-point").count())
        alone.keyboard.press("=")
    points.append(alone.locator(".plot-point").count())
    assert alone.input_value("#steps") == "64"
    assert points == sorted(set(points))
    assert scene_of(alone.url)["ladder"] == [16, 32, 64]
    assert "dt = 0.0156" in alone.inner_text("#dt")
    alone.keyboard.press("-")
    assert alone.input_value("#steps") == "32"
    assert alone.locator(".plot-point").count() == points[-1]
    assert "explicit-euler, 32 steps/frame" in picture(alone)


def test_keys_play_step_hide_and_restart(alone, address):
    opened(alone, address, **STILL)
    shown = alone.locator("#time-shown")
    sample = float(alone.get_attribute("#scrub", "step"))
    alone.keyboard.press("ArrowRight")
    assert float(alone.input_value("#scrub")) == 3.5 + sample
    for _ in range(2):
        alone.keyboard.press("ArrowLeft")
    assert float(alone.input_value("#scrub")) == 3.5 - sample
    assert re.fullmatch(r"frame 3\.[1-4] of 40", shown.inner_text())
    assert colours(alone)[0]
    alone.keyboard.press("1")
    assert not colours(alone)[0]
    assert not alone.is_checked("#shown-0")
    alone.keyboard.press("1")
    assert colours(alone)[0]
    alone.keyboard.press("r")
    alone.wait_for_function("scrub => Number(document.querySelector('#scrub').value) > 0.2")
    alone.keyboard.press("Space")
    still = shown.inner_text()
    alone.wait_for_timeout(150)
    assert shown.inner_text() == still
    assert scene_of(alone.url)["playing"] is False


def test_keys_that_an_element_needs_are_left_to_it(alone, address):
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


def test_help_names_every_key(alone, address):
    opened(alone, address, **STILL)
    alone.keyboard.press("?")
    text = alone.inner_text("#help")
    for key in ("=", "-", "Space", "←", "→", "1", "5", "r", "?"):
        assert key in text
    alone.keyboard.press("=")
    assert alone.input_value("#steps") == "16"
    alone.keyboard.press("Escape")
    assert not alone.is_visible("#help")


def test_errors_are_magnified_and_the_stage_says_so(alone, address):
    opened(alone, address, **STILL)
    alone.select_option("#magnified", "1000")
    assert "1000 times the error" in alone.inner_text("#notes")
    assert "errors drawn × 1000" in picture(alone)
    assert scene_of(alone.url)["magnified"] == 1000


def test_ropes_stand_side_by_side(alone, address):
    opened(alone, address, **STILL, layout="beside")
    assert picture(alone).count("<clipPath") == 3
    alone.select_option("#layout", "overlay")
    assert picture(alone).count("<clipPath") == 1


def test_the_stage_says_which_nodes_left(alone, address):
    opened(alone, address, playing=False, time=12)
    said = alone.inner_text("#notes")
    assert re.search(
        r"explicit-euler: 15 of 15 nodes have left the view, the first at frame 3", said
    )


def test_a_click_chooses_a_node_and_so_does_the_keyboard(alone, address):
    opened(alone, address, playing=False, time=0)
    circles = re.findall(r'<circle cx="([\d.]+)" cy="([\d.]+)"', picture(alone))
    x, y = map(float, circles[5])
    alone.click("#canvas", position={"x": x, "y": y})
    node = alone.input_value("#node")
    assert int(node) in (5, 6)
    alone.focus("#node")
    alone.keyboard.press("ArrowDown")
    assert int(alone.input_value("#node")) == int(node) + 1
    assert scene_of(alone.url)["node"] == int(node) + 1


def test_the_link_shows_the_same_scene_again(alone, address):
    opened(alone, address, **STILL)
    alone.keyboard.press("=")
    alone.keyboard.press("2")
    alone.select_option("#layout", "beside")
    link_of = alone.url
    alone.goto("about:blank")
    alone.goto(link_of)
    alone.wait_for_function("document.querySelector('#time-shown')?.textContent")
    assert alone.input_value("#steps") == "32"
    assert alone.input_value("#layout") == "beside"
    assert not alone.is_checked("#shown-1")
    assert alone.inner_text("#time-shown").startswith("frame 3.5")
    assert alone.url == link_of


def test_lessons_are_chosen_or_named_in_the_address(alone, address):
    alone.goto(f"{address}?scene=verlet-start")
    alone.wait_for_function("document.querySelector('#time-shown')?.textContent !== undefined")
    assert alone.input_value("#scene") == "verlet-start"
    assert "Verlet needs two positions" in alone.inner_text("#scenes")
    assert "stormer-verlet:start=rest" in scene_of(alone.url)["steppers"]
    alone.select_option("#scene", "first-order-plot")
    assert alone.locator("#scenes p").count() == 4
    assert scene_of(alone.url)["steppers"] == ["semi-implicit-euler", "stormer-verlet", "rk4"]


def test_languages(alone, address):
    opened(alone, address, **STILL)
    alone.select_option("#language", "zh")
    alone.wait_for_function("document.documentElement.lang === 'zh'")
    assert "每帧步数" in alone.inner_text("#transport")
    assert alone.title() == "ropeode 实验室"
    assert scene_of(alone.url)["language"] == "zh"


def test_what_needs_python_says_so(alone, address):
    opened(alone, address, **STILL)
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
    alone.wait_for_function(
        "document.querySelector('#connection').textContent.includes('pip install')"
    )


@pytest.mark.parametrize("size", [(1280, 720), (360, 740)])
@pytest.mark.parametrize("dark", [False, True])
def test_accessibility(alone, address, axe, size, dark):
    alone.set_viewport_size({"width": size[0], "height": size[1]})
    alone.emulate_media(color_scheme="dark" if dark else "light")
    opened(alone, address, **STILL)
    assert alone.evaluate("document.documentElement.scrollWidth") <= size[0]
    opening = "document.querySelectorAll('#controls details').forEach((each) => (each.open = true))"
    alone.evaluate(opening)
    alone.evaluate(axe)
    found = alone.evaluate("axe.run().then(({ violations }) => violations)")
    assert [(each["id"], [n["target"] for n in each["nodes"]][:4]) for each in found] == []


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


# ---- with answers, but none of them computed


def drop(page, *names):
    """Drop files on the page."""
    page.evaluate(
        """(names) => { const files = new DataTransfer();
          for (const name of names) files.items.add(new File(["t,x\\n0,1\\n"], name));
          const drop = new DragEvent("drop", { dataTransfer: files, bubbles: true });
          document.body.dispatchEvent(drop); }""",
        list(names),
    )


def test_a_lost_connection_is_said_and_mended(page, address):
    python = Python(page)
    opened(page, address, **STILL, problem=NOT_RECORDED)
    page.wait_for_function("document.querySelector('#connection').textContent === ''")
    python.sockets[-1].close()
    page.wait_for_function("document.querySelector('#connection').textContent.includes('lost')")
    page.wait_for_function("document.querySelector('#connection').textContent === ''")
    assert len(python.sockets) == 2
    assert python.asked[-1]["kind"] != python.asked[0]["kind"]


def test_a_wrong_value_shows_the_sentence_of_python_beside_it(page, address):
    python = Python(page)
    sentence = "damping: -1 given; allowed: numbers >= 0. Fix: use 0.01."
    python.answers["truth"] = {"kind": "refused", "message": sentence, "line": None}
    opened(page, address, **STILL)
    page.fill("#parameter-damping", "-1")
    page.keyboard.press("Enter")
    page.wait_for_function("document.querySelector('#parameter-damping-fault').textContent")
    assert page.inner_text("#parameter-damping-fault") == sentence
    assert page.get_attribute("#parameter-damping", "aria-invalid") == "true"
    assert colours(page)[1], "the last picture stays"
    page.fill("#parameter-damping", "0.01")
    page.keyboard.press("Enter")
    assert page.inner_text("#parameter-damping-fault") == ""


def test_ones_own_stepper_its_verdict_and_its_faults(page, address):
    python = Python(page)
    own = {"name": "mine", "version": "a1", "fault": None, "line": None}
    python.answers["library"] = library(own=[own])
    lines = [{"status": "pass", "text": "order: 2.0"}, {"status": "right", "text": "converges"}]
    part = {"kind": "check", "stepper": "mine", "made": 20, "checks": 21, "lines": lines[:1]}
    python.answers["check mine"] = part
    opened(page, address, **STILL)
    page.wait_for_function("document.querySelector('#own .report')")
    assert page.input_value("#stepper-0") == "mine"
    assert "order: 2.0" in page.inner_text("#own")
    # No summary of a check before its end.
    assert "20 of 21" in page.inner_text("#own")
    assert "all checks passed" not in page.inner_text("#own")
    python.answers["check mine"] = {**part, "made": 21, "lines": lines}
    assert {"a1"} == {each["version"] for each in python.asked if each.get("stepper") == "mine"}
    python.say(kind="reloaded", own=[{**own, "fault": "SyntaxError: invalid syntax", "line": 7}])
    page.wait_for_function("document.querySelector('#own .fault')")
    assert "Line 7: SyntaxError" in page.inner_text("#own .fault")
    assert "stays" in page.inner_text("#own .fault")
    python.say(kind="reloaded", own=[{**own, "version": "b2"}])
    page.wait_for_function("!document.querySelector('#own .fault')")
    assert any(each.get("version") == "b2" for each in python.asked)
    page.wait_for_function("document.querySelector('#own').innerText.includes('all checks passed')")


def test_dropped_files_are_graded(page, address):
    python = Python(page)
    run = Run(
        stepper="mine.csv", steps_per_frame=None, dt=0.1, every=1, status="diverged", diverged_at=2,
        error_final=None, error_max=None, error_rms=None, resolution=1e-9, round_off=None,
        rhs_evaluations=None, seconds=None,
    )  # fmt: skip
    line = Line(status="wrong", text="mine.csv: order 1")
    arrays = {"0.differences": np.full((5, 16, 2), 30.0), "0.errors": np.full(5, 42.0)}
    python.answers["grade"] = Graded(passed=False, lines=(line,), runs=(run,)), arrays
    opened(page, address, **STILL)
    drop(page, "mine.csv")
    page.wait_for_function("document.querySelector('#files .report')")
    assert "order 1" in page.inner_text("#files")
    (asked,) = {json.dumps(each) for each in python.asked if each["kind"] == "grade"}
    assert json.loads(asked)["files"] == [{"name": "mine.csv", "text": "t,x\n0,1\n"}]
    assert "mine" not in page.url
    # Finite at five samples, and drawn up to there.
    assert "mine.csv diverged" in page.inner_text("#notes")
    last = 4 * float(page.get_attribute("#scrub", "step"))
    assert f"finite up to frame {last:g}" in picture(page)


def test_dropped_files_are_points_of_the_order_plot(page, address):
    python = Python(page)
    errors = (0.08, 0.02, 0.005)
    runs = tuple(
        Run(
            stepper=f"mine-{index}.csv", steps_per_frame=None, dt=0.1 / 2**index, every=4,
            status="ok", diverged_at=None, error_final=error, error_max=error, error_rms=error,
            resolution=1e-9, round_off=None, rhs_evaluations=None, seconds=None,
        )
        for index, error in enumerate(errors)
    )  # fmt: skip
    arrays = {
        f"{index}.{name}": values
        for index in range(3)
        for name, values in (
            ("differences", np.zeros((41, 16, 2))), ("errors", np.full(41, errors[index])),
        )
    }  # fmt: skip
    lines = (Line(status="pass", text="order: 2.000"), Line(status="right", text="Right."))
    python.answers["grade"] = Graded(passed=True, lines=lines, runs=runs), arrays
    opened(page, address, **STILL)
    points = page.locator(".plot-markers > g")
    sync_api.expect(points).to_have_count(3)
    drop(page, *(f"mine-{index}.csv" for index in range(3)))
    sync_api.expect(points).to_have_count(6)
    words = points.evaluate_all("all => all.map((each) => each.getAttribute('aria-label'))")
    assert words[3:] == [
        f"mine-{index}.csv, dt = {dt} frames: {error}; from a file"
        for index, (dt, error) in enumerate(
            [("0.100", "0.0800"), ("0.0500", "0.0200"), ("0.0250", "0.00500")]
        )
    ]
    assert "from a file" in page.inner_text(".tab-group:last-child .plot-meanings")
    page.click("#files button")
    sync_api.expect(points).to_have_count(3)


def test_why_verlet_has_two_switches(page, address):
    python = Python(page)
    opened(page, address, **STILL)
    page.click("#why summary")
    page.select_option("#why-start", "rest")
    assert "order is 1" in page.inner_text("#why-sentence")
    assert scene_of(page.url)["steppers"][-1] == "stormer-verlet:start=rest"
    page.select_option("#why-damping", "per-step")
    assert scene_of(page.url)["steppers"][-1] == "stormer-verlet:start=rest,damping=per-step"
    assert "stands still" in page.inner_text("#why-sentence")
    assert page.input_value("#option-3-damping") == "per-step"
    assert any(each.get("stepper") == "stormer-verlet:start=rest" for each in python.asked)
    assert python.longest <= 64


def test_up_to_five_steppers(page, address):
    Python(page)
    opened(page, address, **STILL)
    for name in ("velocity-verlet", "stormer-verlet"):
        page.select_option("#stepper-add", name)
    assert page.locator("#stepper-add").count() == 0
    assert len(scene_of(page.url)["steppers"]) == 5
    page.click("#remove-0")
    assert page.locator("#stepper-add").count() == 1
    assert page.input_value("#stepper-0") == "semi-implicit-euler"


def test_copy_as_command_and_python(page, address):
    python = Python(page)
    python.answers["command"] = {
        "kind": "command",
        "command": "ropeode table --frames 40",
        "python": "import ropeode",
    }
    opened(page, address, **STILL, problem=NOT_RECORDED)
    page.click("#take")
    page.click("#copy-command")
    page.wait_for_function(
        "document.querySelector('#take-along textarea').value.startsWith('ropeode table')"
    )
    page.click("#copy-python")
    page.wait_for_function(
        "document.querySelector('#take-along textarea').value === 'import ropeode'"
    )
