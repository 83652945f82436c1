"""Work under a time limit: what is called meanwhile, and what ends it."""

from __future__ import annotations

import threading
import time

import pytest

from ropeode.checking import check_stepper, within
from ropeode.simulation import on_user_clock
from tests.time_limit import HANGS_AFTER_S


class LeftOff(BaseException):
    pass


def test_whoever_looks_on_is_told_before_and_while_it_runs():
    told = []

    def work():
        before = len(told)
        while len(told) < 3:
            time.sleep(0.001)
        return before

    assert within(HANGS_AFTER_S, "work", work, meanwhile=lambda: told.append(1)) == 1


def test_what_is_left_off_meanwhile_ends_in_the_step():
    ended, begun = threading.Event(), threading.Event()

    def step():
        begun.set()
        try:
            while True:
                pass
        finally:
            ended.set()

    def meanwhile():
        if begun.is_set():
            raise LeftOff

    with pytest.raises(LeftOff):
        within(HANGS_AFTER_S, "work", lambda: on_user_clock(step), meanwhile=meanwhile)
    assert ended.wait(HANGS_AFTER_S)


def test_a_check_that_is_left_off_ends_within_a_step_that_does_not():
    begun = threading.Event()

    def hangs(rhs, t, y, dt, args):
        begun.set()
        while True:
            pass

    def progress(*_):
        if begun.is_set():
            raise LeftOff

    with pytest.raises(LeftOff):
        check_stepper(hangs, only=["purity"], time_limit=HANGS_AFTER_S, progress=progress)
