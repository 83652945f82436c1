"""Convergence of runs from files, whose round-off cannot be measured by a second run."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable, Sequence
from operator import attrgetter

import numpy as np

from ropeode.analysis import (
    FEWEST_POINTS,
    ORDER_TOLERANCE,
    ROUND_OFF,
    UNRESOLVED,
    UNSTABLE,
    ObservedOrder,
    moved,
)
from ropeode.checking.convergence import (
    PLURAL,
    convergence_finding,
    converging,
    finest_is_unstable,
    is_wrong,
)
from ropeode.checking.report import Convergence, Finding
from ropeode.checking.trajectories.coarse_steps import by_coarse_steps
from ropeode.checking.trajectories.layout import states_of
from ropeode.checking.trajectories.run_files import Run, finite
from ropeode.checking.written_precision import digits_of, single_precision
from ropeode.norms import NORMS, Norm
from ropeode.references import Reference, time_derivatives
from ropeode.theory import spectrum_of
from ropeode.validation import listed

# Errors below 30 times the round-off are left out; for the largest possible round-off, three times
# are enough.
_SHARE = 0.1
# The smallest ratio of the largest step size to the smallest: if a thirtieth of each error is
# rounding, the slope then has an error of 0.16.
_SPAN = 1.5
# Growing runs may by chance differ like those that tend to a limit; the limit is then believed to
# be wrong if it is off by so many times what its uncertainty allows.
_CERTAINLY = 10.0
# The error of a method of order 1, after a time T, is a part of about `rate^2 T dt / 2` of what
# moves fastest: it has another phase or amplitude. Beyond so many times that, errors need not fall.
_MOST = 16.0
# States of the reference at which the rate is taken.
_STATES = 16
# A step may round several times. Without a claim, methods of so high an order may be exact. A
# derivative is zero if its term of a Taylor series over the whole time is this part of the motion.
# An error would be seen that is so many times the largest rounding.
_ROUNDINGS, _HIGHEST, _VANISHING, _SEEN = 4.0, 4, 1e-9, 1e3
# A run blew up whose error is so many times the smallest one and the motion, or so many times the
# motion, whatever the others have.
_GROWN, _FAR_ABOVE, _HUGE = 10.0, 10.0, 100.0
# Over a few frames coarse runs are hardly asymptotic; a wider interval says nothing of an order.
_WIDEST = 1.0
# So many beginnings are looked at.
_BEGINNINGS = 24


def order_finding(
    reference: Reference,
    runs: Sequence[Run],
    expected: int | None,
    more_runs: Callable[[Convergence], str] | None = None,
) -> tuple[Finding, tuple[str, ...]]:
    """The verdict on convergence, and notes on its evidence.

    The rounding of the written numbers is known, and errors of its size are left out. The
    round-off of the runs themselves is unknown. Only if the runs seem wrong, or are in single
    precision, the step sizes are left out at which the largest possible round-off could be the
    reason. What is wrong has to show over the frames that the steps resolve. The finding is
    `undetermined`, and says what to add, if the runs show neither that the program is right nor
    that it is wrong.

    Arguments:
        reference: of the problem.
        runs: of the program.
        expected: the order that is claimed; None to measure it.
        more_runs: says which runs to add where those that there are show no order; without it,
            that is left open.
    """
    observe = functools.partial(converging_runs, expected=expected)
    worst = functools.partial(worst_rounding, reference=reference)
    as_written = observe(reference, runs)
    single = any(run.single for run in finite(runs))
    finding = convergence_finding("order", as_written)
    if not single and is_right(finding):
        return finding, ()
    careful = observe(reference, runs, worst)
    if not single and (exact := _exact(reference, careful)):
        rest = {name: q for name, q in as_written.quantities.items() if name not in exact}
        others = convergence_finding("order", dataclasses.replace(as_written, quantities=rest))
        if is_right(others):
            both = len(exact) < len(as_written.quantities)
            line = "; ".join([*exact.values(), others.line] if both else exact.values())
            return dataclasses.replace(others, line=line, convergence=careful), ()
    if single:
        careful = by_coarse_steps(lambda count: observe(reference, runs[:count]), careful, _SHARE)
    finding = convergence_finding("order", careful)
    if is_right(finding):
        note = "the finest step sizes are left out, because round-off could explain their errors"
        orders = careful.orders.values()
        lost = any(each.reason == ROUND_OFF for order in orders for each in order.left_out)
        return finding, (note,) if lost else ()
    coarse = ""
    if _is_refuted(careful):
        resolved, coarse = _resolved(reference, runs[-FEWEST_POINTS].dt)
        if _has_lower_order(careful) or (
            resolved is not None and _is_refuted(observe(resolved, runs, worst))
        ):
            return finding, ()
    if unstable := unstable_steps(reference, careful):
        line, fix = _unstable(reference, runs, unstable), ""
    else:
        why, fix = (coarse, "") if coarse else _undecided(careful, as_written, runs)
        line = f"{finding.line}{', but' if coarse else ':'} {why}"
    if not fix and more_runs is not None:
        fix = more_runs(careful)
    line = f"{line}; {fix}" if fix else line
    return dataclasses.replace(finding, status="undetermined", line=line), ()


def converging_runs(
    reference: Reference,
    runs: Sequence[Run],
    rounding: Callable[[Run], np.ndarray] = attrgetter("rounding"),
    *,
    expected: int | None = None,
    norms: Sequence[Norm] | None = None,
) -> Convergence:
    """Errors, orders and limit of runs from files.

    Arguments:
        reference: of the problem.
        runs: from coarse to fine.
        rounding: of each column of a run, ``(columns,)``; by default that of the written numbers.
        expected: the order that is claimed.
        norms: of quantities that the runs have; by default the largest distance of each.
    """
    return converging(
        reference,
        [(run.dt, run.states, states_of(run.problem, run.values + rounding(run))) for run in runs],
        expected=expected,
        norms=norms or [NORMS[f"{name}-max"] for name in runs[0].quantities],
    )


def worst_rounding(run: Run, reference: Reference) -> np.ndarray:
    """The largest possible rounding in each column, ``(columns,)``.

    That of the written digits, and a part of the round-off of the run: errors many times larger
    than the rounding are left out of an order.
    """
    return run.rounding + _SHARE * _round_off(run, reference)


def _round_off(run: Run, reference: Reference) -> np.ndarray:
    """The largest round-off of a right program in each column, ``(columns,)``.

    It is that of the position form of Störmer and Verlet: each step rounds positions, and so
    velocities by as much over dt. These errors add up like a random walk, and are integrated.
    """
    problem = reference.problem
    positions = problem.quantity(problem.quantities[0], reference.states)
    unit = 0.5 * run.epsilon * float(np.max(np.abs(positions), initial=problem.scale))
    span = float(problem.ts[-1] - problem.ts[0])
    of_rate = unit * np.sqrt(span / run.dt) / run.dt
    columns = np.full(run.values.shape[2], of_rate)
    columns[: run.layout.dim] *= span
    return columns


def _exact(reference: Reference, careful: Convergence) -> dict[str, str]:
    """Words for each quantity in which the runs are exact, but for rounding.

    That says something only where methods of lower order would have errors that can be seen: those
    of order q have errors of about ``T dt^q y^(q+1)/(q+1)!``. On a solution that is a polynomial in
    time, such as a parabola, a method of high order has none.
    """
    problem, dt, found = reference.problem, max(careful.dts), {}
    ts, highest = problem.ts[: reference.trusted], careful.expected or _HIGHEST
    for name, each in careful.quantities.items():
        rounding = _ROUNDINGS / _SHARE * np.array(each.rounding)
        largest = np.maximum(rounding, each.resolution)
        off = np.array(each.errors, dtype=np.float64)  # Not-a-number for a run that diverged.
        if not np.all(off <= largest):
            continue
        motion, span = moved(reference, NORMS[f"{name}-max"]), float(ts[-1] - ts[0])
        derivatives = time_derivatives(problem, ts, reference.states[: len(ts)], highest + 1)
        for order in range(derivatives.shape[1] - 1):
            values = problem.quantity(name, derivatives[:, order + 1])
            size = float(np.max(np.abs(values))) * span / math.factorial(order + 1)
            vanishes = size * span**order <= _VANISHING * motion
            seen = size * dt**order > _SEEN * largest[0]
            if order and (vanishes or (seen and order == careful.expected)):
                words = f"errors of rounding, at most {np.max(off):.1e}, at every dt"
                solution = f"exact on this problem: {words}" if vanishes else words
                found[name] = f"{PLURAL[name]} {solution}"
            if vanishes or not seen:
                break
    return found


def is_right(finding: Finding) -> bool:
    """Whether all quantities converge to the solution, and show it sufficiently."""
    orders = {} if finding.convergence is None else finding.convergence.orders
    return finding.status == "pass" and all(map(shown, orders.values()))


def _is_refuted(convergence: Convergence) -> bool:
    """Whether the quantities that do show an order are wrong, or the limit certainly is."""
    if finest_is_unstable(convergence):
        # Then any order is that of a few coarse runs, or of growing errors.
        return is_wrong(convergence, lambda _: False, _CERTAINLY)
    return is_wrong(convergence, shown)


def _has_lower_order(convergence: Convergence) -> bool:
    """Whether some quantity converges with a whole order that is lower than the claimed one.

    Pre-asymptotic errors fall more slowly than with order 1.
    """

    def is_whole(order: ObservedOrder) -> bool:
        high = order.ci95[1] if order.ci95 is not None else -math.inf
        return shown(order) and high >= 1.0 - ORDER_TOLERANCE

    return not finest_is_unstable(convergence) and is_wrong(convergence, is_whole, math.inf)


def _resolved(reference: Reference, dt: float) -> tuple[Reference | None, str]:
    """The reference over the frames from the start in which errors of dt have to fall with it.

    Arguments:
        reference: of the problem.
        dt: the largest of the fewest steps that show whether errors fall.

    Returns:
        The reference, None without such a frame; and why runs that do not converge in the others
        are no evidence.
    """
    rate, times = fastest_rate(reference), reference.problem.ts - reference.problem.ts[0]
    frames = int(np.sum(times[1 : reference.trusted] * dt * rate**2 <= _MOST))
    over = f"over the first {first_frames(frames)} alone" if frames else "in no frame"
    least = _MOST / (rate**2 * times[1]) if rate else math.inf
    return beginning(reference, frames), (
        f"the steps are too coarse to tell: the fastest part of the motion changes at a rate of "
        f"{rate:.3g}, which dt = {dt:.3g} resolves {over}; three runs with dt <= "
        f"{least:.2g} would resolve the first frame"
    )


def first_frames(frames: int) -> str:
    """So many of the first frames, after "the first": one is not counted."""
    return "frame" if frames == 1 else f"{frames} frames"


def shown(order: ObservedOrder) -> bool:
    """Whether there is an order, over a sufficient range of step sizes."""
    return order.verdict != "undetermined" and order.used[0] >= _SPAN * order.used[-1]


def unstable_steps(reference: Reference, convergence: Convergence) -> dict[str, list[float]]:
    """The step sizes with errors above the motion, where that leaves too few for an order.

    Those at which runs blew up are unstable. Others are far from the solution, as runs of another
    problem may be, too.

    Arguments:
        reference: of the problem.
        convergence: of the runs.

    Returns:
        Step sizes, from coarse to fine, by what is said of them; none that is said of none.
    """
    found: dict[float, bool] = {}
    for name, each in convergence.quantities.items():
        motion, order = moved(reference, NORMS[f"{name}-max"]), each.order
        known = dict(zip(convergence.dts, each.errors, strict=True))
        errors = {dt: math.inf if error is None else error for dt, error in known.items()}
        grown = max(_GROWN * min(errors.values()), _FAR_ABOVE * motion)
        for point in order.left_out if order.verdict == "undetermined" else ():
            if point.reason == UNSTABLE:
                blew_up = not errors[point.dt] <= min(grown, _HUGE * motion)
                found[point.dt] = found.get(point.dt, False) or blew_up
    steps = sorted(found, reverse=True)
    said = {
        "unstable": [dt for dt in steps if found[dt]],
        "far from the solution": [dt for dt in steps if not found[dt]],
    }
    return {words: dts for words, dts in said.items() if dts}


def _unstable(reference: Reference, runs: Sequence[Run], unstable: dict[str, list[float]]) -> str:
    """What runs show that blow up, or are far from the solution."""
    line = "; ".join(
        f"{words} at dt = {listed([f'{dt:.4g}' for dt in dts])}" for words, dts in unstable.items()
    )
    before = " and ".join(_before_blow_up(reference, runs).values())
    return f"{line}; before that of order {before}" if before else line


def _undecided(
    careful: Convergence, as_written: Convergence, runs: Sequence[Run]
) -> tuple[str, str]:
    """Why files show neither that a program is right nor that it is wrong; how to write better."""
    finest = runs[-1].values
    if _lost(as_written, ROUND_OFF):
        why = f"the numbers have {digits_of(finest)[0]} digits"
        return why, "write 17 digits, with std::setprecision(17) or %.17g"
    if _lost(careful, ROUND_OFF) and single_precision(finest):
        fix = "compute in double precision, or use larger steps"
        return "the numbers are in single precision", fix
    if _lost(careful, ROUND_OFF) or _lost(careful, UNRESOLVED):
        why = "errors are so small that round-off or the reference's bound may hide them"
        return why, ""
    lacking = [PLURAL[name] for name, order in careful.orders.items() if not shown(order)]
    part = f" in {listed(lacking)}" if 0 < len(lacking) < len(careful.orders) else ""
    return f"the step sizes show no order{part}", ""


def _lost(convergence: Convergence, reason: str) -> bool:
    """Whether an order is undetermined and a step size was left out for this reason."""
    return any(
        point.reason == reason
        for order in convergence.orders.values()
        if order.verdict == "undetermined"
        for point in order.left_out
    )


def beginning(reference: Reference, frames: int) -> Reference | None:
    """The reference, trusted over so many frames at most; None without a frame."""
    if frames == 0:
        return None
    trusted = min(reference.trusted, frames + 1)
    certificate = dataclasses.replace(reference.certificate, trusted=trusted)
    return dataclasses.replace(reference, certificate=certificate)


@functools.lru_cache(maxsize=4)
def fastest_rate(reference: Reference) -> float:
    """How fast the fastest part of a motion changes: the largest eigenvalue of its Jacobian.

    Arguments:
        reference: at some of whose states it is looked for.
    """
    problem, states = reference.problem, reference.states[: reference.trusted]
    chosen = np.unique(np.linspace(0, len(states) - 1, _STATES).astype(int))
    found = spectrum_of(problem, problem.ts[chosen], states[chosen])
    return float(np.max(np.abs(found.eigenvalues)))


def _before_blow_up(reference: Reference, runs: Sequence[Run]) -> dict[str, str]:
    """For each quantity the order over the longest beginning that shows one, in words.

    At its beginning an unstable run has errors like any other: what grows in it starts from
    rounding or from the error of the first steps.
    """
    found: dict[str, str] = {}
    for frames in np.unique(np.geomspace(1, reference.trusted - 1, _BEGINNINGS).astype(int))[::-1]:
        part = beginning(reference, int(frames))
        orders = {} if part is None else converging_runs(part, runs).orders
        for name in orders.keys() - found:
            low, high = orders[name].ci95 or (0.0, math.inf)
            if orders[name].verdict == "converges" and high - low <= _WIDEST:
                order = f"{orders[name].observed:.2f} [{low:.2f}, {high:.2f}]"
                found[name] = f"{order} in {name} over the first {first_frames(int(frames))}"
    return {name: found[name] for name in runs[0].quantities if name in found}
