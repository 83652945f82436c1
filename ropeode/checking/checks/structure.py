"""Whether one step is symplectic, and whether it is reversible."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ropeode.checking.check_context import Examination
from ropeode.checking.check_ropes import undamped
from ropeode.checking.report import Finding, as_claimed

_DT = 0.2
# What the errors of finite differences, and of rounding, leave of zero.
_SYMPLECTIC, _REVERSIBLE = 1e-7, 1e-10
# For differences of fourth order: truncation and rounding are both about 1e-12.
_H = 1e-3


def symplectic(examination: Examination) -> Finding:
    """Whether the one-step map preserves areas of phase space: ``J^T W J = W``.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, section VI.2.
    """
    problem = undamped()
    free = problem.args.free > 0.0
    masses = np.repeat(problem.args.mass[free], 3)

    def step(z: np.ndarray) -> np.ndarray:
        y = problem.y0.copy()
        y[:, free] = z.reshape(2, -1, 3)
        return examination.one_step(problem.changed(y0=y), _DT)[:, free].ravel()

    derivative = _jacobian(step, problem.y0[:, free].ravel())
    n = len(masses)
    form = np.zeros((2 * n, 2 * n))
    form[:n, n:], form[n:, :n] = np.diag(masses), -np.diag(masses)
    off = float(np.max(np.abs(derivative.T @ form @ derivative - form)) / np.max(masses))
    holds = off <= _SYMPLECTIC
    line = (
        f"the one-step map is symplectic to {off:.1e}"
        if holds
        else f"the one-step map is not symplectic: J^T W J - W is {off:.1e} at dt = {_DT:g}"
    )
    claimed, claim = examination.symplectic, "be symplectic"
    return as_claimed(claimed, holds, "symplectic", claim, line, residual=off, dt=_DT)


def reversible(examination: Examination) -> Finding:
    """Whether a step, a reversal of velocities and another step lead back to the start.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, section V.1.
    """
    problem = undamped()
    turn = np.array([1.0, -1.0])[:, None, None]
    there = examination.one_step(problem, _DT)
    back = turn * examination.one_step(problem.changed(y0=turn * there), _DT)
    off = float(np.max(np.abs(back - problem.y0))) / problem.scale
    holds = off <= _REVERSIBLE
    line = (
        f"a step forward and a step back return to the start, to within {off:.1e}"
        if holds
        else f"a step forward and a step back end {off:.1e} away from the start at dt = {_DT:g}"
    )
    claimed, claim = examination.claims.reversible, "be reversible"
    return as_claimed(claimed, holds, "reversible", claim, line, residual=off, dt=_DT)


def _jacobian(function: Callable[[np.ndarray], np.ndarray], y: np.ndarray) -> np.ndarray:
    """The derivative of a function of a vector, ``(outputs, inputs)``.

    Central differences of fourth order: they need only values, so the step may be in any
    language.
    """
    columns = []
    for direction in _H * np.eye(len(y)):
        near = function(y + direction) - function(y - direction)
        far = function(y + 2 * direction) - function(y - 2 * direction)
        columns.append((8.0 * near - far) / (12.0 * _H))
    return np.stack(columns, axis=1)
