"""The report of a check: one finding for each check, and the verdict."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar, Literal

from ropeode.analysis import ObservedOrder
from ropeode.display import Tabular
from ropeode.json_form import json_shows
from ropeode.steppers import ProblemClass, as_stepper
from ropeode.theory import Diagnosis
from ropeode.validation import bad_value, check_whole

Status = Literal["pass", "fail", "undetermined", "note", "skip"]
Verdict = Literal["right", "wrong", "undetermined"]

# What is tested there is rare, and says nothing about all other states.
EDGE_CASES = ("zero-length",)


@dataclasses.dataclass(frozen=True)
class Claims:
    """What the author claims of a stepper. A property without a claim is measured, not tested.

    Arguments:
        order: of convergence, on every problem but those of `damped_order`; None if no order is
            claimed.
        method: the stepper of ropeode that it implements, by name with options; it must then
            have that stepper's order on each class of problem, stability limit and structure.
        symplectic: whether its one-step map is symplectic, on problems without damping.
        reversible: whether a step back undoes a step forward, on problems without damping.
        conserves_energy: whether energy stays bounded in a long run without damping.
        damped_order: the order on problems with damping, if it is another one.

    Raises:
        InputError: an order is no whole number from 1 on, there is no such method, both are
            given, or an order with damping is given alone.
    """

    order: int | None = None
    method: str | None = None
    symplectic: bool | None = None
    reversible: bool | None = None
    conserves_energy: bool | None = None
    damped_order: int | None = None

    def __post_init__(self) -> None:
        order, damped, method = self.order, self.damped_order, self.method
        if order is not None:
            order = check_whole("expected_order", order, at_least=1, example="2")
        if damped is not None:
            damped = check_whole("damped_order", damped, at_least=1, example="1")
            if order is None:
                allowed = "one beside an order"
                raise bad_value("damped_order", damped, allowed, "claim that order, too")
        if order is not None and method is not None:
            allowed = "none beside a method, which has its own"
            raise bad_value("expected_order", order, allowed, "drop one")
        method = None if method is None else as_stepper(method).label
        for name, value in (("order", order), ("damped_order", damped), ("method", method)):
            object.__setattr__(self, name, value)

    def order_on(self, kind: ProblemClass) -> int | None:
        """The order that is claimed on problems of a class; None if none is."""
        other = kind.damped and self.damped_order is not None
        return self.damped_order if other else self.order


@json_shows(
    *("errors", "resolution", "limit_off", "limit_allowed", "order.observed", "order.ci95"),
    *("order.verdict", "order.why", "order.used", "order.left_out", "order.add"),
)
@dataclasses.dataclass(frozen=True)
class Quantity:
    """Errors and order of one quantity.

    Arguments:
        errors: the largest error at each step size; None for a run that diverged.
        rounding: the round-off at each step size; 0 where it is not known.
        resolution: ten times the reference's estimated bound: a smaller error is unresolved.
        limit_off: the distance between the limit of the runs as dt goes to zero and the reference;
            None where too few runs have a limit.
        limit_allowed: the largest distance that the uncertainty of both allows; None likewise.
        order: that was observed.
    """

    errors: tuple[float | None, ...]
    rounding: tuple[float, ...]
    resolution: float
    limit_off: float | None
    limit_allowed: float | None
    order: ObservedOrder

    def has_wrong_limit(self, certainty: float = 1.0) -> bool:
        """Whether the limit is off by more than so many times what is allowed."""
        off, allowed = self.limit_off, self.limit_allowed
        return off is not None and allowed is not None and off > certainty * allowed


@json_shows("problem", "expected", "dt=dts", "quantities")
@dataclasses.dataclass(frozen=True)
class Convergence:
    """Errors of the runs of one problem against its reference, and their orders.

    Arguments:
        problem: its name.
        dts: step sizes, from coarse to fine.
        quantities: position and velocity, or the state, each with its errors and order.
        expected: the order that is claimed on this problem; None if nothing is claimed.
    """

    problem: str
    dts: tuple[float, ...]
    quantities: Mapping[str, Quantity]
    expected: int | None

    @property
    def orders(self) -> dict[str, ObservedOrder]:
        """The observed order of each quantity."""
        return {name: each.order for name, each in self.quantities.items()}

    @property
    def has_orders(self) -> bool:
        """Whether each quantity shows one."""
        return all(order.ci95 is not None for order in self.orders.values())


@json_shows("check", "status", "finding=line", "evidence", "convergence")
@dataclasses.dataclass(frozen=True)
class Finding:
    """The result of one check.

    Arguments:
        check: its name.
        status: `pass`; `fail`: the stepper is wrong; `undetermined`: the evidence is too thin to
            tell; `note`: a measurement that no claim covers; `skip`: the check does not apply.
        line: the result with its evidence, in one line.
        evidence: the numbers behind it, as plain JSON values.
        convergence: the errors and orders, for checks of order.
    """

    check: str
    status: Status
    line: str
    evidence: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    convergence: Convergence | None = None


def passed_if(passed: bool, check: str, good: str, bad: str, **evidence: Any) -> Finding:
    """The finding of a check that every right stepper passes.

    Arguments:
        passed: whether it does.
        check: its name.
        good: the result in one line, if it passes.
        bad: likewise, if it fails.
        evidence: the numbers behind it.
    """
    return Finding(check, "pass" if passed else "fail", good if passed else bad, evidence)


def as_claimed(
    claimed: bool | None, holds: bool, check: str, claim: str, line: str, **evidence: Any
) -> Finding:
    """The finding on a property that a right stepper may have or lack.

    Arguments:
        claimed: whether the stepper is claimed to have it; None if nothing is claimed.
        holds: whether it has it.
        check: name of the check.
        claim: the property, as it ends the words "claimed to ...".
        line: the result with its evidence.
        evidence: the numbers behind it.
    """
    if claimed is None:
        return Finding(check, "note", line, evidence)
    if claimed == holds:
        return Finding(check, "pass", line, evidence)
    words = "claimed to" if claimed else "claimed not to"
    return Finding(check, "fail", f"{line}; {words} {claim}", evidence)


def exactly(difference: float) -> str:
    """How well two numbers agree that differ by rounding at most."""
    return "exactly" if difference == 0.0 else f"to rounding ({difference:.1e})"


@json_shows(*("label", "claims", "passed", "verdict", "findings", "diagnosis", "notes", "seconds"))
@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class CheckReport(Tabular):
    """The report on a stepper, or on trajectories.

    Arguments:
        label: what was checked.
        claims: of its author.
        findings: one for each check.
        diagnosis: the causes of failures; empty if nothing failed.
        notes: further observations, for example that the stepper prints.
        seconds: the time that the check took.

    Examples:
        >>> from ropeode import check_stepper
        >>> report = check_stepper("velocity-verlet", expected_order=4, quick=True)
        >>> report.verdict, [finding.check for finding in report.failed]
        ('wrong', ['order-unequal', 'order-driven'])
    """

    SCHEMA: ClassVar[str] = "ropeode.check/1"

    label: str
    claims: Claims
    findings: tuple[Finding, ...]
    diagnosis: tuple[Diagnosis, ...] = ()
    notes: tuple[str, ...] = ()
    seconds: float = dataclasses.field(default=0.0, compare=False)

    @property
    def failed(self) -> tuple[Finding, ...]:
        """The findings of checks that failed."""
        return tuple(finding for finding in self.findings if finding.status == "fail")

    @property
    def undetermined(self) -> tuple[Finding, ...]:
        """The findings of checks whose evidence is too thin."""
        return tuple(finding for finding in self.findings if finding.status == "undetermined")

    @property
    def verdict(self) -> Verdict:
        """`wrong` if a check failed; `right` if all that could decide passed, at least one.

        Otherwise it is `undetermined`.
        """
        if self.failed:
            return "wrong"
        decided = any(finding.status == "pass" for finding in self.findings)
        return "right" if decided and not self.undetermined else "undetermined"

    @property
    def passed(self) -> bool:
        """Whether the verdict is `right`."""
        return self.verdict == "right"

    @property
    def exit_code(self) -> int:
        """Of a command that ends with this report."""
        return {"right": 0, "wrong": 1, "undetermined": 2}[self.verdict]

    @property
    def otherwise_right(self) -> bool:
        """Whether no check failed but those of edge cases."""
        edges = all(finding.check in EDGE_CASES for finding in self.failed)
        return edges and not self.undetermined
