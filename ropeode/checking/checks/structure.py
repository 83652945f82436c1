"""Whether one step is symplectic, and whether it is reversible."""

from __future__ import annotations

import numpy as np

from ropeode.checking.check_context import Examination
from ropeode.checking.check_ropes import undamped
from ropeode.checking.finite_differences import jacobian
from ropeode.checking.report import Finding
from ropeode.problems.problem import Problem

_DT = 0.2
# What the errors of finite differences, and of rounding, leave of zero.
_SYMPLECTIC, _REVERSIBLE = 1e-7, 1e-10


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
        return _stepped(examination, problem.changed(y0=y))[:, free].ravel()

    derivative = jacobian(step, problem.y0[:, free].ravel(), 1.0)
    n = len(masses)
    form = np.zeros((2 * n, 2 * n))
    form[:n, n:], form[n:, :n] = np.diag(masses), -np.diag(masses)
    off = float(np.max(np.abs(derivative.T @ form @ derivative - form)) / np.max(masses))
    return _finding(
        examination.symplectic,
        off <= _SYMPLECTIC,
        "symplectic",
        f"the one-step map is symplectic to {off:.1e}",
        f"the one-step map is not symplectic: J^T W J - W is {off:.1e} at dt = {_DT:g}",
        off,
    )


def reversible(examination: Examination) -> Finding:
    """Whether a step, a reversal of velocities and another step lead back to the start.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, section V.1.
    """
    problem = undamped()
    turn = np.array([1.0, -1.0])[:, None, None]
    there = _stepped(examination, problem)
    back = turn * _stepped(examination, problem.changed(y0=turn * there))
    off = float(np.max(np.abs(back - problem.y0))) / problem.scale
    return _finding(
        examination.claims.reversible,
        off <= _REVERSIBLE,
        "reversible",
        f"a step forward and a step back return to the start, to within {off:.1e}",
        f"a step forward and a step back end {off:.1e} away from the start at dt = {_DT:g}",
        off,
    )


def _stepped(examination: Examination, problem: Problem) -> np.ndarray:
    one = problem.changed(ts=problem.ts[0] + np.array([0.0, _DT]))
    return examination.candidate.run(one, 1)[1]


def _finding(
    claimed: bool | None, holds: bool, check: str, good: str, bad: str, off: float
) -> Finding:
    evidence = {"residual": off, "dt": _DT}
    if claimed is None:
        return Finding(check, "note", good if holds else bad, evidence)
    if claimed and not holds:
        return Finding(check, "fail", f"{bad}; claimed to be {check}", evidence)
    if holds and not claimed:
        return Finding(check, "fail", f"{good}; claimed not to be {check}", evidence)
    return Finding(check, "pass", good if holds else bad, evidence)
