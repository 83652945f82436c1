"""When references of float64 solvers lose their digits, and what it takes to keep them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Literal

import numpy as np
from scipy import special

from ropeode.analysis.lyapunov import LyapunovExponent, lyapunov_exponent, mean_slope
from ropeode.errors import InputError, ReferenceRefused
from ropeode.norms import distance
from ropeode.precision import in_float64
from ropeode.problems.problem import Problem
from ropeode.references.certificate import Role, largest_norms, padded
from ropeode.references.extended.library import heyoka
from ropeode.references.extended.solution import ExtendedSolution, extended_solution
from ropeode.references.reference import Reference, reference
from ropeode.references.solvers.solution import Solution
from ropeode.references.witnesses import witness_runs
from ropeode.validation import check_positive, complaint

SPANS = (100.0, 300.0, 1000.0)
DIGITS = 18
TIME_LIMIT = 60.0
# Of float64, to whole digits.
FLOAT64_DIGITS = 16
_FLOAT64_BITS = 53
# Digits of rounding that growth must rise above, and digits left where it has ended.
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
Progress = Callable[[str, float], None]


@dataclasses.dataclass(frozen=True, eq=False)
class Run:
    """How far one run is from the truth.

    Arguments:
        solver: library and solver.
        tolerance: its relative tolerance.
        role: `reference`, or what it was to the reference.
        steps: that it made.
        errors: distance from the truth at each sample, in the units of the first quantity;
            infinite where it did not arrive, ``(times,)``.
    """

    solver: str
    tolerance: float
    role: Literal["reference"] | Role
    steps: int
    errors: np.ndarray


@dataclasses.dataclass(frozen=True)
class DigitsLeft:
    """When so many digits were left for the last time.

    Arguments:
        digits: an error of at most 10 to the minus this of the largest component.
        reference: the first sample time at which the reference's error is larger; None if
            it never is.
        luckiest: the same of the run that kept these digits longest, which is known in
            hindsight only.
        certificate: the same of the reference's estimated bound.
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
        rate: per time unit; of algebraic growth the power of time.
        interval: of 95% for the mean over these samples, by batch means.
        start: the first time that was used.
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
        lost: digits that are lost on the way.
        digits: of working precision, so that the digits asked for are left at the end.
        interval: of 95% for `digits`, where they are predicted.
        bits: the upper end of the interval, in bits.
        measured: two runs in extended precision went there; else it is predicted.
    """

    span: float
    lost: float
    digits: float
    interval: tuple[float, float]
    bits: int
    measured: bool


@dataclasses.dataclass(frozen=True, eq=False)
class Horizon:
    """What became of the digits of float64 solvers, and what more would take.

    Arguments:
        problem: what was solved.
        reference: of level `consensus`, which is judged here.
        truth: from runs in extended precision.
        times: sample times at which the truth is known, ``(times,)``.
        size: the largest component of the problem's first quantity; errors relative to it
            count digits.
        runs: the reference and its witnesses.
        lost: digits that extended precision has lost up to each sample, ``(times,)``. It
            does not saturate, and does not depend on the precision.
        digits_left: for 15, 14, ... digits, as far as any time is to be told.
        float64_growth: of the differences of all float64 runs but the looser ones; None where
            they do not grow by a digit inside the range where growth can be seen.
        extended_growth: of the differences of the runs in extended precision.
        exponent: the largest Lyapunov exponent, over the longest span.
        digits: asked for at the end of each span.
        needs: for each span.
    """

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


@in_float64
def horizon(
    problem: Problem,
    spans: Sequence[float] = SPANS,
    *,
    digits: int = DIGITS,
    time_limit: float = TIME_LIMIT,
    accuracy: float | None = None,
    rtol: float | None = None,
    progress: Progress = lambda text, fraction: None,
) -> Horizon:
    """Hold a reference and each of its witnesses against a solution in extended precision.

    Digits are counted against the largest component of the first quantity. What a span needs
    is measured up to the end of the truth, as what the coarser of two extended runs has lost.
    From there on it is predicted: by the growth of tangents, integrated in float64 along
    four solutions that part from the true one, and from each other, past their own horizons.

    Arguments:
        problem: what to solve.
        spans: from the start, in units of time, for which the working precision is wished.
            Past the problem's last sample it goes on with frames of the same mean length, at
            most 10 000.
        digits: that are to be left at the end of each span, and to which the two runs in
            extended precision are to agree.
        time_limit: seconds for the runs in extended precision.
        accuracy: of the reference, as for `ropeode.reference`.
        rtol: of the reference, as for `ropeode.reference`.
        progress: called with what is being done and the fraction that is done.

    Raises:
        InputError: one line for each argument that cannot be used; the right-hand side cannot
            be translated, or heyoka is missing.
        ReferenceRefused: there is no reference, or no truth, or the two contradict each other.
    """
    wished = check_spans(problem, spans)
    heyoka()
    known = reference(problem, accuracy, rtol, progress=lambda text: progress(text, 0.0))
    truth = extended_solution(
        problem, digits=digits, time_limit=time_limit, progress=lambda text: progress(text, 0.2)
    )
    if truth.agreed < 2:
        raise ReferenceRefused(f"no truth for {problem.name!r}: {truth.failure}.")
    times = problem.ts[: truth.agreed]
    quantity, norm = next(iter(largest_norms(problem).items()))
    exact = truth.states[: truth.agreed]
    size = float(np.max(np.abs(problem.quantity(quantity, exact)))) or 1.0

    def run(found: Solution, role: Literal["reference"] | Role) -> Run:
        errors = padded(distance(problem, norm, found.states[: len(times)], exact), problem)
        return Run(found.solver, found.rtol, role, found.steps, errors[: len(times)])

    made = known.certificate
    primary = Solution(made.solver, made.rtol, made.atol, known.states, made.steps, 0.0)
    runs = [run(primary, "reference")]
    for role, found in witness_runs(known, lambda text: progress(text, 0.6)):
        runs.append(run(found, role))
    _check_agreement(known, truth, runs[0])

    lost = _lost(truth, truth.differences[quantity][: truth.agreed], size)
    longest = _longer(problem, max(wished))
    exponents = []
    for index, tolerance in enumerate(_TANGENT_RTOLS):
        progress("tangents", 0.7 + 0.3 * index / len(_TANGENT_RTOLS))
        exponents.append(lyapunov_exponent(longest, tangents=2, rtol=tolerance))
    return Horizon(
        problem=problem,
        reference=known,
        truth=truth,
        times=times,
        size=size,
        runs=tuple(runs),
        lost=lost,
        digits_left=_digits_left(times, size, runs, made.bounds[quantity][: len(times)]),
        float64_growth=_growth(times, _float64_lost(runs, size), FLOAT64_DIGITS - _SATURATED),
        extended_growth=_growth(times, lost, np.inf),
        exponent=exponents[0],
        digits=digits,
        needs=tuple(_need(span, digits, times, lost, exponents) for span in wished),
    )


def check_spans(problem: Problem, spans: Sequence[float]) -> tuple[float, ...]:
    """Spans as sorted numbers.

    Raises:
        InputError: one line for each that is no positive number, or takes too many frames.
    """
    frame = float(problem.ts[-1] - problem.ts[0]) / problem.frames
    most = _FRAMES_AT_MOST * frame
    found, faults = [], []
    for span in spans:
        try:
            found.append(check_positive("spans", span, example="100,300"))
        except InputError as error:
            faults += error.problems
            continue
        if found[-1] > most:
            allowed = f"at most {most:g}, which is {_FRAMES_AT_MOST} frames"
            faults.append(complaint("spans", span, allowed, f"for example spans={most:g}"))
    if not spans:
        faults.append(complaint("spans", list(spans), "one or more", "for example spans=100,300"))
    if faults:
        raise InputError(faults)
    return tuple(sorted(set(found)))


def _check_agreement(known: Reference, truth: ExtendedSolution, primary: Run) -> None:
    """Raises:
    ReferenceRefused: inside the horizon the two are further apart than their bounds allow.
    """
    problem = known.problem
    quantity = problem.quantities[0]
    inside = min(known.trusted, truth.agreed)
    allowed = known.certificate.bounds[quantity][:inside] + truth.bounds[quantity][:inside]
    outside = primary.errors[:inside] > allowed
    if np.any(outside):
        raise ReferenceRefused(
            f"no truth for {problem.name!r}: from t = {problem.ts[np.argmax(outside)]:g} on the "
            "runs in extended precision and those in float64 are further apart than their bounds "
            "allow. One of them has stepped over something: declare jump times, or sample where "
            "the right-hand side changes fast."
        )


def _lost(truth: ExtendedSolution, apart: np.ndarray, size: float) -> np.ndarray:
    """Digits that the coarser run has lost up to each sample, by the finer one."""
    precision = truth.coarse.precision * math.log10(2)
    with np.errstate(divide="ignore"):
        relative = np.log10(np.maximum.accumulate(apart) / size)
    return np.maximum(precision + relative, 0.0)


def _float64_lost(runs: Sequence[Run], size: float) -> np.ndarray:
    """Digits that float64 runs have lost at each sample, in their geometric mean."""
    with np.errstate(divide="ignore"):
        digits = [np.log10(run.errors / size) for run in runs if run.role != "looser"]
    return _FLOAT64_BITS * math.log10(2) + np.mean(digits, axis=0)


def _digits_left(
    times: np.ndarray, size: float, runs: Sequence[Run], bound: np.ndarray
) -> tuple[DigitsLeft, ...]:
    def first(errors: np.ndarray, digits: int) -> float | None:
        above = errors > size * 10.0**-digits
        return float(times[np.argmax(above)]) if np.any(above) else None

    found = []
    for digits in range(FLOAT64_DIGITS - 1, -1, -1):
        each = [first(run.errors, digits) for run in runs]
        kept = None if None in each else max(time for time in each if time is not None)
        found.append(DigitsLeft(digits, each[0], kept, first(bound, digits)))
    return tuple(
        each for each in found if (each.reference, each.luckiest, each.certificate) != (None,) * 3
    )


def _growth(times: np.ndarray, lost: np.ndarray, most: float) -> Growth | None:
    """The growth of what has lost so many digits, between rounding and saturation."""
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
    """The problem with frames of the same mean length up to a span, if that is longer."""
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
    """What one span needs: by the digits lost in extended precision, and the tangents' growth."""
    since = times - times[0]
    if span <= since[-1]:
        gone = float(np.interp(span, since, lost))
        return _need_of(span, digits, gone, 0.0, measured=True)
    # Both follow the same solution as far as it is known: what they differ by is rounding.
    half = since[len(since) // 2 :]
    grown = np.array([_digits_grown(each, np.append(half, span)) for each in exponents])
    rounding = lost[len(since) // 2 :] - np.mean(grown[:, :-1], axis=0)
    # Where one more sample, one more solution and one more run may lie among these.
    spread = math.hypot(_prediction(rounding), _prediction(grown[:, -1]), _CHANCE)
    # The rounding of later steps adds up on top: between not at all and all in one direction.
    added = math.log10(span / since[-1]) / 2
    gone = float(np.mean(grown[:, -1]) + np.mean(rounding)) + added
    return _need_of(span, digits, gone, math.hypot(spread, added), measured=False)


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
    # Where it did not get so far, its mean rate goes on.
    beyond = np.maximum(spans - since[-1], 0.0) * max(exponent.value, 0.0)
    return (np.interp(spans, since, log_growth) + beyond) / math.log(10)


def _need_of(span: float, digits: int, gone: float, half: float, *, measured: bool) -> Need:
    low, high = digits + max(gone - half, 0.0), digits + gone + half
    return Need(
        span=span,
        lost=gone,
        digits=digits + gone,
        interval=(low, high),
        bits=math.ceil(high / math.log10(2)),
        measured=measured,
    )
