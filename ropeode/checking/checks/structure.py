"""Whether one step is symplectic, and whether it is reversible."""

from __future__ import annotations

from ropeode.checking.check_context import Examination
from ropeode.checking.check_ropes import undamped
from ropeode.checking.report import Finding, as_claimed
from ropeode.theory import structure_of

# What the errors of finite differences and of iterations, and of rounding, leave of zero.
_SYMPLECTIC, _REVERSIBLE = 1e-7, 1e-10


def symplectic(examination: Examination) -> Finding:
    """Whether the one-step map preserves areas of phase space: ``J^T W J = W``.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, section VI.2.
    """
    return _finding(
        examination,
        "symplectic",
        examination.symplectic,
        _SYMPLECTIC,
        "the one-step map is symplectic to {defect:.1e}",
        "the one-step map is not symplectic: J^T W J - W is {defect:.1e} at dt = {dt:.2g}",
    )


def reversible(examination: Examination) -> Finding:
    """Whether a step, a reversal of velocities and another step lead back to the start.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, section V.1.
    """
    return _finding(
        examination,
        "reversible",
        examination.claims.reversible,
        _REVERSIBLE,
        "a step forward and a step back return to the start, to within {defect:.1e}",
        "a step forward and a step back end {defect:.1e} away from the start at dt = {dt:.2g}",
    )


def _finding(
    examination: Examination, name: str, claimed: bool | None, small: float, good: str, bad: str
) -> Finding:
    found = structure_of(undamped(), examination.method, [name])
    assert not isinstance(found, str)
    own = found[name]
    if own.defect is None:
        return Finding(name, "skip", own.note)
    # A high order makes a small defect, which is one all the same.
    holds = own.defect <= small and own.power is None
    line = (good if holds else bad).format(defect=own.defect, dt=own.dt)
    if own.power is not None:
        line += f", and goes as dt^{own.power}"
    evidence = {"residual": own.defect, "dt": own.dt, "power": own.power}
    return as_claimed(claimed, holds, name, f"be {name}", line, **evidence)
