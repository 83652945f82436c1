"""The user's clock: what it counts, and what an interruption reaches.

That steps which hang, wait or catch everything end in time, and that only they do, is in
tests/checking/test_bring.py.
"""

from __future__ import annotations

import threading
import time
from concurrent.futures import ThreadPoolExecutor

from ropeode.simulation import TimeIsUp, UserClock, on_user_clock, one_at_a_time, take_turn_from

# How long something is computed, in seconds of processor time; and a wait for what must come.
SPAN, PATIENCE = 0.05, 60.0


def compute(seconds=SPAN):
    until = time.thread_time() + seconds
    while time.thread_time() < until:
        pass


def in_a_thread(work):
    """What becomes of `work` in a thread of its own, so that no clock is left behind."""
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(work)


def test_only_the_users_code_counts():
    """Of processor time; waiting is wall time only."""

    def work():
        clock = UserClock()
        compute(4 * SPAN)
        on_user_clock(compute)
        # What the user's code calls is not counted twice.
        on_user_clock(on_user_clock, compute)
        compute(4 * SPAN)
        computed = clock.spent()
        on_user_clock(time.sleep, SPAN)
        return computed, clock.spent()

    computed, waited = in_a_thread(work).result()
    assert 2 * SPAN <= computed.processor < 4 * SPAN
    assert computed.wall >= computed.processor / 2
    assert waited.wall - computed.wall >= SPAN / 2
    assert waited.processor - computed.processor < SPAN / 2


def test_an_interruption_reaches_the_users_code_alone():
    """It comes while something else runs, which ends as it should."""
    reached = []

    def work():
        clock = UserClock()
        clock.interrupt()
        compute()
        reached.append("the end of what is not the user's")
        on_user_clock(reached.append, "the user's code")

    assert isinstance(in_a_thread(work).exception(), TimeIsUp)
    assert reached == ["the end of what is not the user's"]


def test_whoever_waited_for_a_turn_that_was_taken_waits_for_the_next():
    has, may_end, got = threading.Event(), threading.Event(), threading.Event()
    threads = []

    def hangs():
        threads.append(threading.get_ident())
        with one_at_a_time():
            has.set()
            may_end.wait(PATIENCE)

    def waits():
        with one_at_a_time():
            got.set()

    with ThreadPoolExecutor(2) as pool:
        pool.submit(hangs)
        assert has.wait(PATIENCE)
        pool.submit(waits)
        take_turn_from(threading.get_ident())
        assert not got.wait(0.3), "it was taken from a thread that had it not"
        take_turn_from(threads[0])
        with one_at_a_time(), one_at_a_time():
            may_end.set()
            assert not got.wait(0.3), "two have the turn at once"
    assert got.is_set()
