"""Questions that the next keys and links will ask, so that the worker can prepare for them."""

from __future__ import annotations

from collections.abc import Iterator

from ropeode.laboratory.asks import (
    DEFAULT_LADDER,
    DEFAULT_PROBLEM,
    DEFAULT_STEPPERS,
    prepared,
)
from ropeode.laboratory.messages import Ask, AskRun, AskStability, AskTruth, SceneState
from ropeode.laboratory.scenes import lessons


def asks_ahead() -> Iterator[Ask]:
    """Those of the default scene after what is shipped, and of the lessons in their order."""
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
