"""What the page asks of Python and makes of the answers, few of which are computed."""

from __future__ import annotations

import base64
import json
import queue
import re

import numpy as np
import pytest

from ropeode.laboratory import PAGE, Laboratory, answers_in, page_with
from ropeode.laboratory.messages import FilmFile, Graded, Line, Order, Refused, Run, Theory
from ropeode.progress import silent
from tests.laboratory.browser.recorded_page import (
    EXAMPLE,
    NOT_RECORDED,
    POINTS,
    RECORDING,
    STEPS,
    STILL,
    Python,
    labels,
    library,
    link,
    opened,
    picture,
    scene_of,
    tab,
)

widget = pytest.importorskip("ropeode.laboratory.widget", exc_type=ImportError)
expect = pytest.importorskip("playwright.sync_api").expect


def test_parameters_are_asked_for_as_they_are_set_and_a_wrong_one_shows_python_in_english(
    page, address
):
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
    found = page.locator("[lang=en]").all_text_contents()
    assert {"rope, 16 nodes, damping 0.01, 40 frames", sentence} <= {*found}
    assert any("step sizes can be used" in each for each in found)
    assert not any(re.search(r"[\u4e00-\u9fff]", each) for each in found)
    assert "未定" in page.inner_text(f"{STEPS} .plot-legend")
    # Planes of other nodes than the free end, and of modes.
    tab(page, "phase")
    page.select_option("#node", "1")
    python.until_asked(kind="phase", node=1)
    page.locator(".tab-group").first.locator("select").select_option("mode 0")
    python.until_asked(kind="phase", mode=0)
    del python.answers["truth"]
    values = {"num_nodes": 12, "node_mass": 2, "stiffness": 50, "damping": 0.02}
    for name, value in (*values.items(), ("frames", 30)):
        page.fill(f"#parameter-{name}", str(value))
        page.keyboard.press("Enter")
    expect(fault).to_have_text("")
    problem = {"name": "rope", "parameters": values, "frames": 30}
    assert scene_of(page.url)["problem"] == problem
    python.until_asked(kind="truth", problem=problem)


def test_five_steppers_with_options_and_why_verlet_has_two_and_euler_a_region(page, address):
    python = Python(page)
    opened(page, address, **STILL, steppers=["rk4", "explicit-euler"])
    page.click("#why summary")
    page.select_option("#why-start", "rest")
    assert "order is 1" in page.inner_text("#why-sentence")
    python.until_asked(kind="run", stepper="stormer-verlet:start=rest")
    page.select_option("#why-damping", "per-step")
    assert "stands still" in page.inner_text("#why-sentence")
    assert page.input_value("#option-2-damping") == "per-step"
    page.click("#why details:last-of-type summary")
    page.click("#why-euler")
    stability = page.locator("[role=tab][data-name=stability]")
    expect(stability).to_have_attribute("aria-selected", "true")
    assert scene_of(page.url)["steppers"][0] == "explicit-euler"
    region = page.locator(f"{STEPS} select").first
    expect(region.locator("option:checked")).to_have_text("explicit-euler")
    families = page.locator("#stepper-add optgroup").evaluate_all("all => all.map((x) => x.label)")
    assert families == [
        *("Runge-Kutta", "symplectic", "multistep", "implicit", "graphics", "rigid links"),
        *("diffrax", "SciPy"),
    ]
    for name in ("velocity-verlet", "semi-implicit-euler"):
        page.select_option("#stepper-add", name)
    page.select_option("#option-2-damping", "lagged")
    assert scene_of(page.url)["steppers"][2:] == [
        *("stormer-verlet:start=rest,damping=lagged", "velocity-verlet", "semi-implicit-euler")
    ]
    assert page.locator("#stepper-add").count() == 0
    samples = page.locator(".steppers .sample line").all()
    # Okabe and Ito, Color Universal Design (2008).
    assert [each.get_attribute("stroke") for each in samples] == [
        *("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00")
    ]
    assert len({each.get_attribute("stroke-dasharray") for each in samples}) == 5
    page.click("#remove-0")
    assert page.locator("#stepper-add").count() == 1
    assert python.longest <= 64


def test_ones_own_stepper_its_verdict_and_its_faults(page, address):
    python = Python(page)
    mine = "/home/me/courses/numerical_methods/exercise_3/my_steppers.py:velocity_verlet"
    own = {"name": mine, "version": "a1", "fault": None, "line": None}
    python.answers["library"] = library(own=[own])
    lines = [{"status": "pass", "text": "order: 2.0"}, {"status": "right", "text": "converges"}]
    part = {"kind": "check", "stepper": mine, "made": 20, "checks": 21, "lines": lines[:1]}
    python.answers[f"check {mine}"] = part
    opened(page, address, **STILL)
    shown, fault = page.locator("#own"), page.locator("#own .fault")
    expect(shown).to_contain_text("order: 2.0")
    assert page.input_value("#stepper-0") == mine
    # However long its name is, nothing is wider than its panel.
    width = page.evaluate("document.querySelector('#controls').scrollWidth")
    assert width <= page.evaluate("document.querySelector('#controls').clientWidth")
    # No summary of a check before its end.
    assert "all checks passed" not in shown.inner_text()
    python.answers[f"check {mine}"] = {**part, "made": 21, "lines": lines}
    assert {"a1"} == {each["version"] for each in python.asked if each.get("stepper") == mine}
    python.say(kind="reloaded", own=[{**own, "fault": "SyntaxError: invalid syntax", "line": 7}])
    expect(fault).to_contain_text("Line 7: SyntaxError")
    expect(fault).to_contain_text("stays")
    python.say(kind="reloaded", own=[{**own, "version": "b2"}])
    expect(fault).to_have_count(0)
    python.until_asked(version="b2")
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


def graded(*runs):
    """An answer about files of these names, step sizes and errors; one without has diverged."""
    said, arrays = [], {}
    for index, (name, dt, error) in enumerate(runs):
        end = {"status": "ok"} if error else {"status": "diverged", "diverged_at": 2}
        said.append(Run(stepper=name, dt=dt, every=2, error_max=error, resolution=1e-9, **end))
        samples = 81 if error else 5
        arrays[f"{index}.differences"] = np.full((samples, 16, 2), 30.0)
        arrays[f"{index}.errors"] = np.full(samples, error or 42.0)
    lines = (Line(status="wrong", text="order 1"),)
    return Graded(lines=lines, runs=tuple(said)), arrays


def test_dropped_files_are_graded_drawn_and_points_of_the_order_plot(page, address):
    python = Python(page)
    opened(page, address, **STILL)
    points = page.locator(POINTS)
    python.answers["grade"] = graded(("mine.csv", 0.1, None))
    drop(page, "mine.csv")
    expect(page.locator("#files .report")).to_contain_text("order 1")
    python.until_asked(kind="grade", files=[{"name": "mine.csv", "text": "t,x\n0,1\n"}])
    assert "mine" not in page.url
    # Finite at five samples, and drawn up to there.
    assert "mine.csv diverged" in page.inner_text("#notes")
    last = 8 * float(page.get_attribute("#scrub", "step"))
    assert f"finite up to frame {last:g}" in picture(page)
    page.click("#files button")
    expect(points).to_have_count(3)
    python.answers["grade"] = graded(("a.csv", 0.1, 0.08), ("b.csv", 0.05, 0.02))
    drop(page, "a.csv", "b.csv")
    expect(points).to_have_count(5)
    assert labels(page)[3:] == [
        "a.csv, dt = 0.100 frames: 0.0800; from a file",
        "b.csv, dt = 0.0500 frames: 0.0200; from a file",
    ]


def test_a_lost_connection_is_mended_and_command_code_and_film_are_taken_along(page, address):
    python = Python(page)
    opened(page, address, **STILL, problem=NOT_RECORDED)
    said = page.locator("#connection")
    expect(said).to_have_text("")
    python.answers["command"] = {"kind": "command", "command": "ropeode", "python": "import"}
    python.answers["film"] = FilmFile(gif="R0lGODlh"), {}
    python.sockets[-1].close()
    expect(said).to_contain_text("lost")
    expect(said).to_have_text("")
    assert len(python.sockets) == 2
    assert python.asked[-1]["kind"] != python.asked[0]["kind"]
    page.click("#take")
    text = page.locator("#take-along textarea")
    for button, found in (("#copy-command", "ropeode"), ("#copy-python", "import")):
        page.click(button)
        expect(text).to_have_value(found)
    with page.expect_download() as download:
        page.click("#save-gif")
    assert download.value.suggested_filename == "ropeode.gif"
    assert download.value.path().read_bytes() == b"GIF89a"


def test_a_lab_that_runs_has_the_stepper_of_a_file(page, start_lab):
    page.goto(start_lab(f"{EXAMPLE}:velocity_verlet") + link(**STILL))
    expect(page.locator("#stepper-0")).to_have_value(f"{EXAMPLE}:velocity_verlet")
    expect(page.locator("#own")).to_contain_text("velocity_verlet")


# What anywidget is to a widget's module: a model that is heard, and an element.
HOST = """
<!doctype html><title>cell</title><div id="cell"></div>
<script type="module">
const address = URL.createObjectURL(new Blob([SOURCE], { type: "text/javascript" }));
const { default: widget } = await import(address);
const listeners = new Set();
const model = {
  get: (name) => (STATE)[name],
  send: (content) => window.kernel(JSON.stringify(content)),
  on: (event, heard) => listeners.add(heard),
  off: (event, heard) => listeners.delete(heard),
};
window.told = (content, letters) => {
  const bytes = letters.map((each) => Uint8Array.from(atob(each), (x) => x.charCodeAt(0)));
  for (const heard of listeners) heard(content, bytes.map((each) => new DataView(each.buffer)));
};
window.clear = widget.render({ model, el: document.getElementById("cell") });
</script>
"""


@pytest.fixture
def shown(monkeypatch):
    """A lab whose page holds two steppers; only the kernel knows of the third."""
    theirs = [each for each in RECORDING if each["ask"].get("stepper") == "rk4"]
    others = [each for each in RECORDING if each not in theirs]
    messages = {"run": Run, "order": Order, "theory": Theory}
    known = {}
    for ask, header, arrays in answers_in(json.dumps(theirs)):
        if ask.kind in messages:
            del header["key"]
            known[ask.model_dump_json()] = messages[ask.kind](**header), arrays

    def answer(ask, laboratory, progress):
        return known.get(ask.model_dump_json(), (Refused(message="not in this test"), {}))

    monkeypatch.setattr("ropeode.laboratory.widget.answer_to", answer)
    text = page_with("", json.dumps(others), ())
    monkeypatch.setattr(widget, "page_with_answers", lambda *_, **__: text)
    return widget.Lab(Laboratory(), {"problem": {"name": "rope"}, "steppers": []}, 720, silent)


def test_the_kernel_answers_what_is_not_in_the_page_of_a_cell(page, shown, monkeypatch):
    sent, heard = queue.Queue(), []
    monkeypatch.setattr(shown, "send", lambda *message, **named: sent.put((message, named)))

    def hear(text):
        heard.append(json.loads(text))
        shown._handle_custom_msg(heard[-1], [])

    def until(done):
        """Let the page hear what the kernel has sent."""
        for _ in range(1200):
            while not sent.empty():
                (content,), named = sent.get()
                letters = [base64.b64encode(each).decode() for each in named.get("buffers", ())]
                page.evaluate("([content, letters]) => told(content, letters)", [content, letters])
            if done():
                return
            page.wait_for_timeout(50)
        raise AssertionError("it did not come about")

    text = HOST
    for name, value in (
        ("SOURCE", (PAGE / "widget.js").read_text("utf-8")),
        ("STATE", {"page": shown.page, "height": 720}),
    ):
        text = text.replace(name, json.dumps(value).replace("<", "\\u003c"))
    page.set_viewport_size({"width": 1000, "height": 760})
    page.expose_function("kernel", hear)
    page.set_content(text)
    frame = page.frame_locator("iframe")
    until(lambda: frame.locator(POINTS).count() == 3)
    frame.locator("#more").click()
    until(lambda: frame.locator(POINTS).count() == 6)
    until(lambda: not frame.locator("#connection").inner_text())
    # Nothing was asked of the kernel that the page holds.
    asked = [json.loads(each["text"])["want"] for each in heard if "text" in each]
    recorded = {json.dumps(each["ask"]) for each in RECORDING}
    needed = {json.dumps(each["ask"]) for want in asked for each in want} & recorded
    assert all('"rk4"' in each for each in needed)
    # Plots stay beside the motion in the width of a cell.
    boxes = [frame.locator(each).bounding_box() for each in ("#stage", "#plots", "#controls")]
    stage, plots, controls = boxes
    assert abs(stage["y"] - plots["y"]) < 1
    assert stage["x"] + stage["width"] <= plots["x"] + 1
    assert controls["y"] >= stage["y"] + stage["height"] - 1
    # The page is a part of another, whose address is none of its business.
    frame.locator("#take").click()
    expect(frame.locator("#copy-python")).to_be_visible()
    expect(frame.locator("#copy-link")).to_have_count(0)
    page.evaluate("clear()")
    assert heard[-1]["text"] == '{"want": []}'
