"""What the page asks, as far as it is known before it does: for recordings, and to be quick.

`page/asks.js` is the other side of it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from ropeode.laboratory.messages import (
    Ask,
    AskCheck,
    AskCommand,
    AskLibrary,
    AskOrder,
    AskPhase,
    AskRun,
    AskStability,
    AskTheory,
    AskTruth,
    ProblemChoice,
    SceneState,
)
from ropeode.laboratory.scenes import lessons
from ropeode.laboratory.setup import Laboratory, first_steppers

# What the page shows first.
DEFAULT_PROBLEM = ProblemChoice(name="rope", frames=40)
DEFAULT_STEPPERS = ("explicit-euler", "semi-implicit-euler", "rk4")
DEFAULT_LADDER = (16,)
# As many steppers as the page shows at once.
MOST_STEPPERS = 5
# How often the keys `-` and `=` can be pressed from where the page begins.
_MINUS, _EQUALS = 2, 5


def shown_first(
    laboratory: Laboratory, link: Mapping[str, Any]
) -> tuple[ProblemChoice, tuple[str, ...]]:
    """The problem that the page shows at first, and the steppers."""
    if "problem" not in link:
        return DEFAULT_PROBLEM, tuple(link.get("steppers", DEFAULT_STEPPERS))
    problem = ProblemChoice.model_validate(link["problem"])
    steppers = link.get("steppers") or first_steppers(laboratory.problem(problem))
    return problem, tuple(steppers)[:MOST_STEPPERS]


def asks_of(
    laboratory: Laboratory,
    problem: ProblemChoice,
    steppers: tuple[str, ...],
    ladder: tuple[int, ...],
    start: int | None = None,
) -> Iterator[Ask]:
    """What the page asks for, whichever of its plots are chosen, as the keys halve and double.

    Arguments:
        laboratory: with the steppers of the user's own, which the page shows beside `steppers`.
        problem: that the page shows.
        steppers: by name.
        ladder: steps per frame in the order plot at first, in increasing order.
        start: steps per frame from which the keys begin; by default the last of the ladder.
    """
    own = _versions(laboratory)
    fresh = [each for each in own if each not in steppers]
    shown = {each: own.get(each) for each in (*fresh, *steppers[: MOST_STEPPERS - len(fresh)])}
    below, above = prepared(ladder, start)
    rungs = [*below, *ladder, *above]
    yield AskLibrary(kind="library")
    yield AskTruth(kind="truth", problem=problem)
    yield AskPhase(kind="phase", problem=problem, stepper=None)
    for name, version in shown.items():
        named: dict[str, Any] = {"problem": problem, "stepper": name, "version": version}
        for steps in rungs:
            yield AskRun(kind="run", steps_per_frame=steps, **named)
            yield AskPhase(kind="phase", steps_per_frame=steps, **named)
        for tried in reachable(ladder, start):
            yield AskOrder(kind="order", steps_per_frame=tried, **named)
        yield AskTheory(kind="theory", **named)
        yield AskStability(kind="stability", **named)
    for tried in reachable(ladder, start):
        named = {"problem": problem, "steppers": tuple(shown)}
        yield AskCommand(kind="command", steps_per_frame=tried, **named)


def checks_of(laboratory: Laboratory) -> Iterator[Ask]:
    """What the page asks of the user's own steppers."""
    for name, version in _versions(laboratory).items():
        for quick in (True, False):
            yield AskCheck(kind="check", stepper=name, quick=quick, version=version)


def _versions(laboratory: Laboratory) -> dict[str, str]:
    """Of the steppers of the user's own that work, by name."""
    own = laboratory.own.items()
    return {name: each.facts.version for name, each in own if each.facts.version}


def prepared(
    ladder: tuple[int, ...], start: int | None = None
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Steps per frame that the keys add to a ladder, in increasing order.

    Arguments:
        ladder: that the order plot has at first.
        start: from which the keys begin; by default the last of the ladder.

    Returns:
        Those which `-` adds, and those which `=` does.
    """
    first = ladder[-1] if start is None else start
    below = {first // 2**k for k in range(1, _MINUS + 1) if first % 2**k == 0}
    above = {first * 2**k for k in range(1, _EQUALS + 1)}
    return tuple(sorted(below - {*ladder})), tuple(sorted(above - {*ladder}))


def reachable(ladder: tuple[int, ...], start: int | None = None) -> Iterator[tuple[int, ...]]:
    """What the ladder may have become when the keys have been pressed, in whichever order."""
    below, above = prepared(ladder, start)
    for left in range(len(below), -1, -1):
        for right in range(len(above) + 1):
            yield tuple(sorted({*below[left:], *ladder, *above[:right]}))


def asks_ahead() -> Iterator[Ask]:
    """What the next keys and links will ask, so that the worker can prepare for them.

    Of the default scene after what is shipped, and of the lessons in their order.
    """
    _, shipped = prepared(DEFAULT_LADDER)
    default = SceneState(
        problem=DEFAULT_PROBLEM,
        steppers=DEFAULT_STEPPERS,
        ladder=(2 * shipped[-1],),
        plot="stability",
    )
    for scene in (default, *(SceneState(**each["state"]) for each in lessons())):
        problem, steps = scene.problem, scene.ladder[-1]
        yield AskTruth(kind="truth", problem=problem)
        for each in scene.steppers:
            yield AskRun(kind="run", problem=problem, stepper=each, steps_per_frame=steps)
        for each in scene.steppers if scene.plot == "stability" else ():
            yield AskStability(kind="stability", problem=problem, stepper=each)
