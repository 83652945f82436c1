"""Tasks and their rows, when processes die: every case has one row, and the right one."""

from __future__ import annotations

from collections import Counter
from concurrent.futures import Future

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ropeode.errors import InputError, RopeodeError
from ropeode.sweep import TookTooLong, dispatched
from tests.sweep.stand_in import Sweep, row


class Gone(Exception):
    """What this engine's futures raise when a process has died."""


class Scripted:
    """An engine of one process per slot, in which what is under way together dies together.

    Arguments:
        slots: tasks under way.
        does: of cases, what they do: "die", with all that is under way with them, "raise" or
            "take too long".
        accidents: which submissions die for no reason of theirs.
        order: where in the list of those under way the next one to be done stands.
        most: rows that are handed back at a time.
    """

    lost = (Gone,)

    def __init__(self, slots=1, does=None, accidents=(), order=(0,), most=99):
        self._slots, self.does, self.accidents = slots, does or {}, accidents
        self.order, self.rows_at_once, self.tried = order, most, Counter()
        self.submitted, self.most, self.waiting = 0, 0, []

    def slots(self):
        self._advance()
        return self._slots

    def submit(self, task):
        future = Future()
        self.submitted += 1
        self.waiting.append((future, task, self.submitted in self.accidents))
        self.most = max(self.most, len(self.waiting))
        if len(self.waiting) >= self._slots:
            self._advance()
        return future

    def check(self):
        self._advance()

    def _advance(self):
        """Finish the next one, or all, if one of them kills."""
        if not self.waiting:
            return
        at = self.order[self.submitted % len(self.order)] % len(self.waiting)
        future, task, accident = self.waiting.pop(at)
        does = {self.does.get(case.number) for case in task.cases}
        if "die" in does or accident:
            for each in [future, *(other[0] for other in self.waiting)]:
                each.set_exception(Gone())
            self.waiting.clear()
        elif "take too long" in does:
            self.tried.update(case.number for case in task.cases if len(task.cases) == 1)
            future.set_exception(TookTooLong(2.5))
        elif "raise" in does:
            future.set_exception(ArithmeticError("nonsense"))
        else:
            future.set_result([row(case) for case in task.cases[: self.rows_at_once]])


def rows_of(sweep, engine):
    by_number = {}
    for task, rows in dispatched(sweep.tasks(), engine, check_every=0.001):
        for case, each in zip(task.cases, rows, strict=True):
            assert case.number not in by_number
            assert case.number // sweep.per_task == task.number
            by_number[case.number] = each
    return by_number


# What becomes of a case that does this, and a word of the reason.
BECOMES = {
    "die": ("worker-died", "died each time"),
    "raise": ("failed", "ArithmeticError: nonsense"),
    "take too long": ("timed-out", "longer than 2.5 s"),
}


@given(
    slots=st.integers(1, 5),
    does=st.dictionaries(st.integers(0, 39), st.sampled_from([*BECOMES]), max_size=9),
    accidents=st.sets(st.integers(1, 40), max_size=3),
    order=st.lists(st.integers(0, 4), min_size=1, max_size=5),
    most=st.integers(1, 9),
)
@settings(deadline=None, max_examples=60)
def test_every_case_has_one_row_and_only_the_culprits_a_bad_one(
    slots, does, accidents, order, most
):
    """Accidents that strike one case three times in a row would be no accidents."""
    accidents = accidents - {a for a in accidents if {a + 1, a + 2} & accidents}
    engine = Scripted(slots, does, accidents, order, most)
    rows = rows_of(Sweep(count=40, per_task=8), engine)
    assert set(rows) == set(range(40))
    for number, found in rows.items():
        status, reason = BECOMES.get(does.get(number), ("ok", ""))
        assert found["status"] == status
        assert reason in (found["reason"] or "")
        if status == "timed-out":
            assert (found["seconds"], engine.tried[number]) == (2.5, 2)
    assert engine.most <= slots


@pytest.mark.parametrize("does", ["nothing", "die"])
def test_no_more_tasks_are_made_than_there_is_room_for(does):
    """A hundred million tasks do not fit into memory, not even if all of them kill processes."""
    taken = []

    def tasks():
        for task in Sweep(count=80, per_task=1).tasks():
            taken.append(task.number)
            yield task

    engine = Scripted(3, dict.fromkeys(range(80), does))
    for done, _ in enumerate(dispatched(tasks(), engine, check_every=0.001)):
        assert len(taken) <= done + 1 + 3


def cancelled(future):
    """As where the connection is lost."""
    future.cancel()
    future.set_running_or_notify_cancel()


@pytest.mark.parametrize(
    "ends",
    [
        lambda future: future.set_exception(OSError(28, "No space left on device")),
        lambda future: future.set_exception(InputError("out: full.")),
        cancelled,
    ],
)
def test_what_would_happen_to_every_case_ends_the_sweep(ends):
    class Ending(Scripted):
        def submit(self, task):
            ends(future := Future())
            return future

    with pytest.raises(RopeodeError, match="finished cases are kept"):
        rows_of(Sweep(count=4), Ending())
