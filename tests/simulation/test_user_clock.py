"""The user's clock: what it counts, and what an interruption reaches."""

from __future__ import annotations

import contextlib
import threading
import time

import pytest

from ropeode.simulation import (
    TimeIsUp,
    UserClock,
    on_user_clock,
    one_at_a_time,
    take_turn_from,
)

# How long something is computed, in seconds of processor time; and a wait for what must come.
SPAN, PATIENCE = 0.05, 60.0


def compute(seconds=SPAN):
    until = time.thread_time() + seconds
    while time.thread_time() < until:
        pass


def in_a_thread(work):
    """What `work` returns or raises, in a thread of its own, so that no clock is left behind."""
    outcome = []

    def run():
        try:
            outcome.append(work())
        except TimeIsUp as error:
            outcome.append(error)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    thread.join(PATIENCE)
    return outcome[0]


def test_only_the_users_code_counts():
    def work():
        clock = UserClock()
        compute(4 * SPAN)
        on_user_clock(compute)
        # What the user's code calls is not counted twice.
        on_user_clock(on_user_clock, compute)
        compute(4 * SPAN)
        return clock.spent()

    spent = in_a_thread(work)
    assert 2 * SPAN <= spent.processor < 4 * SPAN
    assert spent.wall >= spent.processor / 2


def test_waiting_is_wall_time_only():
    def work():
        clock = UserClock()
        on_user_clock(time.sleep, SPAN)
        return clock.spent()

    spent = in_a_thread(work)
    assert spent.wall >= SPAN / 2
    assert spent.processor < SPAN / 2


def test_it_is_read_while_it_runs():
    clocks, seen = [], threading.Event()

    def work():
        clocks.append(UserClock())
        on_user_clock(seen.wait, PATIENCE)

    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    until = time.monotonic() + PATIENCE
    while (not clocks or clocks[0].spent().wall < SPAN) and time.monotonic() < until:
        time.sleep(SPAN / 10)
    seen.set()
    thread.join(PATIENCE)
    assert clocks[0].spent().wall >= SPAN


def test_an_interruption_reaches_the_users_code_alone():
    """It comes while something else runs, which ends as it should."""
    reached = []

    def work():
        clock = UserClock()
        clock.interrupt()
        compute()
        reached.append("the end of what is not the user's")
        on_user_clock(reached.append, "the user's code")

    assert isinstance(in_a_thread(work), TimeIsUp)
    assert reached == ["the end of what is not the user's"]


@pytest.mark.parametrize("returns", ["a value", None])
def test_code_that_catches_the_interruption_is_ended_behind_it(returns):
    clocks, ready, reached = [], threading.Event(), []

    def catches_all():
        ready.set()
        try:
            while True:
                pass
        except BaseException:
            return returns

    def work():
        clocks.append(UserClock())
        on_user_clock(catches_all)
        reached.append("what comes behind it")

    def run():
        with pytest.raises(TimeIsUp):
            work()

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    assert ready.wait(PATIENCE)
    clocks[0].interrupt()
    thread.join(PATIENCE)
    assert not thread.is_alive()
    assert not reached


@contextlib.contextmanager
def someone_waits_behind_a_hang():
    """The thread that has the turn, what ends it, and one that waits, with what it got."""
    has, may_end, got = threading.Event(), threading.Event(), []

    def hangs():
        with one_at_a_time():
            has.set()
            may_end.wait(PATIENCE)

    def waits():
        with one_at_a_time():
            got.append(True)

    hanging = threading.Thread(target=hangs, daemon=True)
    waiting = threading.Thread(target=waits, daemon=True)
    hanging.start()
    assert has.wait(PATIENCE)
    waiting.start()
    yield hanging, may_end, waiting, got
    may_end.set()
    hanging.join(PATIENCE)
    waiting.join(PATIENCE)
    assert got


def test_a_turn_that_is_never_given_back_is_taken():
    with someone_waits_behind_a_hang() as (hanging, _, waiting, got):
        take_turn_from(threading.get_ident())
        waiting.join(0.3)
        assert not got, "it was taken from a thread that had it not"
        take_turn_from(hanging.ident or 0)
        waiting.join(PATIENCE)
        assert got


def test_whoever_waited_for_a_turn_that_was_taken_waits_for_the_next():
    with someone_waits_behind_a_hang() as (hanging, may_end, waiting, got):
        take_turn_from(hanging.ident or 0)
        with one_at_a_time(), one_at_a_time():
            may_end.set()
            waiting.join(0.3)
            assert not got
