"""What costs a stepper its order: each cause has ropes on which it cannot show."""

from __future__ import annotations

from ropeode.checking.check_context import Examination
from ropeode.checking.diagnosis.diagnostic_ropes import driven_from_rest
from ropeode.checking.diagnosis.in_place_updates import in_place
from ropeode.checking.diagnosis.order_tests import Experiments
from ropeode.checking.problems import undamped
from ropeode.checking.report import Diagnosis

_DAMPING = 0.4


def causes_of_low_order(examination: Examination, expected: int) -> tuple[Diagnosis, ...]:
    """The causes that experiments single out.

    A cause is named if the order is kept on a rope where it cannot act, and lost on one that
    differs in nothing else.

    Arguments:
        examination: of a stepper whose order is too low on some rope.
        expected: the order that it should have.
    """
    experiments = Experiments(examination, expected)
    driveable = not examination.candidate.own_forces
    plain = experiments.on(undamped())
    if plain == "kept":
        found = [_lagged(experiments, "kept", experiments.on("unequal"))]
        if driveable and experiments.on("driven") == "low":
            found.append(_stage_time(experiments))
    else:
        found = [in_place(examination, experiments)]
        if driveable:
            found += _start(experiments)
    return tuple(each for each in found if each is not None)


def _lagged(experiments: Experiments, without: str, damped: str) -> Diagnosis | None:
    if without != "kept" or damped != "low":
        return None
    return Diagnosis(
        "lagged-damping",
        f"order {experiments.expected} without damping and less with it, on a rope that is "
        "otherwise the same: the damping is taken from a velocity of another time than the "
        "other forces, such as that of the step before",
        {"orders": dict(experiments.orders)},
    )


def _stage_time(experiments: Experiments) -> Diagnosis:
    return Diagnosis(
        "stage-time",
        f"order {experiments.expected} without a force that depends on time and less with one, "
        "on a rope that is otherwise the same: forces are evaluated at the wrong time inside "
        "the step",
        {"orders": dict(experiments.orders)},
    )


def _start(experiments: Experiments) -> list[Diagnosis | None]:
    """The start of a two-step method, and lagged damping beside it."""
    soft = experiments.on(driven_from_rest("soft"))
    hard = experiments.on(driven_from_rest("hard"))
    if soft != "kept" or hard != "low" or experiments.on("textbook") != "low":
        return []
    start = Diagnosis(
        "start",
        f"order {experiments.expected} where nothing moves and no force acts at first, and less "
        "where the same force acts from the first moment on: the start of the method is wrong, "
        "such as x(-dt) = x(0) in place of x(0) - dt v(0) + dt^2/2 a(0)",
        {"orders": dict(experiments.orders)},
    )
    damped = experiments.on(driven_from_rest("soft", _DAMPING))
    return [start, _lagged(experiments, soft, damped)]
