"""Whether one step has the structure of a mechanical motion."""

from __future__ import annotations

import numpy as np

from ropeode.checking.check_context import Examination
from ropeode.checking.jacobian import jacobian
from ropeode.checking.problems import undamped
from ropeode.checking.report import Finding
from ropeode.problems.problem import Problem

_DT = 0.2
# What finite differences leave of zero, and a step that goes back of where it came from.
_SYMPLECTIC, _REVERSIBLE = 1e-7, 1e-10


def symplectic(examination: Examination) -> Finding:
    """Whether the one-step map keeps areas of phase space: ``J^T W J = W``.

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
    return _judged(
        examination.symplectic,
        off <= _SYMPLECTIC,
        "symplectic",
        f"the one-step map is symplectic, to {off:.1e}",
        f"the one-step map is not symplectic: off by {off:.1e} at dt = {_DT:g}",
        off,
    )


def reversible(examination: Examination) -> Finding:
    """Whether a step, and one with the velocities turned round, lead back to the start.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, section V.1.
    """
    problem = undamped()
    turn = np.array([1.0, -1.0])[:, None, None]
    there = _stepped(examination, problem)
    back = turn * _stepped(examination, problem.changed(y0=turn * there))
    off = float(np.max(np.abs(back - problem.y0))) / problem.scale
    return _judged(
        examination.claims.reversible,
        off <= _REVERSIBLE,
        "reversible",
        f"a step forward and one back end where they began, to {off:.1e}",
        f"a step forward and one back do not end where they began, but {off:.1e} away "
        f"at dt = {_DT:g}",
        off,
    )


def _stepped(examination: Examination, problem: Problem) -> np.ndarray:
    one = problem.changed(ts=problem.ts[0] + np.array([0.0, _DT]))
    return examination.candidate.run(one, 1)[1]


def _judged(
    claimed: bool | None, found: bool, check: str, good: str, bad: str, off: float
) -> Finding:
    evidence = {"residual": off, "dt": _DT}
    if claimed is None:
        return Finding(check, "note", good if found else bad, evidence)
    if claimed and not found:
        return Finding(check, "fail", f"{bad}; it is claimed to be so", evidence)
    if found and not claimed:
        return Finding(check, "fail", f"{good}; it is claimed not to be", evidence)
    return Finding(check, "pass", good if found else bad, evidence)
