"""A solver in extended precision that shares nothing with the package: the truth in tests.

Gragg-Bulirsch-Stoer extrapolation: the explicit midpoint rule with n steps has an error
expansion in even powers of 1/n, and a weighted sum of its results for several n takes out
the leading ones. Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, section
II.9, equations (9.13) and (9.10). The smoothing step is not needed where all n are even.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any

import numpy as np

Rhs = Callable[[np.ndarray, np.ndarray], np.ndarray]

EPS = np.finfo(np.longdouble).eps
# Longest first. Sequences that grow more slowly need fewer steps in all, but their weights are
# so large that rounding drowns the result: the sum of their sizes is 41 here, 550 for 2, 4, 6, ...
_SUBSTEPS = (34, 28, 22, 18, 14, 10, 8, 6, 4, 2)
# The results for two steps are left out of the second set, whose order is lower by two.
_ORDER_OF_ESTIMATE = 2 * len(_SUBSTEPS) - 2


def _weights(substeps: Sequence[int]) -> np.ndarray:
    """What the midpoint results are multiplied by; computed as fractions, then rounded."""
    weights = []
    for n in substeps:
        weight = Fraction(1)
        for other in substeps:
            if other != n:
                weight *= Fraction(n * n, n * n - other * other)
        weights.append(np.longdouble(weight.numerator) / np.longdouble(weight.denominator))
    return np.array(weights)


_BEST = _weights(_SUBSTEPS)
_ESTIMATE = _BEST - np.append(_weights(_SUBSTEPS[:-1]), 0)


def integrate(f: Rhs, y0: Any, ts: Any, *, sizes: Any = None, rtol: float = 1e-18) -> np.ndarray:
    """The states at `ts` of ``y' = f(t, y)``, ``y(ts[0]) = y0``, in `np.longdouble`.

    Arguments:
        f: right-hand side in NumPy. It is asked for several states at once: ``y`` has the
            shape ``(rows, *state)`` and ``t`` the shape ``(rows, 1, ..., 1)``.
        y0: initial state, with at least one axis.
        ts: increasing sample times; steps end on them.
        sizes: what errors are relative to, broadcasting against `y0`; by default, for each
            ``y[i]``, its largest component in the step. Needed where `f` loses more digits
            than a few, since no step is small enough for an error below rounding.
        rtol: error per step that the next lower order would make.

    Raises:
        ArithmeticError: the step size went to zero.
    """
    y = np.asarray(y0, dtype=np.longdouble)
    ts = np.asarray(ts, dtype=np.longdouble)
    states = [y]
    step = ts[1] - ts[0]
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        for t, end in itertools.pairwise(ts):
            while t < end:
                taken = min(step, end - t)
                increment, estimate = _extrapolated(f, t, y, taken)
                error = _relative(estimate, y, increment, sizes) / rtol
                factor = 0.9 * max(error, 1e-30) ** (-1 / (_ORDER_OF_ESTIMATE + 1))
                if not error <= 1:
                    step = taken * (max(0.1, factor) if np.isfinite(error) else 0.1)
                    if step < 1e-9 * (end - t):
                        raise ArithmeticError(f"no step is small enough at t = {t}")
                    continue
                step = max(step if taken < step else 0, taken * min(2.0, factor))
                y = y + increment
                t = end if t + taken >= end else t + taken
            states.append(y)
    return np.stack(states)


def _extrapolated(
    f: Rhs, t: np.longdouble, y: np.ndarray, step: np.longdouble
) -> tuple[np.ndarray, np.ndarray]:
    """The increment over one step, and how far it is from that of the next lower order.

    All midpoint sequences advance together, one row each. They carry increments instead of
    states, whose rounding errors are smaller. The weights multiply differences, so that
    their own rounding errors do not count.
    """
    column = (-1,) + (1,) * y.ndim
    t = np.reshape(t, (1,) * (y.ndim + 1))
    substep = (step / np.array(_SUBSTEPS, dtype=np.longdouble)).reshape(column)
    results = np.empty((len(_SUBSTEPS), *y.shape), dtype=np.longdouble)
    before, here = np.zeros_like(results), substep * f(t, y[None])
    for i in range(1, _SUBSTEPS[0] + 1):
        active = sum(n > i for n in _SUBSTEPS)
        results[active : len(here)] = here[active:]
        before, here, substep = before[:active], here[:active], substep[:active]
        if active:
            before = before + 2 * substep * f(t + i * substep, y + here)
            before, here = here, before
    apart = results - results[0]
    return results[0] + np.tensordot(_BEST, apart, 1), np.tensordot(_ESTIMATE, apart, 1)


def _relative(error: np.ndarray, y: np.ndarray, increment: np.ndarray, sizes: Any) -> float:
    """The largest error, relative to the sizes."""
    if sizes is None:
        largest = np.maximum(np.abs(y), np.abs(y + increment)).reshape(len(y), -1).max(axis=1)
        sizes = largest.reshape((-1,) + (1,) * (y.ndim - 1))
    error = np.abs(error)
    return float(np.max(np.where(error == 0, 0, error / sizes)))


def rope_rhs(args: Any) -> Rhs:
    """The rope's right-hand side, written anew; its state is ``(..., 2, dim, nodes)``.

    Arguments:
        args: with the fields of `ropeode.problems.rope.RopeArgs`, whose float64 numbers are
            taken as they are.
    """
    mass, stiffness, rest, free, gravity, damping = (
        np.asarray(getattr(args, name), dtype=np.longdouble)
        for name in ("mass", "stiffness", "rest_length", "free", "gravity", "damping")
    )

    def rhs(t: np.ndarray, y: np.ndarray) -> np.ndarray:
        x, v = y[..., 0, :, :], y[..., 1, :, :]
        along = x[..., 1:] - x[..., :-1]
        length = np.sqrt(np.sum(along * along, axis=-2, keepdims=True))
        pull = stiffness * (length - rest) / length * along
        force = -damping * v
        force[..., :-1] += pull
        force[..., 1:] -= pull
        return np.stack([v, (force / mass + gravity) * free], axis=-3)

    return rhs


def rope_sizes(args: Any, y0: np.ndarray) -> np.ndarray:
    """Sizes of positions and velocities for `integrate`, ``(2, 1, 1)``.

    A spring's length is a small difference of large positions. Their rounding errors shake
    the velocities at the rope's highest frequency, which is below ``sqrt(4 k/m)``.
    """
    position = np.max(np.abs(y0[0]))
    stiffness = np.max(args.stiffness, initial=0.0)
    frequency = np.sqrt(4 * stiffness / np.min(args.mass))
    velocity = max(frequency * position, np.max(np.abs(y0[1])), 1e-3 * position)
    return np.array([position, velocity]).reshape(2, 1, 1)


def rope_solution(problem: Any, *, rtol: float = 1e-19) -> np.ndarray:
    """The states of a rope's problem at its sample times, in `np.longdouble`.

    The default tolerance is where rounding takes over: measured on several ropes, positions
    are then known to 1e-17 of their size, velocities to about 1e-17 of `rope_sizes`.
    """
    return integrate(
        rope_rhs(problem.args),
        problem.y0,
        problem.ts,
        sizes=rope_sizes(problem.args, problem.y0),
        rtol=rtol,
    )


class Links:
    """An inextensible rope in the directions of its links, and not in its nodes' positions.

    The nodes are sums of links, so that there are no lengths to keep and no tensions: each
    link turns about axes across it, and d'Alembert's principle along these motions gives a
    dense symmetric system for how fast the turning changes. The state is
    ``(..., 2, dim, 1 + links)``: how far the first pin has moved (the first node, where none
    is pinned), then the links over their lengths; and the rates of all that.

    Arguments:
        problem: of an inextensible rope, whose float64 numbers are taken as they are.
    """

    def __init__(self, problem: Any):
        args = problem.args
        self.mass, self.damping = (
            np.asarray(of, dtype=np.longdouble) for of in (args.mass, args.damping)
        )
        self.gravity = np.asarray(args.gravity, dtype=np.longdouble)[:, 0]
        x, v = np.asarray(problem.y0, dtype=np.longdouble)
        d, w = np.diff(x), np.diff(v)
        self.length = np.sqrt(np.sum(d * d, axis=0))
        pinned = np.flatnonzero(np.asarray(args.free) == 0)
        base = int(pinned[0]) if len(pinned) else 0
        self.start = x[:, base]
        self.dim, nodes = x.shape
        self.base_moves = not len(pinned)
        self.turning = [
            j for j in range(nodes - 1) if not (j in set(pinned) and j + 1 in set(pinned))
        ]
        # How far each node goes with the first column (all by one) and with each link.
        node, link = np.arange(nodes)[:, None], np.arange(nodes - 1)
        signs = np.where((base <= link) & (link < node), 1, 0)
        signs = signs - np.where((node <= link) & (link < base), 1, 0)
        self.reach = np.hstack([np.ones((nodes, 1)), signs * self.length])
        self.y0 = np.zeros((2, self.dim, nodes), dtype=np.longdouble)
        self.y0[0, :, 1:], self.y0[1, :, 1:] = d / self.length, w / self.length
        if self.base_moves:
            self.y0[1, :, 0] = v[:, base]
        # Each unknown belongs to a column; the unknowns of a link to its axes one by one.
        self.column = [0] * self.dim * self.base_moves + [
            1 + j for j in self.turning for _ in range(self.dim - 1)
        ]
        each = self.reach[:, self.column]
        self.inertia = each.T @ (self.mass[:, None] * each)

    def __call__(self, t: np.ndarray, y: np.ndarray) -> np.ndarray:
        """The right-hand side, for `integrate`."""
        q, rate = y[..., 0, :, :], y[..., 1, :, :]
        u, w = q[..., 1:], rate[..., 1:]
        axes = self._axes(u)
        # What the links' turning alone needs: |u| stays as it is where u . u'' = -|w|^2.
        bend = np.zeros_like(q)
        bend[..., 1:] = (
            -u * np.sum(w * w, axis=-2, keepdims=True) / np.sum(u * u, axis=-2, keepdims=True)
        )
        force = (
            self.mass * self.gravity[:, None]
            - self.damping * (rate @ self.reach.T)
            - self.mass * (bend @ self.reach.T)
        )
        pull = np.sum(axes * (force @ self.reach)[..., self.column], axis=-2)
        system = self.inertia * (np.swapaxes(axes, -1, -2) @ axes)
        change = axes * solve_symmetric(system, pull)[..., None, :]
        for unknown, column in enumerate(self.column):
            bend[..., column] += change[..., unknown]
        return np.stack([rate, bend], axis=-3)

    def _axes(self, u: np.ndarray) -> np.ndarray:
        """The direction of each unknown, ``(rows, dim, unknowns)``."""
        rows = np.moveaxis(u[..., self.turning], -2, -1)
        if self.dim == 2:
            across = [np.stack([-rows[..., 1], rows[..., 0]], axis=-1)]
        else:
            far = np.eye(3, dtype=np.longdouble)[np.argmin(np.abs(rows), axis=-1)]
            first = np.cross(rows, far)
            first = first / np.sqrt(np.sum(first * first, axis=-1, keepdims=True))
            across = [first, np.cross(rows, first)]
        # Link by link, the axes of one after the other.
        turning = np.stack(across, axis=-2).reshape(len(u), -1, self.dim)
        moving = np.eye(self.dim, dtype=np.longdouble)[: self.dim * self.base_moves]
        moving = np.broadcast_to(moving, (len(u), *moving.shape))
        return np.swapaxes(np.concatenate([moving, turning], axis=1), 1, 2)

    def sizes(self) -> np.ndarray:
        """Sizes of the state for `integrate`, ``(2, 1, 1 + links)``."""
        whole, shortest = np.sum(self.length), np.min(self.length, initial=np.inf)
        pull = np.sqrt(np.sum(self.gravity**2))
        turning = np.sqrt(pull / shortest) + np.max(np.abs(self.y0[1, :, 1:]), initial=0)
        moving = np.sqrt(pull * whole) + np.max(np.abs(self.y0[1]), initial=0) * max(whole, 1)
        result = np.ones((2, 1, self.y0.shape[-1]), dtype=np.longdouble)
        result[0, :, 0], result[1, :, 0] = max(whole, moving), max(moving, 1)
        result[1, :, 1:] = max(turning, 1e-3)
        return result

    def nodes(self, states: np.ndarray) -> np.ndarray:
        """States of the problem, ``(times, 2, dim, nodes)``."""
        found = states @ self.reach.T
        found[:, 0] += self.start[:, None]
        return found


def solve_symmetric(system: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solutions of positive definite systems, ``(rows, n, n)`` and ``(rows, n)``.

    By elimination without pivots, since NumPy's solvers know no `np.longdouble`.
    """
    a, b = system.copy(), right.copy()
    n = b.shape[-1]
    for k in range(n - 1):
        factor = a[:, k + 1 :, k] / a[:, k, k, None]
        a[:, k + 1 :, k + 1 :] -= factor[..., None] * a[:, k, None, k + 1 :]
        b[:, k + 1 :] -= factor * b[:, k, None]
    for k in reversed(range(n)):
        b[:, k] = (b[:, k] - np.sum(a[:, k, k + 1 :] * b[:, k + 1 :], axis=-1)) / a[:, k, k]
    return b


def inextensible_rope_solution(problem: Any, *, rtol: float = 1e-19) -> np.ndarray:
    """The states of an inextensible rope's problem at its sample times, in `np.longdouble`.

    Tolerance and accuracy are as for `rope_solution`; rounding in the links' directions
    counts times the length of the rope.
    """
    links = Links(problem)
    return links.nodes(integrate(links, links.y0, problem.ts, sizes=links.sizes(), rtol=rtol))
