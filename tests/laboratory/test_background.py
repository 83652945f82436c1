"""Questions answered in a thread: in which order, what is left off, and what goes wrong."""

from __future__ import annotations

import json
import queue
import threading

import pytest

from ropeode.errors import InputError
from ropeode.laboratory import Background, Laboratory, decoded
from ropeode.laboratory.messages import Checked

SOON_S = 30.0


class Desk:
    """A background whose answers are the names that are asked for, and what it sends."""

    def __init__(self):
        self.sent = queue.Queue()
        self.background = Background(Laboratory(), lambda *message: self.sent.put(message))
        self.asked = []
        self.waits = threading.Event()

    def answer(self, ask, laboratory, progress):
        self.asked.append(ask.stepper)
        if ask.stepper == "wait":
            self.waits.set()
            while True:
                progress("waiting", 0.5)
        if ask.stepper == "refuse":
            raise InputError("stepper: refused")
        if ask.stepper == "break":
            return 1 / 0
        return Checked(stepper=ask.stepper, made=1, checks=1, lines=()), {}

    def want(self, page, *steppers):
        asks = [{"kind": "check", "stepper": each} for each in steppers]
        entries = [{"key": ask["stepper"], "ask": ask} for ask in asks]
        self.background.want(page, entries)

    def next(self):
        """The page and the header of the next message that is no progress."""
        while True:
            page, message = self.sent.get(timeout=SOON_S)
            header = json.loads(message) if isinstance(message, str) else decoded(message)[0]
            if header["kind"] != "working":
                return page, header


@pytest.fixture
def desk(monkeypatch):
    desk = Desk()
    monkeypatch.setattr("ropeode.laboratory.background.answer_to", desk.answer)
    yield desk
    desk.background.close()


def test_answers_come_in_the_order_of_the_questions_and_pages_take_turns(desk):
    desk.want("one", "wait")
    assert desk.waits.wait(SOON_S)
    desk.want("two", "d", "e")
    desk.want("one", "a", "b", "c")
    got = [desk.next() for _ in range(5)]
    assert [(page, header["key"]) for page, header in got] == [
        *[("two", "d"), ("one", "a"), ("two", "e"), ("one", "b"), ("one", "c")]
    ]
    assert all(header["stepper"] == header["key"] for _, header in got)


def test_what_is_no_longer_the_most_urgent_is_left_off_and_done_again_later(desk):
    desk.want("one", "wait")
    assert desk.waits.wait(SOON_S)
    desk.want("one", "a", "wait")
    assert desk.next()[1]["key"] == "a"
    desk.want("one")
    desk.background.close()
    assert desk.asked[:2] == ["wait", "a"]


def test_a_question_without_an_answer_is_refused_and_the_next_one_answered(desk, capsys):
    desk.background.want("one", [{"key": "x", "ask": {"kind": "nothing"}}, 3])
    for key in ("x", ""):
        page, header = desk.next()
        assert (page, header["key"], header["kind"]) == ("one", key, "refused")
    desk.want("one", "refuse", "break", "a")
    said = {header["key"]: header for _, header in (desk.next() for _ in range(3))}
    assert said["refuse"]["message"] == "stepper: refused"
    assert said["break"]["message"] == (
        "ZeroDivisionError: division by zero: a fault of ropeode; please report it."
    )
    assert said["a"]["kind"] == "check"
    assert "ZeroDivisionError" in capsys.readouterr().err


def test_no_thread_is_left_when_nothing_is_wanted(desk):
    def threads():
        return [each for each in threading.enumerate() if each.name == "ropeode lab"]

    desk.want("one", "a")
    assert desk.next()[1]["key"] == "a"
    desk.background.close()
    assert not threads()
    desk.want("one", "b")
    assert desk.next()[1]["key"] == "b"
    desk.want("two", "wait")
    assert desk.waits.wait(SOON_S)
    assert len(threads()) == 1
    desk.background.close()
    assert not threads()
