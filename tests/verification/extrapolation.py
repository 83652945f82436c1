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
