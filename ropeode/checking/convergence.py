"""Whether runs converge to the right solution, and with which order, for each quantity."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence

import numpy as np

from ropeode.analysis import (
    ORDER_TOLERANCE,
    PRE_ASYMPTOTIC,
    ROUND_OFF,
    UNRESOLVED,
    UNSOLVED,
    UNSTABLE,
    LeftOut,
    ObservedOrder,
    distances,
    largest_distance,
    moved,
    observed_order,
    quantity_distances,
)
from ropeode.analysis import resolution as resolution_of
from ropeode.checking.report import Convergence, Finding, Quantity
from ropeode.checking.richardson import limit_of
from ropeode.norms import NORMS, Norm
from ropeode.references import Reference

# The step size of a run and its states ``(times, *state)``, not-a-number from where it diverged;
# and those of the same run with different rounding, which show the size of the round-off, or None.
RunAndDouble = tuple[float, np.ndarray, np.ndarray | None]

# A wider interval may decide, but asks for finer steps.
_WIDE = 0.4
# A limit is wrong if its distance from the reference exceeds the sum of its own uncertainty, so
# many times the reference's bound, and so many times the round-off of the runs.
_BOUND, _ROUNDING = 3.0, 30.0
# Steps per frame: the coarsest, their ratio, how many runs at least, and the finest.
_COARSEST, _RATIO, _LEVELS, _MOST_STEPS = 6, 1.5, 8, 2000
PLURAL = {"position": "positions", "velocity": "velocities", "state": "states"}
# The ratio for high orders, whose errors soon fall below what a reference can resolve.
_CLOSE = 1.2


def ladder(observe: Callable[[Sequence[int]], Convergence]) -> Convergence:
    """Make runs with finer and finer steps until all orders are certain, or nothing helps."""
    levels = [_even(_COARSEST * _RATIO**k) for k in range(_LEVELS)]
    while True:
        convergence = observe(levels)
        if not any(_finer_steps_would_help(order) for order in convergence.orders.values()):
            break
        if levels[-1] * _RATIO > _MOST_STEPS:
            break
        levels.append(_even(levels[-1] * _RATIO))
    undetermined = any(each.verdict == "undetermined" for each in convergence.orders.values())
    finest = _finest_resolved(levels, convergence)
    if undetermined and finest < levels[-1]:
        # The order is high: only coarse steps have errors that a reference can resolve.
        return observe(_close_levels(finest))
    return convergence


def _even(steps: float) -> int:
    """The nearest even number: errors of two-step methods differ between even and odd ones."""
    return 2 * round(0.5 * steps)


def _finest_resolved(levels: Sequence[int], convergence: Convergence) -> int:
    """The largest number of steps at which some error is resolved."""
    return max(
        (
            steps
            for quantity in convergence.quantities.values()
            for steps, error in zip(levels, quantity.errors, strict=True)
            if error is not None and error >= quantity.resolution
        ),
        default=levels[0],
    )


def _close_levels(most: int) -> list[int]:
    """Closely spaced numbers of steps, from 1 to a little beyond `most`."""
    levels = [1]
    while levels[-1] < _RATIO * most:
        levels.append(max(levels[-1] + 1, round(levels[-1] * _CLOSE)))
    return levels


def _finer_steps_would_help(order: ObservedOrder) -> bool:
    if any(point.reason in (UNRESOLVED, ROUND_OFF) for point in order.left_out):
        return False
    if order.ci95 is not None:
        return order.ci95[1] - order.ci95[0] > _WIDE
    too_coarse = sum(
        point.reason in (UNSTABLE, UNSOLVED, PRE_ASYMPTOTIC) for point in order.left_out
    )
    return 2 * too_coarse >= len(order.left_out)


def converging(
    reference: Reference,
    runs: Sequence[RunAndDouble],
    *,
    expected: int | None,
    norms: Sequence[Norm] | None = None,
    unsolved: Collection[float] = (),
) -> Convergence:
    """Measure the errors of runs with several step sizes, their orders and their limit.

    Arguments:
        reference: of the problem.
        runs: from coarse to fine.
        expected: the order that is claimed.
        norms: of the quantities that the runs have; by default the largest distance of each.
        unsolved: the step sizes of runs that ended since their equations were not solved.
    """
    problem, dts = reference.problem, tuple(dt for dt, _, _ in runs)
    quantities = {}
    for norm in norms or [NORMS[f"{quantity}-max"] for quantity in problem.quantities]:
        own = tuple(_round_off(states, double, reference, norm) for _, states, double in runs)
        errors = tuple(_largest_error(states, reference, norm) for _, states, _ in runs)
        resolution = float(resolution_of(reference, norm)[-1])
        order = observed_order(
            dts,
            errors,
            resolution=resolution,
            rounding=own,
            motion=moved(reference, norm),
            claimed=expected,
            solved=[dt not in unsolved for dt in dts],
        )
        # The round-off of the finer half: coarse runs may have grown huge.
        limit = _distance_of_limit(reference, runs, norm, max(own[len(own) // 2 :]))
        quantities[norm.quantity] = Quantity(errors, own, resolution, *limit, order)
    return Convergence(problem.name, dts, quantities, expected)


def _largest_error(states: np.ndarray, reference: Reference, norm: Norm) -> float | None:
    """None if the run diverged before the trust horizon."""
    if np.isnan(states[: reference.trusted]).any():
        return None
    return float(np.max(distances(states, reference, norm)[1:]))


def _round_off(a: np.ndarray, b: np.ndarray | None, reference: Reference, norm: Norm) -> float:
    """The largest difference between two runs; 0 if one of them diverged, or there is no second."""
    if b is None:
        return 0.0
    a, b = a[: reference.trusted], b[: reference.trusted]
    if np.isnan(a).any() or np.isnan(b).any():
        return 0.0
    return largest_distance(reference.problem, norm, a, b)


def _distance_of_limit(
    reference: Reference, runs: Sequence[RunAndDouble], norm: Norm, round_off: float
) -> tuple[float, float] | tuple[None, None]:
    """The distance of the limit of the runs from the reference, and the largest one allowed."""
    values = [
        reference.problem.quantity(norm.quantity, states[: reference.trusted])
        for _, states, _ in runs
    ]
    limit = limit_of([dt for dt, _, _ in runs], values)
    if limit is None:
        return None, None
    off = quantity_distances(limit.values, reference, norm)
    # The uncertainty is that of a component, of which a node has several.
    per_node = np.sqrt(limit.values.shape[2]) * limit.uncertainty
    allowed = per_node + _BOUND * reference.bound(norm) + _ROUNDING * round_off
    worst = int(np.argmax(off - allowed))
    return float(off[worst]), float(allowed[worst])


def convergence_finding(check: str, convergence: Convergence) -> Finding:
    """The verdict on the convergence of runs."""
    expected, quantities = convergence.expected, convergence.quantities
    wrong, words, determined = is_wrong(convergence), [], True
    for name, quantity in quantities.items():
        order, finest, them = quantity.order, quantity.errors[-1], PLURAL[name]
        if {point.reason for point in order.left_out} == {UNRESOLVED} and not order.used:
            least = f"below {quantity.resolution:.1e}"
            words.append(f"{them} as exact as the reference: errors {least} at every dt")
        elif order.ci95 is None:
            determined = False
            words.append(f"{them}: order undetermined ({order.why})")
        elif order.verdict == "does not converge":
            size = "the run diverges" if finest is None else f"error {finest:.1e}"
            words.append(f"{them} do not converge: {size} at the finest dt")
        else:
            low, high = order.ci95
            words.append(f"{them} order {order.observed:.2f} [{low:.2f}, {high:.2f}]")
    for name, quantity in quantities.items():
        if quantity.has_wrong_limit():
            off, allowed = quantity.limit_off, quantity.limit_allowed
            words.append(f"wrong limit of {PLURAL[name]}: off by {off:.1e} (± {allowed:.0e})")
    line = "; ".join(words)
    if expected is not None:
        line += f"; expected {expected}"
    return Finding(
        check=check,
        status="fail" if wrong else "pass" if determined else "undetermined",
        line=line,
        evidence={
            name: {
                "observed": each.order.observed,
                "ci95": each.order.ci95,
                "verdict": each.order.verdict,
                "limit_off": each.limit_off,
            }
            for name, each in quantities.items()
        },
        convergence=convergence,
    )


def is_wrong(
    convergence: Convergence,
    counts: Callable[[ObservedOrder], bool] = lambda _: True,
    certainty: float = 1.0,
) -> bool:
    """Whether an order is lower than the claimed one, or runs tend to another solution.

    Arguments:
        convergence: of the runs.
        counts: whether an order is evidence.
        certainty: by how many times the allowed distance a limit must be off.
    """
    return any(
        # Without a claim, runs are refuted that do not converge.
        (counts(each.order) and each.order.refutes(convergence.expected or 0))
        or each.has_wrong_limit(certainty)
        for each in convergence.quantities.values()
    )


def falls_too_slowly(convergence: Convergence) -> bool:
    """Whether all errors of some quantity together fall with a lower power of dt than expected.

    That refutes no order where the runs may be too coarse for one, or rounding hides it.
    """
    expected = convergence.expected or 1
    for quantity in convergence.quantities.values():
        order = quantity.order
        lost = {point.dt for point in order.left_out if point.reason in (UNRESOLVED, ROUND_OFF)}
        points = [
            (dt, error)
            for dt, error in zip(convergence.dts, quantity.errors, strict=True)
            if error and np.isfinite(error)
        ]
        if order.verdict != "undetermined" or lost or len(points) < _LEVELS:
            continue
        dts, errors = np.log(np.array(points)).T
        if np.polyfit(dts, errors, 1)[0] < expected - max(ORDER_TOLERANCE, expected / 8.0):
            return True
    return False


def finest_is_unstable(convergence: Convergence) -> bool:
    """Whether the run with the smallest step size blew up, or was not solved."""
    finest = [LeftOut(convergence.dts[-1], reason) for reason in (UNSTABLE, UNSOLVED)]
    return any(each in order.left_out for order in convergence.orders.values() for each in finest)
