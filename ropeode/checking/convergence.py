"""Whether runs converge to the right solution, and how fast: positions and velocities apart."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ropeode.analysis.errors import RESOLUTION_FACTOR
from ropeode.analysis.order import (
    PRE_ASYMPTOTIC,
    ROUND_OFF,
    UNRESOLVED,
    WIDEST_RATIO,
    ObservedOrder,
    observed_order,
)
from ropeode.checking.report import Convergence, Finding
from ropeode.checking.richardson import limit_of
from ropeode.norms import NORMS, distance, motion
from ropeode.references.reference import Reference
from ropeode.simulation.trajectory import step_size

# An observed order is the expected one if it is not further below it than this.
TOLERANCE = 0.25
# An interval wider than this, though it may show an order, is worth finer steps and a second look.
_WIDE = 0.4
# A limit is another than the reference if it is further from it than its own uncertainty, and so
# many times the reference's bound and what rounding does to the runs.
_BOUND, _ROUNDING = 3.0, 30.0
# Steps per frame: where a ladder begins, its ratio, and how far it is followed.
_COARSEST, _RATIO, _LEVELS, _MOST_STEPS = 6, 1.5, 8, 2000
_PLURAL = {"position": "positions", "velocity": "velocities", "state": "states"}
# The ratio where there is little room between coarse steps and what a reference can tell.
_CLOSE = 1.2


def ladder(observe: Callable[[Sequence[int]], Convergence]) -> Convergence:
    """Observe at finer and finer steps until both orders are known, or it is of no more use.

    Arguments:
        observe: makes the runs with so many steps per frame, and says what came of them.
    """
    levels = [_even(_COARSEST * _RATIO**k) for k in range(_LEVELS)]
    while True:
        found = observe(levels)
        if not any(_finer_steps_would_help(order) for order in found.orders.values()):
            break
        if levels[-1] * _RATIO > _MOST_STEPS:
            break
        levels.append(_even(levels[-1] * _RATIO))
    undetermined = any(order.verdict == "undetermined" for order in found.orders.values())
    finest = _finest_resolved(levels, found)
    if undetermined and finest < levels[-1]:
        # Of a high order: only coarse steps have errors that a reference can tell.
        return observe(_close_levels(finest))
    return found


def _even(steps: float) -> int:
    """The even number next to it: errors of two-step methods differ between even and odd."""
    return 2 * round(0.5 * steps)


def _finest_resolved(levels: Sequence[int], found: Convergence) -> int:
    """The most steps at which some error can still be told."""
    return max(
        (
            steps
            for quantity, errors in found.errors.items()
            for steps, error in zip(levels, errors, strict=True)
            if error is not None and error >= found.resolution[quantity]
        ),
        default=levels[0],
    )


def _close_levels(most: int) -> list[int]:
    """Numbers of steps from 1 on, close to each other, to a little beyond `most`."""
    levels = [1]
    while levels[-1] < _RATIO * most:
        levels.append(max(levels[-1] + 1, round(levels[-1] * _CLOSE)))
    return levels


def _finer_steps_would_help(order: ObservedOrder) -> bool:
    if any(point.reason in (UNRESOLVED, ROUND_OFF) for point in order.left_out):
        return False
    if order.ci95 is not None:
        return _is_wide(order.ci95)
    too_coarse = sum(point.reason in ("unstable", PRE_ASYMPTOTIC) for point in order.left_out)
    return 2 * too_coarse >= len(order.left_out)


def converging(
    reference: Reference,
    runs: Sequence[tuple[float, np.ndarray]],
    *,
    expected: int | None,
    doubles: Sequence[np.ndarray | None] = (),
    quantities: Sequence[str] | None = None,
) -> Convergence:
    """Hold runs with several step sizes against the reference of their problem.

    Arguments:
        reference: of the problem.
        runs: step size and states ``(times, *state)`` of each, not-a-number from where it
            diverged.
        expected: the order that is claimed.
        doubles: states of the same runs with other roundings, which show how large the
            round-off is; None for a run that has none.
        quantities: that are looked at; by default all that the problem has.
    """
    problem = reference.problem
    inside = slice(1, reference.trusted)
    errors: dict[str, tuple[float | None, ...]] = {}
    orders: dict[str, ObservedOrder] = {}
    resolution: dict[str, float] = {}
    rounding_of: dict[str, float] = {}
    order_of_runs = sorted(range(len(runs)), key=lambda i: -runs[i][0])
    dts = tuple(runs[i][0] for i in order_of_runs)
    for quantity in quantities or problem.quantities:
        norm = NORMS[f"{quantity}-max"]

        def apart(a: np.ndarray, b: np.ndarray, norm=norm) -> float | None:
            both = slice(0, reference.trusted)
            if np.isnan(a[both]).any() or np.isnan(b[both]).any():
                return None
            return float(np.max(distance(problem, norm, a, b)[inside]))

        found = [apart(runs[i][1], reference.states) for i in order_of_runs]
        rounding = [
            apart(runs[i][1], double) or 0.0
            if i < len(doubles) and (double := doubles[i]) is not None
            else 0.0
            for i in order_of_runs
        ]
        errors[quantity] = tuple(found)
        # Of the finer half: coarse runs may have grown huge.
        rounding_of[quantity] = max(rounding[len(rounding) // 2 :])
        resolution[quantity] = float(RESOLUTION_FACTOR * reference.bound(norm)[-1])
        orders[quantity] = observed_order(
            dts,
            found,
            resolution=resolution[quantity],
            rounding=rounding,
            motion=float(motion(problem, reference.states, norm)[reference.trusted - 1]),
            # Where an interval is too wide, `_is_lower` weighs all errors.
            widest=np.inf,
        )
    limits = _limits(reference, runs, rounding_of, quantities or problem.quantities)
    return Convergence(
        problem=problem.name,
        dts=dts,
        errors=errors,
        resolution=resolution,
        orders=orders,
        expected=expected,
        limits=limits,
    )


def _limits(
    reference: Reference,
    runs: Sequence[tuple[float, np.ndarray]],
    rounding: Mapping[str, float],
    quantities: Sequence[str],
) -> dict[str, tuple[float, float]]:
    """How far the limit of the runs is from the reference, and how far it may be."""
    problem, known = reference.problem, slice(0, reference.trusted)
    dts = [dt for dt, _ in runs]
    found = {}
    for quantity in quantities:
        norm = NORMS[f"{quantity}-max"]
        limit = limit_of(dts, [problem.quantity(quantity, states[known]) for _, states in runs])
        if limit is None:
            continue
        right = problem.quantity(quantity, reference.states[known])
        off = np.max(np.linalg.norm(limit.values - right, axis=2), axis=1)
        # The uncertainty is of components, of which a node has a few.
        per_node = np.sqrt(right.shape[2]) * limit.uncertainty
        allowed = per_node + _BOUND * reference.bound(norm) + _ROUNDING * rounding[quantity]
        worst = int(np.argmax(off - allowed))
        found[quantity] = float(off[worst]), float(allowed[worst])
    return found


def steps_to_dts(reference: Reference, steps: Sequence[int]) -> list[float]:
    """Step sizes of numbers of steps per frame."""
    return [step_size(reference.problem, each) for each in steps]


def _is_wide(interval: tuple[float, float]) -> bool:
    return interval[1] - interval[0] > _WIDE


def _is_lower(found: Convergence, quantity: str, expected: int) -> bool:
    """Whether an observed order is below the expected one.

    A wide interval may hold any order: the error's leading term may change its sign among the
    steps, and rounding forbid finer ones. Then all errors count that can be told, with more
    room where the order is high.
    """
    order = found.orders[quantity]
    assert order.ci95 is not None
    assert order.observed is not None
    if order.ci95[1] < expected - TOLERANCE:
        return True
    least = expected - max(TOLERANCE, expected / 8.0)
    return _is_wide(order.ci95) and max(order.observed, _overall(found, quantity)) < least


def _overall(found: Convergence, quantity: str) -> float:
    """The slope of all errors that are neither unstable nor lost in rounding."""
    left_out = found.orders[quantity].left_out
    lost = {point.dt for point in left_out if point.reason != PRE_ASYMPTOTIC}
    points = [
        (dt, error)
        for dt, error in zip(found.dts, found.errors[quantity], strict=True)
        if error and dt not in lost
    ]
    dts, errors = np.log(np.array(points)).T
    return float(np.polyfit(dts, errors, 1)[0])


def convergence_finding(check: str, found: Convergence) -> Finding:
    """The verdict on what was observed.

    Arguments:
        check: name of the check.
        found: by `converging`.
    """
    faults, words, known = [], [], True
    for quantity, order in found.orders.items():
        last = found.errors[quantity][-1]
        them = _PLURAL[quantity]
        if order.verdict == "undetermined":
            known = False
            words.append(f"{them}: order undetermined ({order.why})")
            if found.expected is not None or last is None:
                faults.append(quantity)
            continue
        assert order.observed is not None
        assert order.ci95 is not None
        size = "diverges" if last is None else f"{last:.1e}"
        if order.verdict == "does not converge":
            words.append(f"{them} do not converge: error {size} at the finest dt")
            faults.append(quantity)
            continue
        low, high = order.ci95
        words.append(
            f"{them} order {order.observed:.2f} [{low:.2f}, {high:.2f}]"
            if high <= WIDEST_RATIO * low
            else f"{them} order between {low:.2f} and {high:.2f}, all errors together fall with "
            f"the power {_overall(found, quantity):.2f} of dt"
        )
        if found.expected is not None and _is_lower(found, quantity, found.expected):
            faults.append(quantity)
    for quantity, (off, allowed) in found.limits.items():
        if off > allowed:
            words.append(f"limit of {_PLURAL[quantity]} off by {off:.1e} (known to {allowed:.0e})")
            faults.append(quantity)
    line = "; ".join(words)
    if found.expected is not None:
        line += f"; expected {found.expected}"
    return Finding(
        check=check,
        status="fail" if faults else "pass" if known else "note",
        line=line,
        evidence={
            quantity: {
                "observed": order.observed,
                "ci95": order.ci95,
                "verdict": order.verdict,
                "limit_off": found.limits[quantity][0] if quantity in found.limits else None,
            }
            for quantity, order in found.orders.items()
        },
        convergence=found,
    )
