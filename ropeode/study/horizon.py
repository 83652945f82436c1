"""When references of float64 solvers lose their digits, and the precision that keeps them."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Sequence
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy import special

from ropeode.analysis import LyapunovExponent, lyapunov_exponent, mean_slope
from ropeode.display import Tabular
from ropeode.errors import ReferenceRefused
from ropeode.json_form import json_shows
from ropeode.norms import distance
from ropeode.precision import in_float64
from ropeode.problems import Problem, require_problem
from ropeode.progress import Progress, bar, shows_progress
from ropeode.references import (
    DIGITS,
    TIME_LIMIT,
    ExtendedSolution,
    Reference,
    ReferenceOptions,
    Role,
    Solution,
    Solver,
    extended_solution,
    heyoka,
    largest_norms,
    padded,
    reference_and_runs,
)
from ropeode.validation import bad_value, check_all, check_positive, check_whole

HORIZON_SPANS = (100.0, 300.0, 1000.0)
# Of float64, to whole digits.
FLOAT64_DIGITS = 16
_FLOAT64_BITS = 53
# Growth counts above so many digits of rounding, and until so many digits are left.
_ABOVE_ROUNDING, _SATURATED = 2.0, 3.0
_FEWEST_SAMPLES = 10
# What grows less than this is not growth but scatter.
_LEAST_GROWTH = 1.0
# Past the horizon of each, runs at these tolerances follow different solutions.
_TANGENT_RTOLS = (3e-11, 1e-10, 3e-10, 1e-9)
_FRAMES_AT_MOST = 10_000
# The part of a run's first roundings that lies in the growing direction is a matter of chance. If
# it is normal, its log10 has the standard deviation pi/sqrt(8)/ln(10) = 0.48, and those of two runs
# differ by this at 95%.
_CHANCE = 1.96 * math.sqrt(2) * math.pi / math.sqrt(8) / math.log(10)

Law = Literal["exponential", "algebraic"]


@json_shows("solver", "tolerance", "role", "steps", "errors")
@dataclasses.dataclass(frozen=True, eq=False)
class Run:
    """The errors of one run.

    Arguments:
        solver: which one.
        tolerance: its relative tolerance.
        role: `reference`, or its role as a witness.
        steps: how many.
        errors: distance from the truth at each sample, in the units of the first quantity;
            infinite at samples that it did not reach, ``(times,)``.
    """

    solver: Solver
    tolerance: float
    role: Literal["reference"] | Role
    steps: int
    errors: np.ndarray


@dataclasses.dataclass(frozen=True)
class DigitsLeft:
    """The first times at which fewer than a number of digits are left.

    Arguments:
        digits: the number; the error is at most 10 to the minus this of the largest component.
        reference: the first sample time at which the reference's error is larger; None if
            it never is.
        luckiest: the same for the run that kept these digits longest, which only hindsight
            can name.
        certificate: the same for the reference's estimated bound.
    """

    digits: int
    reference: float | None
    luckiest: float | None
    certificate: float | None


@dataclasses.dataclass(frozen=True)
class Growth:
    """How differences grew where they were above rounding and had not saturated.

    Arguments:
        law: `exponential` or `algebraic`, whichever fits their logarithm better.
        rate: per time unit; for algebraic growth, the power of time.
        interval: the 95% interval of the mean over these samples, by batch means.
        start: the first time that counts.
        end: the last one.
    """

    law: Law
    rate: float
    interval: tuple[float, float]
    start: float
    end: float


@dataclasses.dataclass(frozen=True)
class Need:
    """The working precision that a span needs.

    Arguments:
        span: from the start, in units of time.
        lost: digits lost on the way.
        digits: of working precision, so that the requested digits are left at the end.
        interval: the 95% interval of `digits`, where they are predicted.
        bits: the upper end of the interval, in bits.
        measured: two runs in extended precision reached it; otherwise it is predicted.
    """

    span: float
    lost: float
    digits: float
    interval: tuple[float, float]
    bits: int
    measured: bool


@json_shows(
    *("problem", "truth", "digits", "size", "times", "bound", "reference.horizon"),
    "horizon_reason=reference.certificate.horizon_reason",
    "largest_error_over_bound=worst_cover",
    "runs",
    "digits_lost_in_extended_precision=lost",
    *("digits_left", "float64_growth", "extended_growth", "lyapunov_exponent=exponent", "needs"),
)
@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Horizon(Tabular):
    """When float64 solvers lose their digits, and the precision that longer spans need.

    Arguments:
        problem: what was solved.
        reference: of level `consensus`; its errors are measured here.
        truth: from runs in extended precision.
        times: sample times that the truth covers, ``(times,)``.
        size: the largest component of the problem's first quantity; errors relative to it
            count digits.
        runs: the reference and its witnesses.
        lost: digits that extended precision has lost up to each sample, ``(times,)``. The loss
            does not saturate, and does not depend on the precision.
        digits_left: for 15, 14, ... digits, where any run loses them.
        float64_growth: of the differences of all float64 runs but the looser ones; None where
            they grow by less than a digit between rounding and saturation.
        extended_growth: of the differences of the runs in extended precision.
        exponent: the largest Lyapunov exponent, over the longest span.
        digits: requested at the end of each span.
        needs: for each span.

    Examples:
        >>> from ropeode import Rope, horizon
        >>> study = horizon(Rope(num_nodes=4).problem(frames=3), spans=[3.0])
        >>> [(need.span, round(need.digits, 1)) for need in study.needs]
        [(3.0, 18.2)]
    """

    SCHEMA: ClassVar[str] = "ropeode.horizon/2"

    problem: Problem
    reference: Reference
    truth: ExtendedSolution
    times: np.ndarray
    size: float
    runs: tuple[Run, ...]
    lost: np.ndarray
    digits_left: tuple[DigitsLeft, ...]
    float64_growth: Growth | None
    extended_growth: Growth | None
    exponent: LyapunovExponent
    digits: int
    needs: tuple[Need, ...]

    @property
    def bound(self) -> np.ndarray:
        """The certificate's bound at each of `times`, in the units of the errors."""
        quantity = self.problem.quantities[0]
        return self.reference.certificate.bounds[quantity][: len(self.times)]

    @property
    def worst_cover(self) -> float:
        """The largest error of the reference over its bound, inside its trust horizon."""
        inside = slice(1, min(self.reference.trusted, len(self.times)))
        return float(np.max(self.runs[0].errors[inside] / self.bound[inside], initial=0.0))


@shows_progress
@in_float64
def horizon(
    problem: Problem,
    spans: ArrayLike = HORIZON_SPANS,
    *,
    digits: int = DIGITS,
    time_limit: float = TIME_LIMIT,
    accuracy: float | None = None,
    rtol: float | None = None,
    progress: Progress = bar,
) -> Horizon:
    """Compare a reference and each of its witnesses with a solution in extended precision.

    Digits count relative to the largest component of the first quantity. Up to the end of the
    truth, the precision that a span needs is measured by the loss of the coarser of two
    extended runs. Beyond, it is predicted from the growth of tangents, integrated in float64
    along four solutions that leave the true one, and each other, past their own horizons.

    Arguments:
        problem: what to solve.
        spans: spans of time from the start, whose required precision is reported. Past its
            last sample the problem continues with frames of the same mean length, at most
            10 000.
        digits: that must be left at the end of each span, and to which the two runs in
            extended precision must agree.
        time_limit: seconds for the runs in extended precision.
        accuracy: of the reference, as for `ropeode.reference`.
        rtol: of the reference, as for `ropeode.reference`.
        progress: called with the current task and the fraction that is done.

    Raises:
        InputError: one line for each argument that cannot be used; the right-hand side cannot
            be translated, or heyoka is missing.
        ReferenceRefused: there is no reference, or no truth, or the two contradict each other.

    Examples:
        >>> from ropeode import Rope, horizon
        >>> horizon(Rope(num_nodes=4).problem(frames=3), spans=[3.0])
        <Horizon: rope, 4 nodes, damping 0.01, 3 frames; float64 trusted to the end>
    """
    require_problem(problem)
    problem.require_equations()
    spans = check_spans(problem, spans)
    digits = check_whole("digits", digits, at_least=1, example="18")
    time_limit = check_positive("time_limit", time_limit, example="60")
    heyoka()
    options = ReferenceOptions(accuracy=accuracy, rtol=rtol)
    reference, solutions = reference_and_runs(problem, options, lambda text, _: progress(text, 0.0))
    truth = extended_solution(
        problem, digits=digits, time_limit=time_limit, progress=lambda text, _: progress(text, 0.2)
    )
    if truth.agreed < 2:
        raise ReferenceRefused(f"no truth for {problem.name!r}: {truth.failure}.")
    times = problem.ts[: truth.agreed]
    quantity, norm = next(iter(largest_norms(problem).items()))
    exact = truth.states[: truth.agreed]
    size = float(np.max(np.abs(problem.quantity(quantity, exact)))) or 1.0

    def run(solution: Solution, role: Literal["reference"] | Role) -> Run:
        errors = padded(distance(problem, norm, solution.states[: len(times)], exact), problem)
        return Run(solution.solver, solution.rtol, role, solution.steps, errors[: len(times)])

    runs = [run(solution, role) for role, solution in solutions if role != "more digits"]
    _check_agreement(reference, truth, runs[0])

    lost = _lost(truth, truth.differences[quantity][: truth.agreed], size)
    longest = _longer(problem, max(spans))
    exponents = []
    for index, tolerance in enumerate(_TANGENT_RTOLS):
        progress("tangents", 0.7 + 0.3 * index / len(_TANGENT_RTOLS))
        exponents.append(lyapunov_exponent(longest, tangents=2, rtol=tolerance))
    return Horizon(
        problem=problem,
        reference=reference,
        truth=truth,
        times=times,
        size=size,
        runs=tuple(runs),
        lost=lost,
        digits_left=_digits_left(
            times, size, runs, reference.certificate.bounds[quantity][: len(times)]
        ),
        float64_growth=_growth(times, _float64_lost(runs, size), FLOAT64_DIGITS - _SATURATED),
        extended_growth=_growth(times, lost, np.inf),
        exponent=exponents[0],
        digits=digits,
        needs=tuple(_need(span, digits, times, lost, exponents) for span in spans),
    )


def check_spans(problem: Problem, spans: Any) -> tuple[float, ...]:
    """Spans as sorted numbers.

    Raises:
        InputError: one line for each that is not a positive number or takes too many frames.
    """
    frame = float(problem.ts[-1] - problem.ts[0]) / problem.frames
    most = _FRAMES_AT_MOST * frame
    try:
        spans = list(spans)
    except TypeError:
        raise bad_value("spans", spans, "several spans", "for example 100, 300") from None
    if not spans:
        raise bad_value("spans", spans, "one or more", "for example spans=100,300")

    def check(span: Any) -> float:
        number = check_positive("spans", span, example="100,300")
        if number > most:
            allowed = f"at most {most:g}, which is {_FRAMES_AT_MOST} frames"
            raise bad_value("spans", span, allowed, f"for example spans={most:g}")
        return number

    return tuple(sorted(set(check_all(*(functools.partial(check, span) for span in spans)))))


def _check_agreement(reference: Reference, truth: ExtendedSolution, primary: Run) -> None:
    """Raises:
    ReferenceRefused: inside the horizon the two are further apart than their bounds allow.
    """
    problem = reference.problem
    quantity = problem.quantities[0]
    inside = min(reference.trusted, truth.agreed)
    allowed = reference.certificate.bounds[quantity][:inside] + truth.bounds[quantity][:inside]
    outside = primary.errors[:inside] > allowed
    if np.any(outside):
        raise ReferenceRefused(
            f"no truth for {problem.name!r}: from t = {problem.ts[np.argmax(outside)]:g} on the "
            "runs in extended precision and those in float64 are further apart than their bounds "
            "allow. One of them has stepped over something: declare jump times, or sample where "
            "the right-hand side changes fast."
        )


def _lost(truth: ExtendedSolution, differences: np.ndarray, size: float) -> np.ndarray:
    """Digits that the coarser run has lost up to each sample, relative to the finer one."""
    precision = truth.coarse.precision * math.log10(2)
    with np.errstate(divide="ignore"):
        relative = np.log10(np.maximum.accumulate(differences) / size)
    return np.maximum(precision + relative, 0.0)


def _float64_lost(runs: Sequence[Run], size: float) -> np.ndarray:
    """Digits that float64 runs have lost at each sample, by the geometric mean of their errors."""
    with np.errstate(divide="ignore"):
        digits = [np.log10(run.errors / size) for run in runs if run.role != "looser"]
    return _FLOAT64_BITS * math.log10(2) + np.mean(digits, axis=0)


def _digits_left(
    times: np.ndarray, size: float, runs: Sequence[Run], bound: np.ndarray
) -> tuple[DigitsLeft, ...]:
    def first(errors: np.ndarray, digits: int) -> float | None:
        above = errors > size * 10.0**-digits
        return float(times[np.argmax(above)]) if np.any(above) else None

    rows = []
    for digits in range(FLOAT64_DIGITS - 1, -1, -1):
        losses = [first(run.errors, digits) for run in runs]
        lost = [time for time in losses if time is not None]
        luckiest = max(lost) if len(lost) == len(losses) else None
        certificate = first(bound, digits)
        if losses[0] is not None or certificate is not None:
            rows.append(DigitsLeft(digits, losses[0], luckiest, certificate))
    return tuple(rows)


def _growth(times: np.ndarray, lost: np.ndarray, most: float) -> Growth | None:
    """How the loss of digits grows between rounding and saturation."""
    finite = np.flatnonzero(~np.isfinite(lost[1:]) | (lost[1:] > most))
    end = int(finite[0]) + 1 if len(finite) else len(lost)
    low = np.flatnonzero(lost[:end] <= _ABOVE_ROUNDING)
    start = int(low[-1]) + 1 if len(low) else 1
    if end - start < _FEWEST_SAMPLES or lost[end - 1] - lost[start] < _LEAST_GROWTH:
        return None
    since, logs = times[start:end] - times[0], lost[start:end] * math.log(10)
    laws: dict[Law, np.ndarray] = {"exponential": since, "algebraic": np.log(since)}

    def misfit(law: Law) -> float:
        return float(np.polyfit(laws[law], logs, 1, full=True)[1].sum())

    law = min(laws, key=misfit)
    rate, half = mean_slope(laws[law], logs)
    return Growth(law, rate, (rate - half, rate + half), float(times[start]), float(times[end - 1]))


def _longer(problem: Problem, span: float) -> Problem:
    """The problem continued to the end of a span, with frames of the same mean length."""
    start, end = float(problem.ts[0]), float(problem.ts[-1])
    if span <= end - start:
        return problem
    frames = math.ceil(span * problem.frames / (end - start))
    frame = (end - start) / problem.frames
    return dataclasses.replace(problem, ts=start + frame * np.arange(frames + 1), exact=None)


def _need(
    span: float,
    digits: int,
    times: np.ndarray,
    lost: np.ndarray,
    exponents: Sequence[LyapunovExponent],
) -> Need:
    """What one span needs, by the loss of extended precision and the growth of the tangents."""
    since = times - times[0]
    if span <= since[-1]:
        loss = float(np.interp(span, since, lost))
        return _need_of(span, digits, loss, 0.0, measured=True)
    # Both follow the same solution up to here: their difference is rounding.
    half = since[len(since) // 2 :]
    grown = np.array([_digits_grown(each, np.append(half, span)) for each in exponents])
    rounding = lost[len(since) // 2 :] - np.mean(grown[:, :-1], axis=0)
    # The scatter of samples, of solutions and of runs.
    spread = math.hypot(_prediction(rounding), _prediction(grown[:, -1]), _CHANCE)
    # The rounding of later steps adds up: between not at all and all in one direction.
    added = math.log10(span / since[-1]) / 2
    loss = float(np.mean(grown[:, -1]) + np.mean(rounding)) + added
    return _need_of(span, digits, loss, math.hypot(spread, added), measured=False)


def _prediction(values: np.ndarray) -> float:
    """Half the 95% interval for one more value like these."""
    count = len(values)
    if count < 2:
        return 0.0
    quantile = float(special.stdtrit(count - 1, 0.975))
    return quantile * float(np.std(values, ddof=1)) * math.sqrt(1 + 1 / count)


def _digits_grown(exponent: LyapunovExponent, spans: np.ndarray) -> np.ndarray:
    """Digits by which tangents have grown at most up to each span."""
    since = exponent.times - exponent.times[0]
    log_growth = np.maximum.accumulate(np.mean(exponent.log_growth, axis=0))
    # Past its last time, its mean rate continues.
    beyond = np.maximum(spans - since[-1], 0.0) * max(exponent.value, 0.0)
    return (np.interp(spans, since, log_growth) + beyond) / math.log(10)


def _need_of(span: float, digits: int, loss: float, half: float, *, measured: bool) -> Need:
    low, high = digits + max(loss - half, 0.0), digits + loss + half
    return Need(
        span=span,
        lost=loss,
        digits=digits + loss,
        interval=(low, high),
        bits=math.ceil(high / math.log10(2)),
        measured=measured,
    )
