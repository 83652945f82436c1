"""DOP853 for many problems of one family, each with a step size of its own.

SciPy's solver calls the right-hand side from Python twelve times in each step, which takes much
longer than evaluating it. Here problems stand side by side in lanes, and one call serves them
all. The coefficients are SciPy's, and the step control is that of its solver.
"""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import jax
import numpy as np
from scipy.integrate import DOP853

from ropeode.precision import in_float64
from ropeode.problems import Problem
from ropeode.references.solvers.family import Family, abstract, compiled_once
from ropeode.references.solvers.solution import Path, Solution, finite_samples
from ropeode.references.solvers.solver import OWN_DOP853

# SciPy warns about tolerances below 100 units of rounding and takes that.
TIGHTEST_RTOL = 100 * np.finfo(np.float64).eps
SAFETY, LEAST_FACTOR, LARGEST_FACTOR = 0.9, 0.2, 10.0
# Numbers in all lanes together: with all stages they stay in the processor's cache.
_NUMBERS = 8192
_MOST_LANES = 128
# Problems enter when this part of the lanes is free.
_FREE = 0.25


@in_float64
def solve(
    problems: Sequence[Problem],
    rtols: Sequence[float],
    atols: Sequence[float | np.ndarray],
    *,
    max_steps: Sequence[int],
) -> list[Solution]:
    """Solve problems, each sample time being the end of a step.

    The solution of a problem does not depend on the others, to the last bit: lanes share
    nothing but the call that evaluates the right-hand side for all of them.

    Arguments:
        problems: of one family, without jump times.
        rtols: relative tolerance of each.
        atols: absolute tolerance of each: one number, or an array of the state's shape.
        max_steps: for each, give up after so many steps.

    Returns:
        A solution for each problem. Its seconds are an equal share of the whole.
    """
    if not problems:
        return []
    first = problems[0]
    lanes = _Lanes(first, rtols, atols, max_steps)
    started = time.perf_counter()
    states = np.full((len(problems), len(first.ts), first.y0.size), np.nan)
    waiting = list(range(len(problems)))[::-1]
    with np.errstate(all="ignore"):
        while waiting or np.any(lanes.busy):
            free = np.flatnonzero(~lanes.busy)
            if waiting and len(free) >= _FREE * len(lanes.busy):
                entered = [(lane, waiting.pop()) for lane in free[: len(waiting)]]
                lanes.enter(entered, problems)
                for _, member in entered:
                    states[member, 0] = problems[member].y0.reshape(-1)
            for member, sample, y in lanes.step():
                states[member, sample] = y
    seconds = (time.perf_counter() - started) / len(problems)
    return [
        Solution(
            solver=OWN_DOP853,
            rtol=max(rtol, TIGHTEST_RTOL),
            atol=atol,
            states=own[: finite_samples(own)].reshape(-1, *first.y0.shape),
            steps=lanes.steps[member],
            seconds=seconds,
            compile_seconds=lanes.compile_seconds if member == 0 else 0.0,
            failure=lanes.failures.get(member),
            path=Path.of(first.ts[0], problem.y0.reshape(-1), lanes.taken[member]),
        )
        for member, (problem, rtol, atol, own) in enumerate(
            zip(problems, rtols, atols, states, strict=True)
        )
    ]


class _Lanes:
    """Problems on their way; arrays have a row for each lane.

    Arguments:
        first: a problem of the family.
        rtols: of all problems.
        atols: of all problems.
        max_steps: of all problems.
    """

    def __init__(
        self,
        first: Problem,
        rtols: Sequence[float],
        atols: Sequence[float | np.ndarray],
        max_steps: Sequence[int],
    ):
        count = max(1, min(_MOST_LANES, _NUMBERS // first.y0.size))
        family = Family.of(first, OWN_DOP853, len(first.ts))
        self._rhs, self.compile_seconds = compiled_once(_compiled, family, count)
        self._rtols, self._atols, self._max_steps = rtols, atols, max_steps
        self._ts = first.ts
        leaves = jax.tree.leaves(first.args)
        self._leaves = [np.repeat(leaf[None], count, axis=0) for leaf in leaves]
        self._on_device: Any = self._leaves
        self.steps: dict[int, int] = {}
        self.failures: dict[int, str] = {}
        self.taken: dict[int, list[tuple]] = {}
        self.busy = np.zeros(count, dtype=bool)
        self._member = np.zeros(count, dtype=int)
        self._t = np.full(count, first.ts[0])
        self._y = np.repeat(first.y0.reshape(1, -1), count, axis=0)
        self._slope = np.zeros_like(self._y)
        self._h = np.zeros(count)
        self._rtol, self._atol = np.ones((count, 1)), np.ones_like(self._y)
        self._rejected = np.zeros(count, dtype=bool)
        self._sample = np.ones(count, dtype=int)

    def enter(self, entered: Iterable[tuple[int, int]], problems: Sequence[Problem]) -> None:
        """Start problems in lanes that are free.

        Arguments:
            entered: lanes and indices of problems.
            problems: all.
        """
        new = np.zeros_like(self.busy)
        for lane, member in entered:
            problem, rtol = problems[member], self._rtols[member]
            new[lane], self._member[lane], self.steps[member] = True, member, 0
            self._t[lane], self._sample[lane], self._rejected[lane] = self._ts[0], 1, False
            self._y[lane] = problem.y0.reshape(-1)
            self.taken[member] = []
            self._rtol[lane] = max(rtol, TIGHTEST_RTOL)
            self._atol[lane] = np.broadcast_to(self._atols[member], problem.y0.shape).reshape(-1)
            for rows, leaf in zip(self._leaves, jax.tree.leaves(problem.args), strict=True):
                rows[lane] = leaf
        self._on_device = jax.device_put(self._leaves)
        slope = self._rhs(self._t, self._y, self._on_device)
        h = self._first_steps(slope)
        self._slope = np.where(new[:, None], slope, self._slope)
        self._h = np.where(new, h, self._h)
        self.busy |= new

    def _first_steps(self, slope: np.ndarray) -> np.ndarray:
        """Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, section II.4."""
        longest = self._ts[1] - self._ts[0]
        scale = self._atol + np.abs(self._y) * self._rtol
        size, rate = _norm(self._y / scale), _norm(slope / scale)
        h = np.where((size < 1e-5) | (rate < 1e-5), 1e-6, 0.01 * size / rate)
        h = np.minimum(h, longest)
        there = self._rhs(self._t + h, self._y + h[:, None] * slope, self._on_device)
        bend = _norm((there - slope) / scale) / h
        still = (rate <= 1e-15) & (bend <= 1e-15)
        aimed = np.where(
            still, np.maximum(1e-6, h * 1e-3), _eighth_root(0.01 / np.maximum(rate, bend))
        )
        return np.minimum(np.minimum(100 * h, aimed), longest)

    def step(self) -> list[tuple[int, int, np.ndarray]]:
        """Try one step in each lane.

        Returns:
            For each problem that has come to a sample time its index, that of the sample, and
            its flat state.
        """
        smallest = 10 * (np.nextafter(self._t, np.inf) - self._t)
        stuck = self.busy & self._rejected & (self._h < smallest)
        tried = np.where(self._rejected, self._h, np.maximum(self._h, smallest))
        stop = self._ts[self._sample]
        t_new = np.minimum(self._t + tried, stop)
        h = np.where(self.busy, t_new - self._t, 0.0)
        y_new, slope_new, error = attempt(
            lambda t, y: self._rhs(t, y, self._on_device),
            self._t,
            self._y,
            self._slope,
            h,
            self._rtol,
            self._atol,
        )
        factor = SAFETY / _eighth_root(error)
        # Not so for NaN, which is no error within the tolerance.
        accepted = self.busy & ~stuck & (error < 1)
        growth = np.where(error == 0, LARGEST_FACTOR, np.minimum(LARGEST_FACTOR, factor))
        growth = np.where(self._rejected, np.minimum(1.0, growth), growth)
        shrinkage = np.fmax(LEAST_FACTOR, factor)
        self._h = np.abs(h) * np.where(accepted, growth, shrinkage)
        self._rejected = self.busy & ~accepted
        self._t = np.where(accepted, t_new, self._t)
        self._y = np.where(accepted[:, None], y_new, self._y)
        slope, self._slope = self._slope, np.where(accepted[:, None], slope_new, self._slope)
        arrived = []
        for lane in np.flatnonzero(accepted):
            member = int(self._member[lane])
            self.steps[member] += 1
            y = self._y[lane].copy()
            if not np.all(np.isfinite(y)):
                self._leave(lane, "the state is not finite")
                continue
            self.taken[member].append((self._t[lane], y, slope[lane], slope_new[lane]))
            if self._t[lane] == stop[lane]:
                arrived.append((member, int(self._sample[lane]), y))
                if self._sample[lane] == len(self._ts) - 1:
                    self.busy[lane] = False
                else:
                    self._sample[lane] += 1
            if self.busy[lane] and self.steps[member] >= self._max_steps[member]:
                self._leave(lane, f"{self._max_steps[member]} steps did not suffice")
        for lane in np.flatnonzero(stuck):
            self._leave(lane, "the step size has become too small")
        return arrived

    def _leave(self, lane: Any, reason: str) -> None:
        self.busy[lane] = False
        where = f"stopped after t = {self._t[lane]:g}: {reason}"
        self.failures[int(self._member[lane])] = where


def attempt(
    field: Callable, t: Any, y: Any, slope: Any, h: Any, rtol: Any, atol: Any, xp: Any = np
) -> tuple[Any, Any, Any]:
    """The state and its slope after a step, and the error relative to the tolerance.

    Arguments:
        field: of a time and a state.
        t: the time before the step.
        y: the state there; its last axis counts numbers.
        slope: the field there.
        h: the length of the step.
        rtol: relative tolerance.
        atol: absolute tolerance.
        xp: NumPy, or that of JAX.
    """
    step, stages = h[..., None], [slope]
    for row, node in zip(DOP853.A[1:], DOP853.C[1:], strict=True):
        stages.append(field(t + node * h, y + step * combination(row, stages)))
    y_new = y + step * combination(DOP853.B, stages)
    stages.append(field(t + h, y_new))
    scale = atol + xp.maximum(xp.abs(y), xp.abs(y_new)) * rtol
    fifth = xp.sum((combination(DOP853.E5, stages) / scale) ** 2, axis=-1)
    third = xp.sum((combination(DOP853.E3, stages) / scale) ** 2, axis=-1)
    whole = xp.sqrt((fifth + 0.01 * third) * y.shape[-1])
    error = xp.where((fifth == 0) & (third == 0), 0.0, xp.abs(h) * fifth / whole)
    return y_new, stages[-1], error


def combination(weights: np.ndarray, stages: Sequence[Any]) -> Any:
    """A sum of stages, term by term: what a matrix product rounds depends on its size."""
    terms = [(w, stage) for w, stage in zip(weights, stages, strict=False) if w]
    total = terms[0][0] * terms[0][1]
    for weight, stage in terms[1:]:
        total = total + weight * stage
    return total


def _norm(y: np.ndarray) -> np.ndarray:
    return np.sqrt(np.mean(y * y, axis=1))


def _eighth_root(x: np.ndarray) -> np.ndarray:
    """By square roots, which are rounded alike wherever a number stands in an array."""
    return np.sqrt(np.sqrt(np.sqrt(x)))


@functools.lru_cache(maxsize=64)
def _compiled(family: Family, lanes: int) -> Callable:
    """The right-hand side of all lanes, on flat states."""
    y0, leaves, *_ = family.inputs()
    inputs = jax.tree.map(
        lambda one: abstract((lanes, *one.shape), one.dtype), (abstract(()), y0, leaves)
    )
    compiled = jax.jit(jax.vmap(family.field)).lower(*inputs).compile()
    return lambda t, y, leaves: np.asarray(compiled(t, y, leaves))
