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
        self.waits = threading.Semaphore(0)

    def answer(self, ask, laboratory, progress):
        if ask.stepper == "wait":
            self.waits.release()
            while True:
                progress("waiting", 0.5)
        if ask.stepper == "refuse":
            raise InputError("stepper: refused")
        if ask.stepper == "break":
            return 1 / 0
        return Checked(stepper=ask.stepper, made=1, checks=1, lines=()), {}

    def want(self, page, *steppers):
        asks = [{"kind": "check", "stepper": each} for each in steppers]
        self.background.want(page, [{"key": ask["stepper"], "ask": ask} for ask in asks])

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
    monkeypatch.setattr("ropeode.laboratory.widget.answer_to", desk.answer)
    yield desk
    desk.background.close()


def test_the_most_urgent_comes_first_and_what_runs_gives_way_and_is_done_again(desk):
    desk.want("one", "wait")
    assert desk.waits.acquire(timeout=SOON_S)
    desk.want("two", "d", "e")
    desk.want("one", "a", "b", "wait")
    got = [desk.next() for _ in range(4)]
    # Pages take turns.
    assert [(page, header["stepper"]) for page, header in got] == [
        *[("two", "d"), ("one", "a"), ("two", "e"), ("one", "b")]
    ]
    assert desk.waits.acquire(timeout=SOON_S)


def test_a_question_without_an_answer_is_refused_and_the_next_one_answered(desk, capsys):
    desk.background.want("one", [{"key": "x", "ask": {"kind": "nothing"}}, 3])
    for key in ("x", ""):
        page, header = desk.next()
        assert (page, header["key"], header["kind"]) == ("one", key, "refused")
    desk.want("one", "refuse", "break", "a")
    refused, broken, answered = (desk.next()[1] for _ in range(3))
    assert refused["message"] == "stepper: refused"
    assert broken["message"].startswith("ZeroDivisionError: division by zero: a fault of ropeode")
    assert "ZeroDivisionError" in capsys.readouterr().err
    assert answered["kind"] == "check"


def test_no_thread_is_left_when_nothing_is_wanted(desk):
    for page in ("one", "two"):
        desk.want(page, "wait")
        assert desk.waits.acquire(timeout=SOON_S)
        desk.background.close()
        assert "ropeode lab" not in {each.name for each in threading.enumerate()}
