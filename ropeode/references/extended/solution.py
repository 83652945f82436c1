"""Solutions beyond float64, from two runs that do not share their rounding."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ropeode.json_form import json_shows
from ropeode.problems import Problem
from ropeode.progress import Progress, silent
from ropeode.references.certificate import SAFETY_FACTOR, distances, smallest
from ropeode.references.extended.taylor import ExtendedRun, solve
from ropeode.references.solvers.solution import Stopwatch
from ropeode.references.witnesses import neighbour
from ropeode.validation import check_positive, check_whole

# The finer run of a pair has so many bits more, and a tolerance that is finer by as much.
_BITS_APART = 24
# Bits that the first pair has beyond the digits, enough for problems that lose little.
_BITS_TO_SPARE = 20
_FLOAT64 = 53
# Of the time that is left, for the finer run of a pair; the other one gets as far in the rest.
_SHARE = 0.55
_MOST_BITS = 1000
# Where the runs are further apart than this, relative to the state, the growth has ended.
_SATURATED = 1e-3


@json_shows("bits", "failure", "seconds")
@dataclasses.dataclass(frozen=True, eq=False)
class ExtendedSolution:
    """States accurate to about float64's own rounding, with their error bounds.

    Arguments:
        states: ``(times, *state)`` at the sample times that both runs reached: those of the
            finer run, each number rounded to the nearest float64.
        bounds: for each quantity, an estimated bound of the error of `states` in the norm of
            the largest node, up to each sample: half a unit in the last place of each
            component, plus three times the difference of the two runs.
        differences: of the two runs, for each quantity at each sample.
        agreed: how many leading samples have the requested digits.
        coarse: the run with fewer bits and a looser tolerance.
        fine: the other one.
        seconds: for all runs, those with too few digits included.
        failure: why later samples do not have the requested digits; None if all have them.
    """

    states: np.ndarray
    bounds: Mapping[str, np.ndarray]
    differences: Mapping[str, np.ndarray]
    agreed: int
    coarse: ExtendedRun
    fine: ExtendedRun
    seconds: float = dataclasses.field(compare=False)
    failure: str | None

    @property
    def bits(self) -> tuple[int, int]:
        """The working precision of the coarser and of the finer run."""
        return self.coarse.precision, self.fine.precision


def extended_solution(
    problem: Problem,
    *,
    digits: int = 18,
    time_limit: float = 60.0,
    progress: Progress = silent,
) -> ExtendedSolution:
    """Solve twice in extended precision, with more and more bits until the two runs agree.

    The precisions of the two runs differ by 24 bits, and their tolerances likewise. The coarser
    one starts from the neighbour of the initial state, a unit in the last place of its numbers
    away, so that an unstable balance does not agree with itself. If the runs do not agree to the
    requested digits, the loss shows how many bits the next pair needs.

    Arguments:
        problem: what to solve.
        digits: three times the difference of the runs is at most 10 to the minus `digits` of
            the quantity's largest component; float64 itself has 16.
        time_limit: seconds for all runs together, by `Stopwatch`; a run that exceeds them is cut
            off.
        progress: called before each run, with what it is.

    Raises:
        InputError: an argument cannot be used, the right-hand side cannot be translated, or
            heyoka is missing.
    """
    digits = check_whole("digits", digits, at_least=1, example="18")
    time_limit = check_positive("time_limit", time_limit, example="60")
    watch = Stopwatch()

    def run(precision: int, share: float, **options: Any) -> ExtendedRun:
        left = share * max(time_limit - watch.seconds, 0.0)
        return solve(problem, precision=precision, time_limit=left, progress=progress, **options)

    bits = max(math.ceil(digits * math.log2(10)) + _BITS_TO_SPARE, _FLOAT64)
    best: _Pair | None = None
    while True:
        fine = run(bits + _BITS_APART, _SHARE, looked_into=True)
        moved = neighbour(problem, fine.rounded) - problem.y0
        coarse = run(bits, 1.0, shift=2.0 ** (_FLOAT64 - bits) * moved)
        pair = _Pair(problem, digits, coarse, fine)
        if best is None or pair.agreed >= best.agreed:
            best = pair
        bits = pair.bits_needed()
        out_of_time = watch.seconds >= time_limit
        if pair.agreed == pair.reached or out_of_time or bits > _MOST_BITS:
            break
    return best.solution(watch.seconds, out_of_time)


class _Pair:
    """Two runs and their difference."""

    def __init__(self, problem: Problem, digits: int, coarse: ExtendedRun, fine: ExtendedRun):
        self.problem, self.digits, self.coarse, self.fine = problem, digits, coarse, fine
        self.reached = min(self.coarse.reached, self.fine.reached)
        self.states = self.fine.rounded[: self.reached]
        difference = self.coarse.states[: self.reached] - self.fine.states[: self.reached]
        self.differences = _sizes(problem, difference.astype(np.float64))
        relative = [
            SAFETY_FACTOR * self.differences[quantity] / size
            for quantity, size in self._largest().items()
        ]
        self.relative = np.maximum.accumulate(np.max(relative, axis=0))
        self.agreed = int(np.sum(self.relative <= 10.0**-digits))

    def _largest(self) -> dict[str, float]:
        """The largest component of each quantity; 1 where nothing moves."""
        largest = {
            quantity: float(np.max(np.abs(self.problem.quantity(quantity, self.states))))
            for quantity in self.problem.quantities
        }
        return {quantity: size or 1.0 for quantity, size in largest.items()}

    def bits_needed(self) -> int:
        """The precision at which a coarse run would agree to the end, by the loss of this one."""
        span = self.problem.ts - self.problem.ts[0]
        last = int(np.max(np.flatnonzero(self.relative < _SATURATED), initial=0))
        if last == 0:
            return 2 * self.fine.precision
        lost = self.coarse.precision + math.log2(max(self.relative[last], 1e-300))
        # Errors that grow exponentially take the same number of bits in each frame.
        lost *= span[self.reached - 1] / span[last]
        needed = math.ceil(self.digits * math.log2(10) + 1.1 * max(lost, 0.0)) + 8
        return max(needed, self.fine.precision)

    def solution(self, seconds: float, out_of_time: bool) -> ExtendedSolution:
        """The result of the pair."""
        rounding = _sizes(self.problem, np.spacing(np.abs(self.states)) / 2)
        return ExtendedSolution(
            states=self.states,
            bounds={
                quantity: np.maximum.accumulate(
                    rounding[quantity]
                    + SAFETY_FACTOR * self.differences[quantity]
                    + smallest(self.problem, quantity)
                )
                for quantity in self.problem.quantities
            },
            differences=self.differences,
            agreed=self.agreed,
            coarse=self.coarse,
            fine=self.fine,
            seconds=seconds,
            failure=self._failure(out_of_time),
        )

    def _failure(self, out_of_time: bool) -> str | None:
        if self.agreed == len(self.problem.ts):
            return None
        if self.agreed == self.reached:
            return self.fine.failure or self.coarse.failure
        why = "time ran out" if out_of_time else f"more than {_MOST_BITS} bits would be needed"
        return (
            f"{self.digits} digits are not reached from t = {self.problem.ts[self.agreed]:g} on: "
            f"{why}"
        )


def _sizes(problem: Problem, differences: np.ndarray) -> dict[str, np.ndarray]:
    """The size of differences of states, in the norm of the largest node of each quantity."""
    return distances(problem, differences, np.zeros_like(differences))
