"""A two-step method whose start is wrong, while its steps are right."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ropeode.checking.diagnosis.methods import VERLET_START
from ropeode.checking.report import Diagnosis
from ropeode.theory import Expansion, derivative_of_rhs, projected

_EXPLAINED, _CLOSE = 1e-2, 1e-2


def diagnose_start(expansions: Sequence[Expansion], expected: int) -> Diagnosis | None:
    """What a start, or the state that is handed out, is off by below the expected order.

    Returns:
        None if the steps are off by no less, or the difference is none that is known.
    """
    if all(each.one_step for each in expansions):
        return None
    for order in range(-1, expected):
        if any(np.any(each.start(order).known) for each in expansions):
            break
        if any(np.any(each.rate(order).known) for each in expansions):
            return None
    else:
        return None
    starts = np.concatenate([each.start(order).value for each in expansions])
    slopes = np.concatenate([each.slopes for each in expansions])
    v, a = slopes[:, 0].ravel(), slopes[:, 1].ravel()
    of_x, of_v = (projected(starts[:, half].ravel(), np.stack([v, a])) for half in (0, 1))
    size = float(np.max(np.abs(starts)))
    if max(of_x.rest, of_v.rest) > _EXPLAINED * size:
        if order < 1 or _is_handed_out(expansions, order):
            return None
        line = (
            f"the start of the method is of order {order}: it leaves an error of dt^{order}, which "
            "the steps that follow only carry on; by themselves they are of a higher order"
        )
        remedy = f"make the first steps by a method of order {expected - 1} or higher"
        return Diagnosis("start", line, {"order": order}, remedy)
    off = {
        quantity: dict(zip(("velocity", "acceleration"), of.coefficients.tolist(), strict=True))
        for quantity, of in (("positions", of_x), ("velocities", of_v))
    }
    evidence = {"order": order, **off}
    dt = f" dt^{order}" if order > 1 else " dt" if order else ""
    small = _CLOSE * max(abs(value) for of in off.values() for value in of.values())
    texts = [
        f"{quantity} are off by {value:.3g}{dt} times the {name}"
        for quantity, of in off.items()
        for name, value in of.items()
        if abs(value) > small
    ]
    if _is_handed_out(expansions, order):
        if order == 1:
            late = {"positions": off["positions"]["velocity"]}
            late["velocities"] = off["velocities"]["acceleration"]
            texts = [
                f"{quantity} are those of {abs(by):.3g} dt {'later' if by > 0 else 'earlier'}"
                for quantity, by in late.items()
                if abs(by) > small
            ]
        line = (
            f"the state that is handed out is of order {order}, while the steps are of a higher "
            f"one: its {' and its '.join(texts)}"
        )
        return Diagnosis("output", line, evidence, "hand out positions and velocities of one time")
    if order == 0 and texts == ["velocities are off by -1 times the velocity"]:
        what = "it forgets the initial velocity, as x(-dt) = x(0) does"
    else:
        what = " and ".join(texts)
    line = f"the start of the method is of order {order}: {what}"
    return Diagnosis("start", line, evidence, VERLET_START)


def _is_handed_out(expansions: Sequence[Expansion], order: int) -> bool:
    """Whether a difference stays as it is, and does not move on as the solution's derivative does.

    An error of the start moves on like a disturbance of the state: its rate is f_y times itself.
    """
    for each in expansions:
        start, rate = each.start(order).value, each.rate(order).value
        carried = derivative_of_rhs(each.problem)(each.t, each.y, start)
        size = float(np.max(np.abs(carried)))
        if np.max(np.abs(rate - carried)) > _EXPLAINED * size:
            return True
    return False
