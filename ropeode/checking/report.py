"""What came of a check: one finding for each check, and the verdict."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, Literal

from ropeode.analysis.order import ObservedOrder

Status = Literal["pass", "fail", "note", "skip"]


@dataclasses.dataclass(frozen=True)
class Claims:
    """What the author says of a stepper; what is not said is found out and not judged.

    Arguments:
        order: of convergence, on every problem; None where it is not said.
        method: the stepper of ropeode that it is meant to be, by name with options; the order
            on each class of problem, the limit of stability, symplecticity and reversibility
            then have to be those.
        symplectic: whether its one-step map is, on problems without damping.
        reversible: whether steps forward undo steps backward, on problems without damping.
        conserves_energy: whether its energy stays bounded there, in the long run.
    """

    order: int | None = None
    method: str | None = None
    symplectic: bool | None = None
    reversible: bool | None = None
    conserves_energy: bool | None = None


@dataclasses.dataclass(frozen=True)
class Convergence:
    """Errors of runs of one problem, held against its reference.

    Arguments:
        problem: its name.
        dts: step sizes, from coarse to fine.
        errors: for each quantity (position, velocity) the largest error at each step size;
            None where a run diverged.
        resolution: for each quantity ten times the reference's estimated bound: a smaller
            error is unresolved.
        orders: for each quantity what was observed.
        expected: the order that is claimed on this problem; None where nothing is.
        limits: for each quantity how far the runs' limit for dt to zero is from the
            reference, and how far it may be by what is known of both; none where there are
            too few runs to tell.
    """

    problem: str
    dts: tuple[float, ...]
    errors: Mapping[str, tuple[float | None, ...]]
    resolution: Mapping[str, float]
    orders: Mapping[str, ObservedOrder]
    expected: int | None
    limits: Mapping[str, tuple[float, float]]


@dataclasses.dataclass(frozen=True)
class Finding:
    """What one check found.

    Arguments:
        check: its name.
        status: `pass`; `fail`: the stepper is wrong; `note`: something was measured that no
            claim was made about; `skip`: the check does not apply.
        line: what was found, with its evidence, in one line.
        evidence: the numbers behind it, as plain JSON values.
        convergence: the errors and orders, where that is what was checked.
    """

    check: str
    status: Status
    line: str
    evidence: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    convergence: Convergence | None = None


@dataclasses.dataclass(frozen=True)
class Diagnosis:
    """What is wrong, as far as the evidence says.

    Arguments:
        cause: one of a few words, such as `parameters`, `start`, `lagged-damping`,
            `damping-per-step`, `stage-time`, `in-place`, `float32`, or `unknown`.
        line: a sentence for the author.
        evidence: the numbers behind it, as plain JSON values.
    """

    cause: str
    line: str
    evidence: Mapping[str, Any] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True)
class CheckReport:
    """The report on a stepper, or on trajectories.

    Arguments:
        label: what was checked.
        claims: what its author says.
        findings: one for each check that was asked for.
        diagnosis: what explains the failures; empty where nothing failed.
        notes: what should be known beside, such as that the stepper prints.
        seconds: that it took.
    """

    label: str
    claims: Claims
    findings: tuple[Finding, ...]
    diagnosis: tuple[Diagnosis, ...] = ()
    notes: tuple[str, ...] = ()
    seconds: float = 0.0

    @property
    def failed(self) -> tuple[Finding, ...]:
        """The findings that say that the stepper is wrong."""
        return tuple(finding for finding in self.findings if finding.status == "fail")

    @property
    def passed(self) -> bool:
        """Whether every check that applies passed, and there was one."""
        return not self.failed and any(finding.status == "pass" for finding in self.findings)
