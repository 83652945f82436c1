"""The observed order of convergence, with its evidence."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from ropeode.arrays import real_array
from ropeode.validation import bad_value, not_traced

Verdict = Literal["converges", "does not converge", "undetermined"]

UNSTABLE = "unstable"
UNSOLVED = "unsolved"
UNRESOLVED = "below the reference's bound"
ROUND_OFF = "round-off"
PRE_ASYMPTOTIC = "pre-asymptotic"
TOO_FEW = "too few to fit"
REASONS = (UNSTABLE, UNSOLVED, UNRESOLVED, ROUND_OFF, PRE_ASYMPTOTIC, TOO_FEW)

FEWEST_POINTS = 3
# Of many points a few lie on a line by chance. Where coarser ones lie off it, so many are needed,
# and one more where the local slope breaks off by more than this, as it does where errors scatter.
_ENOUGH, _ENOUGH_BROKEN, _BREAK = 4, 5, 2.0
# Where an error is larger than this many times the motion itself, the run has blown up.
UNSTABLE_FROM = 2.0
# Round-off adds to the error; from this factor on it changes no digit that matters.
_ROUND_OFF_FACTOR = 30.0
# Points belong to one power law if none is further from it than this, in log(error).
_LARGEST_RESIDUAL = 0.1
# Bounds on 1/(ratio - 1) for ratios of step sizes that are very small or very large; and on what
# part of a change of local slopes is left at the next step size.
_EXTRAPOLATION, _SLOWEST = (1.0, 3.0), 0.8
# Three points may happen to lie on a line; that does not make the slope more certain than this.
_LEAST_HALF_WIDTH = 0.01
# A slope that may be below this is not convergence of any use.
_LEAST_ORDER = 0.5
# An interval without the order that it should have is evidence up to this width: without a whole
# one, of a fractional one; without the declared one, of another.
NARROW_ORDER = 0.25
# An observed order may be lower than the claimed one by this.
ORDER_TOLERANCE = 0.25
# Student's t at 97.5% for 1, 2, ... degrees of freedom, as `scipy.special.stdtrit` computes it. To
# import that takes a fifth of the time that JAX takes.
_STUDENT = (
    *(12.706204736174694, 4.302652729749462, 3.1824463052837078, 2.7764451051977934),
    *(2.5705818356363146, 2.4469118511449786, 2.364624251592784, 2.306004135204166),
    *(2.262157162798205, 2.228138851986274, 2.200985160091639, 2.1788128296672284),
)
# The next runs to make have half, a quarter, ... of the smallest step size, or this part of the
# largest.
_FINER, _COARSER = 0.5, 2.0


@dataclasses.dataclass(frozen=True)
class LeftOut:
    """A step size that was not used.

    Arguments:
        dt: the step size.
        reason: `unstable`, `unsolved`, `below the reference's bound`, `round-off`, `pre-asymptotic`
            or `too few to fit`.
    """

    dt: float
    reason: str


@dataclasses.dataclass(frozen=True)
class ObservedOrder:
    """The slope of log(error) over log(dt), where it has one.

    Arguments:
        observed: the slope; negative where errors grow as dt shrinks; None if undetermined.
        ci95: its 95% confidence interval; None if undetermined.
        verdict: `converges`; `does not converge`: the error stays (or grows) while dt
            shrinks: the stepper solves another equation; `undetermined`.
        used: the step sizes that the fit used, from coarse to fine.
        left_out: the others, with reasons.
        why: for `undetermined`, what is missing.
        add: for `undetermined`, step sizes of further runs that may decide; from coarse to fine.

    Examples:
        >>> from ropeode import observed_order
        >>> order = observed_order([0.1, 0.05, 0.025], [1e-2, 2.5e-3, 6.25e-4])
        >>> round(order.observed, 2), order.used
        (2.0, (0.1, 0.05, 0.025))
        >>> [round(end, 2) for end in order.ci95]
        [1.99, 2.01]
    """

    observed: float | None
    ci95: tuple[float, float] | None
    verdict: Verdict
    used: tuple[float, ...]
    left_out: tuple[LeftOut, ...]
    why: str | None = None
    add: tuple[float, ...] = ()

    @property
    def slope_words(self) -> str:
        """The slope with its interval, of an order that is not undetermined."""
        assert self.ci95 is not None
        low, high = self.ci95
        return f"the slope {self.observed:.2f} has the interval [{low:.2f}, {high:.2f}]"

    def withheld(self, why: str) -> ObservedOrder:
        """Undetermined: what was observed is not the order for small steps.

        Arguments:
            why: is said with it.

        Examples:
            >>> from ropeode.analysis.order import observed_order
            >>> order = observed_order([0.1, 0.05, 0.025], [4e-2, 1e-2, 2.5e-3])
            >>> order.verdict, order.withheld("the runs are too coarse").verdict
            ('converges', 'undetermined')
        """
        left_out = (*self.left_out, *(LeftOut(dt, PRE_ASYMPTOTIC) for dt in self.used))
        add = _runs_to_add(left_out, max(FEWEST_POINTS - len(self.used), 2))
        return ObservedOrder(None, None, "undetermined", (), left_out, why, add)


def observed_order(
    dts: ArrayLike,
    errors: Any,
    *,
    resolution: ArrayLike = 0.0,
    rounding: ArrayLike = 0.0,
    motion: float = np.inf,
    claimed: int | None = None,
    solved: ArrayLike = True,
) -> ObservedOrder:
    """Find the observed order from errors at step sizes of any ratio.

    Step sizes whose error is not finite or larger than twice the motion (unstable), below
    the resolution of the reference, or below 30 times the run's round-off are left out.
    The order is a limit for small steps. So the fit starts from the three finest of the rest and
    takes in coarser ones as long as all lie on one power law to 10%; the others are
    pre-asymptotic. The slope is fitted by least squares.

    The interval starts as Student's for the fitted slope. Student's interval assumes that the
    points scatter, but the rest of the pre-asymptotic part bends them. So it is widened to
    contain the local slope at the fine end, plus or minus twice what that slope lacks of its
    limit at dt = 0: the more, the more slowly its changes shrink. It is never narrower than 0.01 to
    each side.
    docs/reference/table.md says how often it contains the order.

    Of many points a few lie on one line by chance. Where coarser ones do not, four are needed, or
    five if the local slope changes by more than 2 from the line to the next point. With a claim,
    three are enough.

    An interval with two whole orders in it decides nothing: the order is undetermined. Neither
    does a wide one with none, for errors bend so where they are about as large as they can get;
    a fractional order, as of forces that jump, shows in a narrow one. With a
    claim it decides if it excludes the claimed order, or all lower ones.

    Arguments:
        dts: step sizes in any order; all different and above zero.
        errors: the error at each; None or not finite where a run diverged.
        resolution: an error below it is unresolved; one number, or one per step size.
        rounding: the round-off of the runs; one number, or one per step size.
        motion: the size of the motion.
        claimed: the order that the runs are claimed to have; None to measure it.
        solved: whether the equations of implicit steps were solved; one truth, or one per step
            size. Those that were not are left out as unsolved.

    Raises:
        InputError: step sizes are not positive and different, or there are more or fewer
            errors than step sizes.

    Examples:
        >>> from ropeode import observed_order
        >>> observed_order([0.1, 0.05, 0.025], [1e-2, 2.5e-3, 6.25e-4]).verdict
        'converges'
        >>> observed_order([0.1, 0.05], [1e-2, 2.5e-3]).why
        '2 of 2 step sizes can be used, 3 are needed'
    """
    dt = real_array("dts", dts, "[0.1, 0.05, 0.025]")
    rest = {"errors": errors, "resolution": resolution, "rounding": rounding}
    for name, value in {**rest, "motion": motion, "claimed": claimed, "solved": solved}.items():
        not_traced(name, value)
    if not np.iterable(errors):
        raise bad_value("errors", errors, "a number or None for each step size", "give a list")
    error = np.array([np.nan if e is None else e for e in errors], dtype=np.float64)
    if dt.shape != error.shape or dt.ndim != 1:
        raise bad_value(
            "errors", len(error), f"one for each of the {len(dt)} step sizes", "add them"
        )
    if not np.all(np.isfinite(dt) & (dt > 0)) or len(np.unique(dt)) != len(dt):
        raise bad_value("dts", dt.tolist(), "different step sizes > 0", "drop repeated ones")
    if np.any(error < 0):
        raise bad_value("errors", error.tolist(), "errors >= 0", "give distances")

    reasons = np.full(len(dt), "", dtype=object)
    with np.errstate(invalid="ignore", over="ignore"):
        reasons[error < _ROUND_OFF_FACTOR * np.asarray(rounding)] = ROUND_OFF
        reasons[(error < np.asarray(resolution)) | (error == 0)] = UNRESOLVED
        reasons[~(error <= UNSTABLE_FROM * motion) | ~np.isfinite(error)] = UNSTABLE
        reasons[~np.broadcast_to(np.asarray(solved, bool), dt.shape)] = UNSOLVED

    usable = [i for i in np.argsort(dt) if not reasons[i]]
    used = _asymptotic_range(np.log(dt[usable]), np.log(error[usable]))
    for i in usable[used:]:
        reasons[i] = PRE_ASYMPTOTIC if len(usable) >= FEWEST_POINTS else TOO_FEW
    left_out = tuple(LeftOut(float(dt[i]), str(reasons[i])) for i in np.argsort(-dt) if reasons[i])
    kept = usable[:used]
    nothing = ObservedOrder(None, None, "undetermined", (), left_out)
    if len(usable) < FEWEST_POINTS:
        few = f"{len(usable)} of {len(dt)} step sizes can be used, {FEWEST_POINTS} are needed"
        return nothing.withheld(few)
    local = np.diff(np.log(error[usable])) / np.diff(np.log(dt[usable]))
    scattered = ""
    if _scatters(local):
        scattered = (
            "; the errors scatter, as where the right-hand side is not smooth, or where they "
            "happen to cancel at some step sizes"
        )
    if not kept:
        bent = "the three finest usable step sizes do not lie on one power law"
        return nothing.withheld(bent + scattered)

    slope, low, high = _slope(dt[kept], error[kept])
    order = ObservedOrder(
        observed=slope,
        ci95=(low, high),
        verdict="converges" if high >= _LEAST_ORDER else "does not converge",
        used=tuple(float(dt[i]) for i in reversed(kept)),
        left_out=left_out,
    )
    if claimed is None and used < len(usable) and used < _enough(local[used - 2 :]):
        few = f"only the {used} finest of {len(usable)} usable step sizes lie on one power law"
        return order.withheld(few + scattered)
    if high >= _LEAST_ORDER and not _decides(low, high, claimed):
        return order.withheld(f"{order.slope_words}, which holds {_orders_in(low, high)}")
    return order


def _enough(local: np.ndarray) -> int:
    """How many points on a line show an order; local slopes from its coarse end to the rest."""
    return _ENOUGH_BROKEN if abs(local[1] - local[0]) > _BREAK else _ENOUGH


def _scatters(local: np.ndarray) -> bool:
    """Whether local slopes rise and fall by turns."""
    changes = np.diff(local)
    turns = changes[1:] * changes[:-1] < 0.0
    return len(turns) > 1 and bool(np.mean(turns) > 0.5)


def whole_orders(low: float, high: float) -> range:
    """The whole orders inside an interval."""
    return range(max(math.ceil(low), 0), math.floor(high) + 1)


def _decides(low: float, high: float, claimed: int | None) -> bool:
    """Whether an interval decides what the order is, or whether it is the claimed one at least."""
    if claimed is None:
        orders = len(whole_orders(low, high))
        return low > 0 and (orders == 1 or (orders == 0 and high - low <= NARROW_ORDER))
    return high < claimed - ORDER_TOLERANCE or low > claimed - 1


def _orders_in(low: float, high: float) -> str:
    if not whole_orders(low, high):
        return "no whole order"
    first, *others = whole_orders(low, high)
    if len(others) == 1:
        return f"the orders {first} and {others[0]}"
    return f"the orders {first} to {others[-1]}" if others else f"the order {first}"


def _runs_to_add(left_out: Sequence[LeftOut], count: int) -> tuple[float, ...]:
    """Step sizes of further runs, from the reasons for which none of the others could be used."""
    reasons = {each.dt: each.reason for each in left_out}
    lost = [dt for dt, reason in reasons.items() if reason in (UNRESOLVED, ROUND_OFF)]
    coarsest, finest = max(reasons), min(reasons)
    if finest not in lost:
        return tuple(finest * _FINER**k for k in range(1, count + 1))
    if reasons[coarsest] not in (UNSTABLE, UNSOLVED, PRE_ASYMPTOTIC):
        return tuple(coarsest * _COARSER**k for k in range(count, 0, -1))
    # What is finer is lost in rounding and what is coarser is unstable: between the two.
    finer = max(dt for dt in lost if dt < min(reasons.keys() - lost))
    return tuple(float(each) for each in np.geomspace(coarsest, finer, count + 2)[1:-1])


def _asymptotic_range(log_dt: np.ndarray, log_error: np.ndarray) -> int:
    """How many of the points, which come from fine to coarse, lie on one power law."""
    used = 0
    for points in range(FEWEST_POINTS, len(log_dt) + 1):
        _, residuals = _line(log_dt[:points], log_error[:points])
        if np.max(np.abs(residuals)) > _LARGEST_RESIDUAL:
            break
        used = points
    return used


def _line(x: np.ndarray, y: np.ndarray) -> tuple[float, np.ndarray]:
    """The slope of the least-squares line, and the residuals.

    Computed by the formula: general fits take many times as long, and sweeps need millions.
    """
    x, y = x - np.sum(x) / len(x), y - np.sum(y) / len(y)
    slope = float(np.dot(x, y) / np.dot(x, x))
    return slope, y - slope * x


def _student(degrees: int) -> float:
    """How many standard errors lie on each side of a 95% interval."""
    if degrees <= len(_STUDENT):
        return _STUDENT[degrees - 1]
    from scipy import special

    return float(special.stdtrit(degrees, 0.975))


def _slope(dt: np.ndarray, error: np.ndarray) -> tuple[float, float, float]:
    """The fitted slope and its interval; points from fine to coarse."""
    log_dt, log_error = np.log(dt), np.log(error)
    slope, residuals = _line(log_dt, log_error)
    degrees, spread = len(dt) - 2, log_dt - np.sum(log_dt) / len(log_dt)
    stderr = np.sqrt(np.dot(residuals, residuals) / degrees / np.dot(spread, spread))
    half = max(_student(degrees) * stderr, _LEAST_HALF_WIDTH)
    local = np.diff(log_error) / np.diff(log_dt)
    # Where local slopes approach the order like dt, the finest one still lacks its last change
    # times 1/(ratio - 1).
    ratio = np.exp(np.mean(np.diff(log_dt)))
    lasting = np.clip(1.0 / (ratio - 1.0), *_EXTRAPOLATION)
    changes = np.diff(local)[:2]
    if len(changes) > 1 and changes[0] * changes[1] > 0.0:
        # Where they drift, and their changes shrink more slowly than that, it lacks more.
        shrink = min(changes[0] / changes[1], _SLOWEST)
        lasting = max(lasting, shrink / (1.0 - shrink))
    missing = lasting * np.max(np.abs(local[1:3] - local[0]) / (1.0, 2.0)[: len(local) - 1])
    return (
        slope,
        float(min(slope - half, local[0] - 2.0 * missing)),
        float(max(slope + half, local[0] + 2.0 * missing)),
    )
