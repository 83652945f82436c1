"""The JSON form of reports on steppers and on trajectories."""

from __future__ import annotations

from typing import Any, Literal, TypedDict

from ropeode.analysis import order
from ropeode.analysis.order import LeftOut
from ropeode.checking.report import Claims, Status, Verdict


class QuantityForm(TypedDict):
    """Errors and order of one quantity.

    Fields:
        errors: the largest error at each step size; null for a run that diverged.
        resolution: ten times the reference's estimated bound: a smaller error is unresolved.
        limit_off: the distance between the limit of the runs as dt goes to zero and the reference;
            null where too few runs have a limit.
        limit_allowed: the largest distance that the uncertainty of both allows; null likewise.
        observed: the slope of log(error) over log(dt); null if undetermined.
        ci95: its 95% confidence interval; null if undetermined.
        verdict: `converges`, `does not converge` or `undetermined`.
        why: what is missing, if undetermined; else null.
        used: step sizes in the fit, from coarse to fine.
        left_out: the others.
        add: step sizes of further runs that may decide an undetermined order.
    """

    errors: list[float | None]
    resolution: float
    limit_off: float | None
    limit_allowed: float | None
    observed: float | None
    ci95: tuple[float, float] | None
    verdict: order.Verdict
    why: str | None
    used: list[float]
    left_out: list[LeftOut]
    add: list[float]


class ConvergenceForm(TypedDict):
    """The runs behind a check of order.

    Fields:
        problem: its name.
        expected: the order that is claimed on this problem; null if nothing is claimed.
        dt: step sizes, from coarse to fine.
        quantities: position and velocity (or the state), each with its errors and order.
    """

    problem: str
    expected: int | None
    dt: list[float]
    quantities: dict[str, QuantityForm]


class FindingForm(TypedDict):
    """The result of one check.

    Fields:
        check: its name.
        status: `pass`; `fail`: the stepper is wrong; `undetermined`: the evidence is too thin to
            tell; `note`: a measurement that no claim covers; `skip`: the check does not apply.
        finding: the result with its evidence, in one line.
        evidence: the numbers behind it, which differ from check to check.
        convergence: the errors and orders, for checks of order; else null.
    """

    check: str
    status: Status
    finding: str
    evidence: dict[str, Any]
    convergence: ConvergenceForm | None


class DiagnosisForm(TypedDict):
    """A cause of failures.

    Fields:
        cause: a keyword, such as `parameters`, `start`, `lagged-damping`, `step-size`, `unknown`.
        finding: a sentence for the author.
        remedy: what to write instead; null where that is not known.
        evidence: the numbers behind it, which differ from cause to cause.
    """

    cause: str
    finding: str
    remedy: str | None
    evidence: dict[str, Any]


class CheckForm(TypedDict):
    """A verdict on a stepper or on trajectories: `ropeode check` and `ropeode grade`.

    Fields:
        schema: name and version of this form.
        label: what was checked.
        claims: of its author.
        passed: whether the verdict is `right`.
        verdict: `right`, `wrong` or `undetermined`.
        findings: one for each check.
        diagnosis: the causes of failures; empty if nothing failed.
        notes: further observations, for example that the stepper prints.
        seconds: the time that the check took.
    """

    schema: Literal["ropeode.check/1"]
    label: str
    claims: Claims
    passed: bool
    verdict: Verdict
    findings: list[FindingForm]
    diagnosis: list[DiagnosisForm]
    notes: list[str]
    seconds: float
