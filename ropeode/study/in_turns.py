"""Runs of methods at their efforts: once each, and then in rounds for the clock."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

from ropeode.errors import RopeodeError
from ropeode.problems import Problem
from ropeode.progress import Progress
from ropeode.study.methods import Attempt, LadderMethod, Run
from ropeode.validation import counted

# Shorter runs say little about longer ones.
_TELLING_S = 0.05
# Steps per frame of a run that shows how long a step takes; the next one has as many times more.
_FEW = 16

Errors = dict[str, float | None]


@dataclasses.dataclass
class Timed:
    """What became of a method at one effort.

    Arguments:
        method: that was run.
        run: runs it.
        effort: steps per frame, or a tolerance.
        attempt: its first run, without its states.
        errors: of that, by name.
        seconds: of the rounds; none for a run that was not `ok` each time.
    """

    method: LadderMethod
    run: Run
    effort: float
    attempt: Attempt
    errors: Errors
    seconds: list[float] = dataclasses.field(default_factory=list)


def run_in_turns(
    ready: Sequence[tuple[LadderMethod, Run, Sequence[float]]],
    problem: Problem,
    measure: Callable[[Attempt], tuple[Attempt, Errors]],
    limit: float,
    rounds: int,
    progress: Progress,
) -> list[Timed]:
    """Run each method at each effort.

    The first run of each is measured. Then all that went well run again, one after the other, for
    so many rounds, so that what slows the machine for a while slows them alike. One that goes wrong
    there has no error and no seconds: nothing is known of its next run.

    Arguments:
        ready: methods, compiled, with their efforts from cheap to costly.
        problem: that they solve.
        measure: the errors of a run; may change its status.
        limit: seconds that a run may take; those that are expected to take more are not run.
        rounds: how many.
        progress: called with what is being done and the fraction that is done.
    """
    whole = sum(len(efforts) for _, _, efforts in ready) * (1 + rounds)
    done = 0

    def said(method: LadderMethod, effort: float) -> None:
        nonlocal done
        steps = f"{counted(round(effort), 'step')} per frame"
        unit = f"rtol {effort:g}" if method.adaptive else steps
        progress(f"{method.label}: {unit}", done / whole)
        done += 1

    def measured(attempt: Attempt) -> tuple[Attempt, Errors]:
        attempt, errors = measure(attempt)
        return dataclasses.replace(attempt, states=problem.y0[None]), errors

    found: list[Timed] = []
    for method, run, efforts in ready:
        before: list[Timed] = []
        for effort in efforts:
            said(method, effort)
            attempt = _first_run(method, run, effort, before, problem, limit)
            before.append(Timed(method, run, effort, *measured(attempt)))
        found += before
    for _ in range(rounds):
        for each in found:
            said(each.method, each.effort)
            if each.attempt.status != "ok":
                continue
            again = _tried(each.run, each.effort, float("inf"), problem)
            if again.status == "ok":
                each.seconds.append(again.seconds)
            else:
                why = f"when it ran again, {again.why}"
                each.attempt, each.errors = measured(dataclasses.replace(again, why=why))
                each.seconds.clear()
    return found


def _first_run(
    method: LadderMethod,
    run: Run,
    effort: float,
    before: Sequence[Timed],
    problem: Problem,
    limit: float,
) -> Attempt:
    if method.adaptive:
        expected = _of_tolerances(before)
    else:
        expected = _of_steps(run, effort, before, problem, limit)
    if expected > limit:
        why = f"it would take about {expected:.2g} s"
        return Attempt("time limit", why, problem.y0[None], None, None, None, expected)
    return _tried(run, effort, limit, problem)


def _tried(run: Run, effort: float, limit: float, problem: Problem) -> Attempt:
    """A run, or why it raised."""
    try:
        return run(effort, limit)
    except RopeodeError as error:
        why = str(error).splitlines()[0]
        return Attempt("failed", why, problem.y0[None], None, None, None, 0.0)


def _of_steps(
    run: Run,
    effort: float,
    before: Sequence[Timed],
    problem: Problem,
    limit: float,
) -> float:
    """The seconds that so many steps will take, from fewer."""
    ran = [each for each in before if each.attempt.steps]
    few, last = (ran[-1].effort, ran[-1].attempt) if ran else (_FEW, None)
    while True:
        if last is None:
            last = _tried(run, min(few, effort), limit, problem)
        if last.status == "failed" and few < effort:
            # It raised, and another number of steps may be all right.
            few, last = few * _FEW, None
            continue
        # One that diverged did not make all of its steps.
        expected = last.seconds * effort * problem.frames / max(1, last.steps or 1)
        # A short run takes longer for its steps than a long one: it may only seem too much.
        if expected <= limit or last.seconds >= _TELLING_S or few * _FEW >= effort:
            return expected
        few, last = few * _FEW, None


def _of_tolerances(before: Sequence[Timed]) -> float:
    """The seconds of the next tolerance: as much more as the last one took more."""
    ran = [each.attempt.seconds for each in before if each.attempt.status != "failed"]
    if not ran:
        return 0.0
    grew = ran[-1] / ran[-2] if len(ran) > 1 and ran[-2] else 1.0
    return ran[-1] * max(1.0, grew if ran[-1] >= _TELLING_S else 1.0)
