"""The lab in a cell: the page, its frame, and the kernel that answers what is not recorded."""

from __future__ import annotations

import base64
import json
import queue

import pytest

from ropeode.errors import InputError
from ropeode.laboratory import PAGE, Laboratory, answers_in, page_with
from ropeode.laboratory.messages import Order, Run, Theory
from ropeode.progress import silent
from tests.laboratory.browser.recorded_page import POINTS
from tools.default_recording import FILE

widget = pytest.importorskip("ropeode.laboratory.widget", exc_type=ImportError)

expect = pytest.importorskip("playwright.sync_api").expect

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


class Cell:
    """A cell that shows a lab, and its kernel."""

    def __init__(self, page, shown, monkeypatch, runs=True):
        self.page, self.sent = page, queue.Queue()
        self.heard = []
        monkeypatch.setattr(
            shown, "send", lambda *message, **named: self.sent.put((message, named))
        )

        def hear(text):
            self.heard.append(json.loads(text))
            if runs:
                shown._handle_custom_msg(json.loads(text), [])

        page.expose_function("kernel", hear)
        state = {"page": shown.page, "height": 720}
        source = (PAGE / "widget.js").read_text("utf-8")
        page.set_content(_with(HOST, SOURCE=source, STATE=state))
        self.frame = page.frame_locator("iframe")

    def tell(self):
        """Let the page hear what the kernel has sent."""
        while not self.sent.empty():
            (content,), named = self.sent.get()
            letters = [base64.b64encode(each).decode() for each in named.get("buffers", ())]
            self.page.evaluate("([content, letters]) => told(content, letters)", [content, letters])

    def until(self, done):
        for _ in range(1200):
            self.tell()
            if done():
                return
            self.page.wait_for_timeout(50)
        raise AssertionError("it did not come about")


def _with(text, **values):
    for name, value in values.items():
        text = text.replace(name, json.dumps(value).replace("<", "\\u003c"))
    return text


@pytest.fixture
def shown(monkeypatch):
    """A lab whose page holds two steppers; only the kernel knows of the third."""
    recorded = FILE.read_text()
    theirs = [each for each in json.loads(recorded) if each["ask"].get("stepper") == "rk4"]
    others = [each for each in json.loads(recorded) if each not in theirs]
    known = {
        ask.model_dump_json(): (header, arrays)
        for ask, header, arrays in answers_in(json.dumps(theirs))
    }

    def answer(ask, laboratory, progress):
        if ask.model_dump_json() not in known:
            raise InputError("steps_per_frame: not in this test")
        header, arrays = known[ask.model_dump_json()]
        message = {"run": Run, "order": Order, "theory": Theory}[ask.kind]
        return message.model_validate({n: v for n, v in header.items() if n != "key"}), arrays

    monkeypatch.setattr("ropeode.laboratory.background.answer_to", answer)
    text = page_with("", json.dumps(others), ())
    monkeypatch.setattr(widget, "page_with_answers", lambda *_, **__: text)
    link = {"problem": {"name": "rope"}, "steppers": ["rk4"]}
    return widget.Lab(Laboratory(), link, 720, silent)


def test_the_kernel_answers_what_is_not_in_the_page(page, shown, monkeypatch):
    cell = Cell(page, shown, monkeypatch)
    frame = cell.frame
    cell.until(lambda: frame.locator(POINTS).count() == 3)
    frame.locator("#more").click()
    cell.until(lambda: frame.locator(POINTS).count() == 6)
    cell.until(lambda: not frame.locator("#connection").inner_text())
    # Nothing was asked of the kernel that the page holds.
    asked = [json.loads(each["text"])["want"] for each in cell.heard if "text" in each]
    others = {json.dumps(each["ask"]) for each in json.loads(FILE.read_text())}
    needed = {json.dumps(each["ask"]) for want in asked for each in want} & others
    assert all('"rk4"' in each for each in needed)
    # The page is a part of another, whose address is none of its business.
    frame.locator("#take").click()
    expect(frame.locator("#copy-python")).to_be_visible()
    expect(frame.locator("#copy-link")).to_have_count(0)
    page.evaluate("clear()")
    assert cell.heard[-1]["text"] == '{"want": []}'


def test_without_a_kernel_the_page_plays_what_it_holds(page, shown, monkeypatch):
    page.set_viewport_size({"width": 1000, "height": 760})
    cell = Cell(page, shown, monkeypatch, runs=False)
    frame = cell.frame
    expect(frame.locator("#connection")).to_contain_text("This needs Python")
    frame.locator("#shown-2").click()
    expect(frame.locator("#connection")).to_have_text("")
    for pressed in (0, 1, 2):
        expect(frame.locator(POINTS)).to_have_count(2 + 2 * pressed)
        frame.locator("#more").click()
    verdict = frame.locator(".tab-group:last-child .plot-more").nth(1)
    expect(verdict).to_contain_text("observed order 1.0")
    assert all("text" not in each for each in cell.heard)
    # Plots stay beside the motion in the width of a cell.
    boxes = [frame.locator(each).bounding_box() for each in ("#stage", "#plots", "#controls")]
    stage, plots, controls = boxes
    assert abs(stage["y"] - plots["y"]) < 1
    assert stage["x"] + stage["width"] <= plots["x"] + 1
    assert controls["y"] >= stage["y"] + stage["height"] - 1
