"""The observed order of convergence, with its evidence."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

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
# An interval without a whole order is evidence of a fractional one up to this width.
_NARROW_ORDER = 0.25
# An observed order may be lower than the claimed one by this.
ORDER_TOLERANCE = 0.25
# An interval is evidence against the order that it should have if it is no wider than so many times
# its distance below it, or than these numbers, with a whole order in it and without: on the way to
# the asymptotic range slopes are fractional, too.
_FAR, _WIDE, _FRACTIONAL = 2.0, 0.25, 0.1
# Errors and theory agree to this part.
AGREE = 0.1
# Over more than the first factor in dt errors agree with theory by no accident; over more than the
# second they refute it, if finer ones are further from it.
_LASTING, _SPAN = 1.99, 7.99
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

    @property
    def whole(self) -> int | None:
        """The one whole order in the interval of runs that converge; None if there is none."""
        if self.ci95 is None or self.verdict != "converges":
            return None
        inside = [order for order in _whole_orders(*self.ci95) if order]
        return inside[0] if len(inside) == 1 else None

    def refutes(self, order: int) -> bool:
        """Whether runs that should have an order have a lower one, or do not converge.

        Examples:
            >>> from ropeode import observed_order
            >>> order = observed_order([0.1, 0.05, 0.025], [4e-2, 1e-2, 2.5e-3])
            >>> order.refutes(2), order.refutes(3)
            (False, True)
        """
        if self.ci95 is None:
            return False
        return self.verdict == "does not converge" or self.ci95[1] < order - ORDER_TOLERANCE

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
    expected: int | None = None,
    constant: float | None = None,
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

    A higher term of the error may outweigh the leading one over many step sizes. The errors then
    lie on a line with another slope. So an interval that excludes the expected (or claimed) order
    decides nothing unless it is narrow, or far below that order for its width. Where theory
    knows the error's `constant`, its line tells whether errors are asymptotic: they agree with it
    to 10% from the finest on, over a factor of two in dt. Three points are enough then; before,
    such an interval decides nothing, however narrow. Errors that go away from the line the finer
    they are, over a factor of eight in dt, refute theory.

    Arguments:
        dts: step sizes in any order; all different and above zero.
        errors: the error at each; None or not finite where a run diverged.
        resolution: an error below it is unresolved; one number, or one per step size.
        rounding: the round-off of the runs; one number, or one per step size.
        motion: the size of the motion.
        claimed: the order that the runs are claimed to have; None to measure it.
        expected: the order that they should have, by theory or as a stepper declares it; None or 0
            if nobody knows; by default the claimed one.
        constant: by theory, of the error ``constant * dt**expected``.
        solved: whether the equations of implicit steps were solved; one truth, or one per step
            size. Those that were not are left out as unsolved.

    Raises:
        InputError: step sizes are not positive and different, there are more or fewer errors
            than step sizes, or there is a constant without an order.

    Examples:
        >>> from ropeode import observed_order
        >>> observed_order([0.1, 0.05, 0.025], [1e-2, 2.5e-3, 6.25e-4]).verdict
        'converges'
        >>> observed_order([0.1, 0.05], [1e-2, 2.5e-3]).why
        '2 of 2 step sizes can be used, 3 are needed'
    """
    dt = real_array("dts", dts, "[0.1, 0.05, 0.025]")
    rest = {"errors": errors, "resolution": resolution, "rounding": rounding}
    orders = {"claimed": claimed, "expected": expected, "constant": constant}
    for name, value in {**rest, **orders, "motion": motion, "solved": solved}.items():
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
    if constant is not None and not (expected and 0.0 < constant < np.inf):
        fix = "give theory's order as expected, or leave it out"
        raise bad_value("constant", constant, "a number > 0, beside an expected order > 0", fix)

    reasons = np.full(len(dt), "", dtype=object)
    with np.errstate(invalid="ignore", over="ignore"):
        reasons[error < _ROUND_OFF_FACTOR * np.asarray(rounding)] = ROUND_OFF
        reasons[(error < np.asarray(resolution)) | (error == 0)] = UNRESOLVED
        reasons[~(error <= UNSTABLE_FROM * motion) | ~np.isfinite(error)] = UNSTABLE
        reasons[~np.broadcast_to(np.asarray(solved, bool), dt.shape)] = UNSOLVED

    usable = [i for i in np.argsort(dt) if not reasons[i]]
    line = None
    if constant and expected and usable:
        line = _Line(expected, dt[usable], error[usable] / (constant * dt[usable] ** expected))
    if line is not None and line.is_reached:
        return _measured(dt, error, reasons, expected)
    order, known = _measured(dt, error, reasons, claimed), expected or claimed
    if line is not None:
        return line.judged(order)
    if not known or order.ci95 is None or _is_evidence(*order.ci95, known):
        return order
    low, high = order.ci95
    if low <= known <= high if expected else not order.refutes(known):
        return order
    return order.withheld(f"{order.slope_words}, too wide to refute order {known}")


def _measured(
    dt: np.ndarray, error: np.ndarray, reasons: np.ndarray, claimed: int | None
) -> ObservedOrder:
    """The order from errors alone, some of which are left out for reasons."""
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


class _Line(NamedTuple):
    """The errors by theory, ``constant * dt**order``.

    Fields:
        order: by theory.
        dts: step sizes, from fine to coarse.
        ratios: of the errors to those by theory.
    """

    order: int
    dts: np.ndarray
    ratios: np.ndarray

    @property
    def is_reached(self) -> bool:
        """Whether the finest errors agree with theory."""
        agree = np.logical_and.accumulate(np.abs(self.ratios - 1.0) <= AGREE)
        return bool(np.any(agree)) and self.dts[agree][-1] > _LASTING * self.dts[0]

    def judged(self, order: ObservedOrder) -> ObservedOrder:
        """An order that was observed before errors have reached the line."""
        apart = np.abs(self.ratios - 1.0)
        used = np.isin(self.dts, order.used)
        away = np.any(used) and np.all(np.diff(apart[used]) < 0.0)
        if away and self.dts[used][-1] > _SPAN * self.dts[used][0]:
            return order
        if order.ci95 is not None and order.ci95[0] <= self.order <= order.ci95[1]:
            return order
        theory = f"theory says order {self.order}"
        if len(apart) == 1 or np.any(np.diff(apart[:3]) <= 0.0):
            # Of a single run nobody knows.
            theory += ", but finer steps come no closer to its error" if len(apart) > 1 else ""
        elif apart[0] > AGREE:
            # The next term of the error has one more power of dt.
            from_here = self.dts[0] * AGREE / apart[0]
            theory = f"not yet asymptotic: {theory} from about dt = {from_here:.1g} on"
        else:
            theory = f"not yet asymptotic: {theory}"
        if order.ci95 is None:
            return dataclasses.replace(order, why=f"{order.why}; {theory}")
        return order.withheld(f"{order.slope_words}; {theory}")


def _is_evidence(low: float, high: float, order: int) -> bool:
    """Whether an interval that excludes an order is evidence against it."""
    width, narrow = high - low, _WIDE if _whole_orders(low, high) else _FRACTIONAL
    # Errors that are as large as they can get fall more slowly than with order 1, or swing; before
    # they are asymptotic many fall too quickly. What grows is held against errors that stay.
    falling = high >= 1.0 or low >= _LEAST_ORDER
    return width <= max(narrow, _FAR * (order - high if falling else -high))


def _enough(local: np.ndarray) -> int:
    """How many points on a line show an order; local slopes from its coarse end to the rest."""
    return _ENOUGH_BROKEN if abs(local[1] - local[0]) > _BREAK else _ENOUGH


def _scatters(local: np.ndarray) -> bool:
    """Whether local slopes rise and fall by turns."""
    changes = np.diff(local)
    turns = changes[1:] * changes[:-1] < 0.0
    return len(turns) > 1 and bool(np.mean(turns) > 0.5)


def _whole_orders(low: float, high: float) -> range:
    """The whole orders inside an interval."""
    return range(max(math.ceil(low), 0), math.floor(high) + 1)


def _decides(low: float, high: float, claimed: int | None) -> bool:
    """Whether an interval decides what the order is, or whether it is the claimed one at least."""
    if claimed is None:
        orders = len(_whole_orders(low, high))
        return low > 0 and (orders == 1 or (orders == 0 and high - low <= _NARROW_ORDER))
    return high < claimed - ORDER_TOLERANCE or low > claimed - 1


def _orders_in(low: float, high: float) -> str:
    if not _whole_orders(low, high):
        return "no whole order"
    first, *others = _whole_orders(low, high)
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
