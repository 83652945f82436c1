"""What the page asks of Python and makes of the answers, few of which are computed."""

from __future__ import annotations

import base64
import json
import queue
import re
from pathlib import Path

import numpy as np
import pytest

from ropeode.laboratory import PAGE, Laboratory, answers_in, page_with
from ropeode.laboratory.messages import FilmFile, Graded, Line, Order, Refused, Run, Theory
from ropeode.progress import silent
from tests.laboratory.browser import recorded_page as lab

widget = pytest.importorskip("ropeode.laboratory.widget", exc_type=ImportError)
expect = pytest.importorskip("playwright.sync_api").expect


@pytest.mark.slow
def test_parameters_are_asked_for_as_they_are_set_and_a_wrong_one_shows_python_in_english(
    page, address
):
    python = lab.Python(page)
    sentence = "damping: -1 given; allowed: numbers >= 0. Fix: use 0.01."
    python.answers["truth"] = {"kind": "refused", "message": sentence, "line": None}
    lab.opened(page, address, **lab.STILL, language="zh")
    before = lab.picture(page)
    page.fill("#parameter-damping", "-1")
    page.keyboard.press("Enter")
    fault = page.locator("#parameter-damping-fault")
    expect(fault).to_have_text(sentence)
    assert page.get_attribute("#parameter-damping", "aria-invalid") == "true"
    assert lab.picture(page) == before, "the last picture stays"
    # What Python says, and no text of the page.
    found = page.locator("[lang=en]").all_text_contents()
    assert {"rope, 16 nodes, damping 0.01, 40 frames", sentence} <= {*found}
    assert not any(re.search(r"[\u4e00-\u9fff]", each) for each in found)
    assert "未定" in page.inner_text(f"{lab.STEPS} .plot-legend")
    # A plane that is not recorded: of another node than the free end.
    lab.tab(page, "phase")
    page.select_option("#node", "1")
    python.until_asked(kind="phase", node=1)
    del python.answers["truth"]
    values = {"num_nodes": 12, "node_mass": 2, "stiffness": 50, "damping": 0.02}
    for name, value in (*values.items(), ("frames", 30)):
        page.fill(f"#parameter-{name}", str(value))
        page.keyboard.press("Enter")
    expect(fault).to_have_text("")
    problem = {"name": "rope", "parameters": values, "frames": 30}
    assert lab.scene_of(page.url)["problem"] == problem
    python.until_asked(kind="truth", problem=problem)


def test_five_steppers_with_options_and_why_verlet_has_two_and_euler_a_region(page, address):
    python = lab.Python(page)
    lab.opened(page, address, **lab.STILL, steppers=["rk4", "explicit-euler"])
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
    assert lab.scene_of(page.url)["steppers"][0] == "explicit-euler"
    region = page.locator(f"{lab.STEPS} select").first
    expect(region.locator("option:checked")).to_have_text("explicit-euler")
    for name in ("velocity-verlet", "semi-implicit-euler"):
        page.select_option("#stepper-add", name)
    page.select_option("#option-2-damping", "lagged")
    assert lab.scene_of(page.url)["steppers"][2:] == [
        *("stormer-verlet:start=rest,damping=lagged", "velocity-verlet", "semi-implicit-euler")
    ]
    assert page.locator("#stepper-add").count() == 0
    # Lines differ also for those who see no colours.
    for look in ("stroke", "stroke-dasharray"):
        samples = page.locator(".steppers .sample line").all()
        assert len({each.get_attribute(look) for each in samples}) == 5
    assert python.longest <= 64


def test_ones_own_stepper_its_verdict_and_its_faults(page, address):
    python = lab.Python(page)
    mine = "/home/me/courses/numerical_methods/exercise_3/my_steppers.py:velocity_verlet"
    own = {"name": mine, "version": "a1", "fault": None, "line": None}
    python.answers["library"] = lab.library(own=[own])
    lines = [{"status": "pass", "text": "order: 2.0"}, {"status": "right", "text": "converges"}]
    part = {"kind": "check", "stepper": mine, "made": 20, "checks": 21, "lines": lines[:1]}
    python.answers[f"check {mine}"] = part
    lab.opened(page, address, **lab.STILL)
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
    python = lab.Python(page)
    lab.opened(page, address, **lab.STILL)
    points, names = page.locator(lab.POINTS), ("a.csv", "b.csv", "c.csv")
    errors = (0.08, 0.02, None)
    python.answers["grade"] = graded(*zip(names, (0.1, 0.05, 0.1), errors, strict=True))
    page.evaluate(
        """(names) => { const files = new DataTransfer();
          for (const name of names) files.items.add(new File(["t,x\\n0,1\\n"], name));
          const drop = new DragEvent("drop", { dataTransfer: files, bubbles: true });
          document.body.dispatchEvent(drop); }""",
        names,
    )
    expect(page.locator("#files .report")).to_contain_text("order 1")
    python.until_asked(kind="grade", files=[{"name": n, "text": "t,x\n0,1\n"} for n in names])
    assert "csv" not in page.url
    expect(points).to_have_count(6)
    assert lab.labels(page)[3:] == [
        "a.csv, dt = 0.100 frames: 0.0800; from a file",
        "b.csv, dt = 0.0500 frames: 0.0200; from a file",
        "c.csv, dt = 0.100 frames: diverged at frame 2; from a file",
    ]
    # Finite at five samples, and drawn up to there.
    assert "c.csv diverged" in page.inner_text("#notes")
    last = 8 * float(page.get_attribute("#scrub", "step"))
    assert f"finite up to frame {last:g}" in lab.picture(page)
    page.click("#files button")
    expect(points).to_have_count(3)


@pytest.mark.slow
def test_a_lost_connection_is_mended_and_command_code_and_film_are_taken_along(page, address):
    python = lab.Python(page)
    lab.opened(page, address, **lab.STILL, problem=lab.NOT_RECORDED)
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


@pytest.mark.slow
def test_a_lab_that_runs_has_the_stepper_of_a_file(page, start_lab):
    page.goto(start_lab(f"{lab.EXAMPLE}:velocity_verlet") + lab.link(**lab.STILL))
    expect(page.locator("#stepper-0")).to_have_value(f"{lab.EXAMPLE}:velocity_verlet")
    expect(page.locator("#own")).to_contain_text("velocity_verlet")


@pytest.fixture
def shown(monkeypatch):
    """A lab whose page holds two steppers; only the kernel knows of the third."""
    theirs = [each for each in lab.RECORDING if each["ask"].get("stepper") == "rk4"]
    others = [each for each in lab.RECORDING if each not in theirs]
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


@pytest.mark.slow
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

    text = (Path(__file__).parent / "cell.html").read_text()
    for name, value in (
        ("SOURCE", (PAGE / "widget.js").read_text("utf-8")),
        ("STATE", {"page": shown.page, "height": 720}),
    ):
        text = text.replace(name, json.dumps(value).replace("<", "\\u003c"))
    page.set_viewport_size({"width": 1000, "height": 760})
    page.expose_function("kernel", hear)
    page.set_content(text)
    frame = page.frame_locator("iframe")
    until(lambda: frame.locator(lab.POINTS).count() == 3)
    frame.locator("#more").click()
    until(lambda: frame.locator(lab.POINTS).count() == 6)
    until(lambda: not frame.locator("#connection").inner_text())
    # Nothing was asked of the kernel that the page holds.
    asked = [json.loads(each["text"])["want"] for each in heard if "text" in each]
    recorded = {json.dumps(each["ask"]) for each in lab.RECORDING}
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
