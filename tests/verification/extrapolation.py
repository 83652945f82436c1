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
Tensions = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]

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
    """The right-hand side of a rope of springs or of rigid links; states ``(..., 2, dim, nodes)``.

    Arguments:
        args: of the problem of a `Rope` or an `InextensibleRope`, whose float64 numbers are taken
            as they are.
    """
    mass, free, gravity, damping = (
        np.asarray(getattr(args, name), dtype=np.longdouble)
        for name in ("mass", "free", "gravity", "damping")
    )
    tensions = rigid_tensions(free / mass) if rigid(args) else spring_tensions(args)

    def rhs(t: np.ndarray, y: np.ndarray) -> np.ndarray:
        x, v = y[..., 0, :, :], y[..., 1, :, :]
        force = mass * gravity - damping * v
        pull = tensions(np.diff(x), np.diff(v), np.diff(force / mass * free)) * np.diff(x)
        force[..., :-1] += pull
        force[..., 1:] -= pull
        return np.stack([v, force / mass * free], axis=-3)

    return rhs


def rigid(args: Any) -> bool:
    return not hasattr(args, "stiffness")


def spring_tensions(args: Any) -> Tensions:
    """What the links are multiplied by to make the forces of springs."""
    stiffness, rest = (np.asarray(of, np.longdouble) for of in (args.stiffness, args.rest_length))
    return lambda d, w, fall: stiffness * (1 - rest / np.sqrt(np.sum(d * d, -2, keepdims=True)))


def rigid_tensions(lightness: np.ndarray) -> Tensions:
    """Likewise, for forces that keep ``d . d`` as it is: ``d . d'' + d' . d' = 0`` of each link.

    Arguments:
        lightness: of each node, 1 over its mass, and 0 where it is pinned.
    """
    moving = lightness[:-1] + lightness[1:] > 0
    coupling = np.diag(lightness[:-1] + lightness[1:])
    coupling -= np.diag(lightness[1:-1], 1) + np.diag(lightness[1:-1], -1)
    coupling = coupling[np.ix_(moving, moving)]

    def tensions(d: np.ndarray, w: np.ndarray, fall: np.ndarray) -> np.ndarray:
        right = np.sum(d * fall + w * w, axis=-2)
        along = d[..., moving]
        found = np.zeros_like(right)
        system = coupling * (np.swapaxes(along, -1, -2) @ along)
        found[..., moving] = solve_symmetric(system, right[..., moving])
        return found[..., None, :]

    return tensions


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


def rope_sizes(args: Any, y0: np.ndarray) -> np.ndarray:
    """Sizes of positions and velocities for `integrate`, ``(2, 1, 1)``.

    A link's length is a small difference of large positions. Their rounding errors shake the
    velocities at the rope's highest frequency: below ``sqrt(4 k/m)`` for springs, and of the order
    of that of a pendulum as long as the shortest link.
    """
    position = np.max(np.abs(y0[0]))
    if rigid(args):
        shortest = np.min(np.linalg.norm(np.diff(y0[0]), axis=0))
        frequency = np.sqrt(np.linalg.norm(args.gravity) / shortest)
    else:
        frequency = np.sqrt(4 * np.max(args.stiffness, initial=0.0) / np.min(args.mass))
    velocity = max(frequency * position, np.max(np.abs(y0[1])), 1e-3 * position)
    return np.array([position, velocity]).reshape(2, 1, 1)


def rope_solution(problem: Any, *, rtol: float = 1e-19) -> np.ndarray:
    """The states of a problem of either rope at its sample times, in `np.longdouble`.

    The default tolerance is where rounding takes over: measured on several ropes, positions
    are then known to 1e-17 of their size, velocities to about 1e-17 of `rope_sizes`.
    """
    sizes = rope_sizes(problem.args, problem.y0)
    return integrate(rope_rhs(problem.args), problem.y0, problem.ts, sizes=sizes, rtol=rtol)
