"""How far a right-hand side is, between the ends of steps, from what is smooth.

A solver looks at the right-hand side at a dozen times in each step, and takes it for a polynomial
between them. Here it is evaluated at many more times, and compared with the polynomial through its
values at the Chebyshev nodes of the step: inside a step a smooth one is that polynomial, to
rounding.

What acts only while the state is in some place is met only by a path that passes there. The
solution between two ends of a step begins as the polynomial through the states and slopes, and is
improved until it is nearer to the solution than it moves from one time to the next: the right-hand
side at the nodes, integrated, is the next path (Picard's iteration). Where a problem is stiff these
grow apart, and the first one is kept; its steps are short. The defect y' - f would show the error
of the path, above all there, instead of what is not smooth.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.polynomial import chebyshev

from ropeode.problems import Problem, PythonRhs
from ropeode.references.solvers.family import Family, abstract
from ropeode.references.solvers.solution import Path
from ropeode.references.solvers.solver import SCIPY_DOP853

# The numbers that an evaluation of all times takes and gives: more times where a state is small.
_NUMBERS, _MOST_NUMBERS = 2**23, 2**26
_FEWEST_TIMES, _MOST_TIMES = 2**17, 2**20
# A right-hand side in Python takes a hundred times as long.
_TIMES_IN_PYTHON, _ROWS_IN_PYTHON = 2**14, 16
# Times are evaluated in rows, each inside one step, and so many numbers at once.
_ROW = 32
_BLOCK_NUMBERS = 2**17
_MOST_ROWS = 1024
# At order 16 a step of three radians is a polynomial to rounding; an accurate one takes half a
# radian.
_NODES = 16
# Of the path in a step. At a step of a radian it is within 1e-10 of the solution.
_DEGREE = 8
# The path may be off by so much of the way from one time to the next. Where a number turns around,
# its way is a part of the longest in the step.
_OFF, _TURNING = 1 / 16, 1 / 16
_MOST_ROUNDS = 12
# The last coefficients of a series, which are small if it is the right-hand side.
_TAIL = 4
_TRIPLES = np.array([0.127, 0.311, 0.487, 0.693, 0.871])
# Of a step: how far the times of a triple are apart. What is smooth is straight there.
_APART = 2.0**-26
# What is within so many times the noise, or units of rounding, is nothing.
_NOISE, _ROUNDING = 30.0, 64.0
_EPS = float(np.finfo(np.float64).eps)
_TINY = float(np.finfo(np.float64).tiny)
# Steps in which it is looked within rounding errors, and how far these are doubled.
_BENT_STEPS, _MOST_DOUBLINGS = 64, 6.0
# A step of fewer floating-point numbers is not looked into.
_SHORTEST = 4096
# What all findings together may add to a number of the state: units of its rounding, or so much of
# the bound. The least size is that of a part of the largest number.
_ROUNDINGS, _SHARE, _SMALLEST = 4.0, 0.03, 1e-6
GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0


@dataclasses.dataclass(frozen=True, eq=False)
class Block:
    """What was found in some steps.

    Arguments:
        share: what they may add to a number of the state, in units of what is negligible,
            ``(steps,)``.
        step: the index of the step of each time at which something was found.
        t: that time.
        size: how large it is there.
        bend: how far values of the right-hand side are from a straight line within rounding errors
            of its arguments, ``(steps, numbers)``; 0 for the velocities of `Sampler`.
        largest: its largest values, likewise.
    """

    share: np.ndarray
    step: np.ndarray
    t: np.ndarray
    size: np.ndarray
    bend: np.ndarray
    largest: np.ndarray


class Sampler:
    """Times inside the steps of a run, and the right-hand side there.

    So many times are spread evenly over the span, and in each step there are at least half as
    many as if they were spread evenly over the steps.

    The first half of a mechanical problem's right-hand side is the velocities themselves. Along
    the path these are polynomials, whatever the problem does, so that only the accelerations
    are looked at.

    Arguments:
        problem: what was solved.
        path: the run's steps.
        bounds: the estimated error bound of each quantity at each sample, which decides on what
            is too small to matter.
    """

    def __init__(self, problem: Problem, path: Path, bounds: Mapping[str, np.ndarray]):
        self._leaves = jax.device_put(jax.tree.leaves(problem.args))
        self._path = path
        self._ts, self._bounds = problem.ts, bounds
        numbers = path.states.shape[1]
        many = min(_MOST_TIMES, _NUMBERS // numbers)
        many = max(many, min(_FEWEST_TIMES, _MOST_NUMBERS // numbers))
        self._rows = min(_MOST_ROWS, max(2, _BLOCK_NUMBERS // (_ROW * numbers)))
        if isinstance(problem.rhs, PythonRhs):
            many, self._rows = _TIMES_IN_PYTHON, _ROWS_IN_PYTHON
        family = dataclasses.replace(Family.of(problem, SCIPY_DOP853, 1), jumps=0)
        # The first number of the right-hand side that is looked at.
        self._first = 0 if problem.mechanics is None else numbers // 2
        self._values = _compiled(family, self._rows, self._first)
        self._length = np.diff(path.times)
        steps, span = len(self._length), path.times[-1] - path.times[0]
        wanted = np.maximum(many * self._length / span, many / (2 * steps))
        # Rows of each step.
        self.parts = np.ceil(wanted / _ROW).astype(int)
        # Never on an end of a step, which may be a jump time.
        self.low = np.nextafter(path.times[:-1], np.inf)
        self.high = np.nextafter(path.times[1:], -np.inf)
        # Floating-point numbers in each step.
        self._numbers_in = self._length / np.spacing(np.max(np.abs(path.times)))
        self._looked_into = self._numbers_in > _SHORTEST
        inside = np.where(self._looked_into, self.parts * _ROW, 1)
        self.spacing = self._length / inside
        self.times = int(np.sum(inside))
        self._every = max(1, steps // _BENT_STEPS)
        self._last_bent = np.zeros((1, numbers - self._first))

    def blocks(self) -> Iterator[Block]:
        """The findings of all steps, some at a time."""
        largest = np.zeros(self._path.states.shape[1])
        for first in range(0, len(self._length), self._rows - 1):
            steps = np.arange(first, min(first + self._rows - 1, len(self._length)))
            sizes = np.abs(self._path.states[first : steps[-1] + 2])
            sizes = np.maximum(np.maximum.accumulate(sizes), largest)
            largest = sizes[-1]
            yield self._look_into(steps, self._negligible(steps, sizes[1:]))

    def _negligible(self, steps: np.ndarray, sizes: np.ndarray) -> np.ndarray:
        """What matters to none of the numbers of a state, ``(steps, numbers)``.

        Arguments:
            steps: by index.
            sizes: the largest of each number up to the end of each step.
        """
        # Of the sample before: what is missed in a frame may grow up to its end.
        frame = np.searchsorted(self._ts, self._path.times[steps], side="right") - 1
        halves = np.split(sizes, len(self._bounds), axis=1)
        allowed = []
        for half, bound in zip(halves, self._bounds.values(), strict=True):
            # Solvers do not resolve what is much smaller than the largest number.
            size = np.maximum(half, _SMALLEST * np.max(half, axis=1, keepdims=True))
            rounding = np.maximum(_ROUNDINGS * _EPS * size, _TINY)
            allowed.append(np.maximum(rounding, _SHARE * bound[frame, None]))
        return np.concatenate(allowed, axis=1)[:, self._first :]

    def _look_into(self, steps: np.ndarray, negligible: np.ndarray) -> Block:
        curves, coefficients, allowed, bend, largest = self._smooth_part(steps)
        found: list[tuple[np.ndarray, ...]] = [(steps[:0], self.low[:0], self.low[:0])]
        rows = np.repeat(np.arange(len(steps)), self.parts[steps])
        part = np.concatenate([np.arange(count) for count in self.parts[steps]])
        added = np.zeros_like(negligible)
        for first in range(0, len(rows), self._rows):
            block = np.arange(first, first + self._rows)
            real, block = block < len(rows), np.minimum(block, len(rows) - 1)
            row = rows[block]
            step = steps[row]
            # The times of a step are evenly spaced; those of the next begin elsewhere.
            phase = (step * GOLDEN + 0.5) % 1.0
            place = (part[block] * _ROW + phase)[:, None] + np.arange(_ROW)
            s = place / (self.parts[step] * _ROW)[:, None]
            t = self._inside(step, s)
            values = self._values(t, s, curves[row], self._leaves)
            smooth = coefficients[row]
            beyond = np.asarray(_beyond(values, smooth, s, allowed[row]))
            beyond = np.flatnonzero(beyond & real & self._looked_into[step])
            if not len(beyond):
                continue
            residual = np.asarray(_residual(values, smooth, s))[beyond].swapaxes(1, 2)
            row, step, t = row[beyond], step[beyond], t[beyond]
            residual = np.where(residual <= allowed[row, None], 0.0, residual)
            residual[np.isnan(residual)] = np.inf
            np.add.at(added, row, np.sum(residual, axis=1) * self.spacing[step, None])
            size = np.max(residual / negligible[row, None], axis=2)
            at = size > 0
            found.append((np.broadcast_to(step[:, None], t.shape)[at], t[at], size[at]))
        share = np.max(added / negligible, axis=1)
        step, t, size = (np.concatenate(each) for each in zip(*found, strict=True))
        order = np.lexsort((t, step))
        before = [(0, 0), (self._first, 0)]
        every = (np.pad(each, before) for each in (bend, largest))
        return Block(share, step[order], t[order], size[order], *every)

    def _smooth_part(self, steps: np.ndarray) -> tuple[np.ndarray, ...]:
        """The polynomials through the values at the nodes, and what is no difference from them.

        Returns:
            The path, ``(steps, powers of s, numbers)``; Chebyshev coefficients, ``(steps, nodes,
            numbers)``, of the numbers that are looked at; the rest is ``(steps, numbers)``: what
            is no difference, and `bend` and `largest` of `Block`.
        """
        # Apart in floating-point numbers as well.
        apart = np.maximum(_APART, 4.0 / self._numbers_in[steps])[:, None, None]
        triples = _TRIPLES[:, None] + apart * np.array([-1.0, 0.0, 1.0])
        s = np.empty((len(steps), _ROW))
        s[:, :_NODES], s[:, _NODES:] = _CHEBYSHEV, 0.5
        s[:, _NODES : _NODES + triples[0].size] = triples.reshape(len(steps), -1)
        t = self._inside(steps, s)
        curves, values = self._along_the_solution(steps, t, s)
        nodes, rest = values[:, :_NODES], slice(_NODES, _NODES + triples[0].size)
        coefficients = np.einsum("kj,ijn->ikn", _TO_COEFFICIENTS, nodes)
        before, at, after = (s[:, rest][:, k::3, None] for k in range(3))
        a, b, c = (values[:, rest][:, k::3] for k in range(3))
        bend = np.max(np.abs(b - a - (at - before) / (after - before) * (c - a)), axis=1)
        # The same from a rounding error away: what differences of large numbers lose.
        nudged = curves.copy()
        draws = np.random.default_rng(steps[0]).normal(size=nudged[:, :3].shape)
        nudged[:, :3] += 2.0 * _EPS * curves[:, :1] * draws
        moved = np.abs(self._evaluate(np.nextafter(t, -np.inf), s, nudged) - values)
        noise = np.maximum(bend, np.max(moved, axis=1))
        largest = np.max(np.abs(nodes), axis=1)
        allowed = _NOISE * noise + _ROUNDING * _EPS * largest
        bent = self._bent(steps, t, s, curves, values)
        return curves, coefficients, allowed, bent, largest

    def _along_the_solution(
        self, steps: np.ndarray, t: np.ndarray, s: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The path, ``(steps, powers of s, numbers)``, and the right-hand side along it.

        Arguments:
            steps: by index.
            t: times in each, those of the nodes first.
            s: the same, as parts of the step.
        """
        curves = self._between_the_ends(steps)
        values = np.array(self._evaluate(t, s, curves))
        off, better = self._improved(steps, curves, values[:, :_NODES])
        going_on = np.flatnonzero(off > 1.0)
        for _ in range(_MOST_ROUNDS):
            if not len(going_on):
                break
            tried = better[going_on]
            found = self._evaluate(t[going_on], s[going_on], tried)
            off_now, next_ones = self._improved(steps[going_on], tried, found[:, :_NODES])
            nearer = off_now < off[going_on]
            kept = going_on[nearer]
            curves[kept], values[kept] = tried[nearer], found[nearer]
            off[kept], better[kept] = off_now[nearer], next_ones[nearer]
            going_on = kept[off[kept] > 1.0]
        return curves, values

    def _between_the_ends(self, steps: np.ndarray) -> np.ndarray:
        """The path through what is known at the ends of steps: states, slopes, accelerations."""
        y, rise = self._path.states[steps], self._path.states[steps + 1] - self._path.states[steps]
        length = self._length[steps, None]
        out, arriving = np.moveaxis(length[:, None] * self._path.slopes[steps], 1, 0)
        curves = np.zeros((len(steps), _DEGREE + 1, y.shape[1]))
        curves[:, :4] = np.stack(
            [y, out, 3 * rise - 2 * out - arriving, out + arriving - 2 * rise], axis=1
        )
        half = self._first
        if half:
            # How far the cubics' second derivatives are off, at the start and at the end.
            square, cube = curves[:, 2, :half], curves[:, 3, :half]
            first = length * out[:, half:] / 2 - square
            last = length * arriving[:, half:] / 2 - square - 3 * cube
            # Both are added as s^2 (1 - s)^2 times a straight line.
            for power, part in zip(range(2, 6), _RIGHT_BEND, strict=True):
                curves[:, power, :half] += part[0] * first + part[1] * last
            powers = np.arange(1.0, 6.0)[:, None]
            curves[:, :5, half:] = powers * curves[:, 1:6, :half] / length[:, None]
        return curves

    def _improved(
        self, steps: np.ndarray, curves: np.ndarray, values: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Paths whose slopes are the right-hand side along others.

        Arguments:
            steps: by index.
            curves: the other paths.
            values: the right-hand side at the nodes along them.

        Returns:
            How far the two are apart, in units of what they may be, ``(steps,)``, and the paths.
            Where the right-hand side is no polynomial, nothing is gained, and they are not apart.
        """
        length, half = self._length[steps, None, None], self._first
        start, end = self._path.states[steps, None], self._path.states[steps + 1, None]
        change = np.empty((len(steps), _NODES, start.shape[2]))
        change[..., half:] = _integrated(length * values, (end - start)[..., half:])
        slopes = values
        if half:
            velocities = start[..., half:] + change[..., half:]
            change[..., :half] = _integrated(length * velocities, (end - start)[..., :half])
            slopes = np.concatenate([velocities, values], axis=2)
        apart = np.abs(change - _POWERS @ curves + start)
        largest = np.maximum(np.abs(start), np.abs(end))
        for quantity in np.split(largest, len(self._bounds), axis=2):
            quantity[...] = np.max(quantity, axis=2, keepdims=True)
        rounding = _ROUNDINGS * _EPS * largest
        allowed = _OFF * self.spacing[steps, None, None] * np.abs(slopes)
        most = np.max(allowed, axis=1, keepdims=True)
        off = np.max(apart / (np.maximum(allowed, _TURNING * most) + rounding), axis=(1, 2))
        tail = np.sum(np.abs(_TO_COEFFICIENTS[-_TAIL:] @ values), axis=1, keepdims=True)
        smooth = length * tail / _NODES <= (most + rounding)[..., half:]
        off = np.where(np.all(smooth, axis=(1, 2)), off, 0.0)
        better = _TO_POWERS @ change
        better[:, 0] += start[:, 0]
        return off, better

    def _bent(
        self,
        steps: np.ndarray,
        t: np.ndarray,
        s: np.ndarray,
        curves: np.ndarray,
        values: np.ndarray,
    ) -> np.ndarray:
        """How far values are from a straight line within a few rounding errors, for each step.

        It is looked at in a few steps, and holds until the next of them.
        """
        some = np.flatnonzero(steps % self._every == 0)
        if len(some):
            draw = np.random.default_rng(steps[0])
            # Of many sizes: what turns around between two floating-point numbers may look still.
            units = 2.0 ** draw.uniform(0.0, _MOST_DOUBLINGS, size=(len(some), 1))
            y = curves[some, 0]
            shift = units * _EPS * y * draw.choice([-1.0, 1.0], y.shape)
            late = units * np.spacing(np.abs(t[some]))
            low, high = self.low[steps[some], None], self.high[steps[some], None]

            def nudged(by: float) -> np.ndarray:
                here = curves[some]
                here[:, 0] += by * shift
                return self._evaluate(np.clip(t[some] + by * late, low, high), s[some], here)

            # Not the largest: a corner or a jump may be near one of the times.
            bent = np.median(np.abs(nudged(1.0) + nudged(-1.0) - 2.0 * values[some]), axis=1)
            bent = np.concatenate([self._last_bent, bent])
            self._last_bent = bent[-1:]
        else:
            bent = self._last_bent
        return bent[np.searchsorted(some, np.arange(len(steps)), side="right")]

    def nodes(self, step: int) -> np.ndarray:
        """The times of the nodes of a step."""
        return self._inside(np.array([step]), _CHEBYSHEV)[0]

    def _inside(self, step: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Times at parts of steps."""
        t = self._path.times[step, None] + s * self._length[step, None]
        return np.clip(t, self.low[step, None], self.high[step, None])

    def _evaluate(self, t: np.ndarray, s: np.ndarray, curves: np.ndarray) -> np.ndarray:
        """The right-hand side on the curves, ``(rows, times, numbers)``."""
        # The last row fills the block up, so that one compilation serves all.
        rows = np.minimum(np.arange(self._rows), len(t) - 1)
        values = self._values(t[rows], s[rows], curves[rows], self._leaves)
        return np.asarray(values)[: len(t)].swapaxes(1, 2)


def _by_powers(series: np.ndarray) -> np.ndarray:
    """A Chebyshev series from 0 to 1, by powers."""
    shifted = np.polynomial.Chebyshev(series, domain=[0.0, 1.0])
    return shifted.convert(kind=np.polynomial.Polynomial).coef


_ANGLES = (np.arange(_NODES) + 0.5) * np.pi / _NODES
_CHEBYSHEV = (1.0 - np.cos(_ANGLES)) / 2.0
# From values at the nodes to the coefficients of the polynomial through them.
_TO_COEFFICIENTS = np.cos(np.outer(np.arange(_NODES), np.pi - _ANGLES)) * 2.0 / _NODES
_TO_COEFFICIENTS[0] /= 2.0
# From values at the nodes to the integrals of the polynomial from 0 to each node, and to 1.
_INTEGRALS = np.stack(
    [
        chebyshev.chebval(2.0 * np.append(_CHEBYSHEV, 1.0) - 1.0, chebyshev.chebint(one, lbnd=-1))
        for one in _TO_COEFFICIENTS.T / 2.0
    ],
    axis=1,
)
_POWERS = _CHEBYSHEV[:, None] ** np.arange(_DEGREE + 1)
_TO_POWERS = np.stack([_by_powers(one[: _DEGREE + 1]) for one in _TO_COEFFICIENTS.T], axis=1)
# The polynomials from 0 to 1 that are 0 at both ends with their slopes, and whose second
# derivatives, halved, are 1 at one end and 0 at the other: coefficients of s^2 to s^5.
_RIGHT_BEND = np.array([[1.0, 0.0], [-3.0, 1.0], [3.0, -2.0], [-1.0, 1.0]])


def _integrated(slopes: np.ndarray, rise: np.ndarray) -> np.ndarray:
    """Integrals to the nodes, and a straight line that brings the last one to what it must be."""
    whole = _INTEGRALS @ slopes
    return whole[:, :-1] + _CHEBYSHEV[:, None] * (rise - whole[:, -1:])


@jax.jit
def _residual(values: Any, coefficients: Any, s: Any) -> Any:
    """How far values are from Chebyshev series at parts of steps, ``(rows, numbers, times)``.

    The polynomials are computed once for all numbers at a time, and then summed, which takes a
    third of the operations of Clenshaw's rule. Not one program with the right-hand side: fused,
    they took several times as long.
    """
    x = 2.0 * s[:, None] - 1.0
    before, last = jnp.ones_like(x), x
    series = coefficients[:, 0, :, None] + coefficients[:, 1, :, None] * x
    for index in range(2, _NODES):
        last, before = 2.0 * x * last - before, last
        series = series + coefficients[:, index, :, None] * last
    return jnp.abs(values - series)


@jax.jit
def _beyond(values: Any, coefficients: Any, s: Any, allowed: Any) -> Any:
    """For each row whether a residual is not within what is allowed.

    A program of its own: XLA would compute residuals that are returned too a second time.
    """
    residual = _residual(values, coefficients, s)
    return jnp.any(~(residual <= allowed[..., None]), axis=(1, 2))


@functools.lru_cache(maxsize=64)
def _compiled(family: Family, rows: int, first: int) -> Callable:
    """The right-hand side along polynomials, from a number on: ``(rows, numbers, times)``.

    Times are the last axis, along which processors compute several numbers at once.
    """

    def value(t: Any, s: Any, curve: Any, leaves: Any) -> Any:
        y = curve[_DEGREE]
        for power in reversed(range(_DEGREE)):
            y = curve[power] + s * y
        return family.field(t, y, leaves)[first:]

    row = jax.vmap(value, (0, 0, None, None), out_axes=-1)
    every = jax.vmap(row, (0, 0, 0, None))
    _, leaves, *_ = family.inputs()
    times = abstract((rows, _ROW))
    curves = abstract((rows, _DEGREE + 1, int(np.prod(family.shape))))
    return jax.jit(every).lower(times, times, curves, leaves).compile()
