"""Why a stepper's order is too low: each cause has ropes on which it cannot act."""

from __future__ import annotations

from ropeode.checking.check_context import Examination
from ropeode.checking.check_ropes import undamped
from ropeode.checking.diagnosis.diagnostic_ropes import driven_from_rest
from ropeode.checking.diagnosis.in_place_updates import diagnose_in_place_updates
from ropeode.checking.diagnosis.order_tests import OrderTests
from ropeode.checking.report import Diagnosis

_DAMPING = 0.4


def diagnose_low_order(examination: Examination, expected: int) -> tuple[Diagnosis, ...]:
    """The causes that experiments single out.

    A cause is named if the order is kept on a rope where it cannot act, and lost on a rope that
    differs in nothing else.
    """
    tests = OrderTests(examination, expected)
    can_be_driven = not examination.own_forces
    if tests.on(undamped()) == "kept":
        causes = [_lagged(tests, "kept", tests.on("unequal"))]
        if can_be_driven and tests.on("driven") == "low":
            causes.append(_stage_time(tests))
    else:
        causes = [diagnose_in_place_updates(examination, tests)]
        if can_be_driven:
            causes += _start(tests)
    return tuple(cause for cause in causes if cause is not None)


def _lagged(tests: OrderTests, without: str, damped: str) -> Diagnosis | None:
    if without != "kept" or damped != "low":
        return None
    return Diagnosis(
        "lagged-damping",
        f"order {tests.expected} without damping, a lower order with damping, on otherwise "
        "identical ropes: the damping uses the velocity at another time than the other forces, "
        "for example that of the previous step",
        {"orders": dict(tests.orders)},
    )


def _stage_time(tests: OrderTests) -> Diagnosis:
    return Diagnosis(
        "stage-time",
        f"order {tests.expected} without a force that depends on time, a lower order with one, "
        "on otherwise identical ropes: a stage of the step evaluates forces at the wrong time",
        {"orders": dict(tests.orders)},
    )


def _start(tests: OrderTests) -> list[Diagnosis | None]:
    """The start of a two-step method, and lagged damping beside it."""
    soft = tests.on(driven_from_rest("soft"))
    hard = tests.on(driven_from_rest("hard"))
    if soft != "kept" or hard != "low" or tests.on("textbook") != "low":
        return []
    start = Diagnosis(
        "start",
        f"order {tests.expected} if the rope starts at rest without a net force, a lower order "
        "if the same force acts from the beginning: the start of the method is wrong, for "
        "example x(-dt) = x(0) instead of x(0) - dt v(0) + dt^2/2 a(0)",
        {"orders": dict(tests.orders)},
    )
    damped = tests.on(driven_from_rest("soft", _DAMPING))
    return [start, _lagged(tests, soft, damped)]
