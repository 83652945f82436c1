"""The check of a stepper: all that applies, one finding each, and a verdict."""

from __future__ import annotations

import dataclasses
import functools
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from ropeode.checking.check_context import Examination, own_claims, references_ahead
from ropeode.checking.check_ropes import convergence_problems, undamped
from ropeode.checking.checks import CHECKS, SLOW
from ropeode.checking.report import EDGE_CASES, CheckReport, Claims, Diagnosis, Finding
from ropeode.checking.time_limit import OutOfTime, kept_output, within
from ropeode.errors import InputError, UserCodeError
from ropeode.precision import in_float64
from ropeode.progress import Progress, bar, shows_progress
from ropeode.simulation import HIDDEN_STATE, Trial, trial_of
from ropeode.steppers import Stepper, as_stepper, template
from ropeode.validation import bad_value, check_positive, unknown

CHECK_TIME_LIMIT = 60.0
# The wall time of a diagnosis with all that it computes, over the time limit of the step.
_DIAGNOSIS = 10.0
# The checks whose failure a diagnosis may explain.
EXPLAINED = {name for name in CHECKS if name.startswith("order-")} | {
    "momentum",
    "boost",
    "node-order",
    "float32",
}
# Those that tell a method from another one of the same order.
_OF_A_METHOD = {"stability", "energy", "symplectic", "reversible"}
# A step that seems to obey a threshold may be one that differs from call to call.
_THRESHOLDS = ("time-shift", "thresholds")


@shows_progress
def check_stepper(
    step: Any,
    expected_order: int | None = None,
    *,
    method: str | None = None,
    damped_order: int | None = None,
    symplectic: bool | None = None,
    reversible: bool | None = None,
    conserves_energy: bool | None = None,
    only: Iterable[str] | None = None,
    skip: Iterable[str] = (),
    quick: bool = False,
    diagnose: bool = True,
    time_limit: float = CHECK_TIME_LIMIT,
    progress: Progress = bar,
) -> CheckReport:
    """Check a stepper: does it solve the right equation, and how well?

    Arguments:
        step: whatever `ropeode.as_stepper` takes. Step functions are handed a `CheckArgs` as
            `args`.
        expected_order: that its author claims.
        damped_order: the order that is enough on problems with damping, as 1 for velocity Verlet
            in the form kick-drift-kick; None for `expected_order`.
        method: the stepper of ropeode that it is meant to be, such as ``velocity-verlet``; it
            must then have that one's order on each problem, limit of stability, and structure.
        symplectic: whether its author claims that it is.
        reversible: likewise.
        conserves_energy: whether its author claims that energy stays bounded in the long run.
        only: names of checks; no others are made.
        skip: names of checks that are not made.
        quick: leave out the checks in `SLOW`, and the diagnosis.
        diagnose: look for the cause of what fails.
        time_limit: the processor time that the step may use in each check and in the diagnosis,
            in seconds; of wall time, as for waiting, it may use ten times as much.
        progress: called again and again with what is being done and the fraction that is done;
            what it raises ends the check.

    Returns:
        The report; ``report.passed`` is the verdict.

    Raises:
        InputError: an argument cannot be used.
        UserCodeError: the step raises, hangs, or returns what is no state; its own exception is
            the cause.

    Examples:
        >>> from ropeode import check_stepper
        >>> def explicit_euler(rhs, t, y, dt, args):
        ...     return y + dt * rhs(t, y, args)
        >>> report = check_stepper(explicit_euler, expected_order=2, quick=True)
        >>> print(report.failed[0].line)
        positions order 1...; velocities order 1...; expected 2
    """
    claims = Claims(expected_order, method, symplectic, reversible, conserves_energy, damped_order)
    names = chosen_checks(only, skip, quick)
    limit = check_positive("time_limit", time_limit, example="60")
    started = time.perf_counter()
    with kept_output() as printed:
        stepper = as_stepper(step)
        _require(stepper)
        claims = claims if claims != Claims() else own_claims(stepper)
        ropes = convergence_problems()
        needed = [each for name, each in ropes.items() if f"order-{name}" in names]
        references_ahead(sorted(needed, key=lambda problem: problem.equal_frames))
        trial = within(
            limit,
            "a trial of a few steps",
            lambda: trial_of(stepper, ropes["driven"]),
            meanwhile=functools.partial(progress, "trial", 0.0),
        )
        diagnosis: tuple[Diagnosis, ...] = ()
        if trial.hidden_state:
            findings = _only("determinism", trial.hidden_state, names, "not deterministic")
        else:
            trial.require_finite()
            examination = Examination(stepper, claims)
            findings = _findings(examination, names, limit, progress)
            explained = EXPLAINED | (_OF_A_METHOD if claims.method else set())
            failed = any(each.status == "fail" and each.check in explained for each in findings)
            if diagnose and not quick and failed:
                what = functools.partial(progress, "diagnosis", 1.0)
                diagnosis = _diagnosed(examination, limit, what)
    progress("done", 1.0)
    return CheckReport(
        label=stepper.label,
        claims=claims,
        findings=tuple(findings),
        diagnosis=diagnosis,
        notes=tuple(_notes(trial, printed.beginning)),
        seconds=time.perf_counter() - started,
    )


def _findings(
    examination: Examination, names: list[str], limit: float, progress: Progress
) -> list[Finding]:
    """Those of all checks; of no more where a step is not deterministic."""
    findings = []
    for done, name in enumerate(names):
        # Enters float64 again, which is a thread's own.
        work = functools.partial(in_float64(CHECKS[name]), examination)
        timed = functools.partial(
            within,
            limit,
            f"the check {name!r}",
            work,
            meanwhile=functools.partial(progress, name, done / len(names)),
        )
        examination.lost = ""
        try:
            finding = timed()
            if finding.status == "fail" and name in _THRESHOLDS and timed().line != finding.line:
                finding = dataclasses.replace(finding, line=HIDDEN_STATE)
        except OutOfTime as error:
            if name not in EDGE_CASES:
                raise
            finding = Finding(name, "undetermined", f"the step did not finish {error.why}")
        if name == "determinism" and finding.status == "fail":
            return _only(name, finding.line, names, "not deterministic")
        findings.append(examination.with_nan(finding))
    return findings


def _only(check: str, line: str, names: list[str], why: str) -> list[Finding]:
    """The finding of the one check that fails, for a step that is checked no further."""
    rest = [Finding(name, "skip", why) for name in names if name != check]
    return [Finding(check, "fail", line), *rest]


def cut_off(label: str, claims: Claims, checks: list[str], how: str, during: str) -> CheckReport:
    """The report on a stepper that ended the process in which it was checked.

    Arguments:
        label: of the stepper.
        claims: of its author.
        checks: that were to be made.
        how: what the step did, such as "ended its process (exit code 0)".
        during: the check that was being made.
    """
    line = f"the step {how}, during {during!r}; a step returns, and leaves its process alone"
    return CheckReport(label, claims, tuple(_only("purity", line, checks, "the process had ended")))


def _require(stepper: Stepper) -> None:
    """See that a stepper can run on check ropes.

    Raises:
        InputError: it cannot, and why.
    """
    if stepper.moves_links:
        kind = " --kind inextensible-rope" if stepper.keeps_lengths else ""
        raise bad_value(
            "stepper",
            stepper.label,
            "steppers that ask for forces; this one moves nodes link by link, and the ropes of the "
            "check have a force that no link knows of",
            f"see its order with: ropeode table{kind} --steppers {stepper.label}",
        )
    stepper.require(undamped())


def _notes(trial: Trial, printed: str) -> Iterator[str]:
    if printed.strip():
        first = printed.strip().splitlines()[0]
        yield f"the step prints, which costs time (its first line: {first[:60]!r})"
    if trial.hidden_state:
        yield (
            "carry what the step remembers in a class, as in this file (ropeode check --template "
            f"two-step):\n\n{template('two-step')}"
        )


def _diagnosed(
    examination: Examination, limit: float, meanwhile: Callable[[], None]
) -> tuple[Diagnosis, ...]:
    """The diagnosis. What has been found before stands, whatever becomes of it."""
    # Not above: it imports diffrax, and most steppers need none of it.
    from ropeode.checking.diagnosis.stepper import diagnose_stepper

    work = functools.partial(diagnose_stepper, examination)
    try:
        return within(limit, "the diagnosis", work, _DIAGNOSIS * limit, meanwhile)
    except OutOfTime as error:
        why = f"it did not finish {error.why}; raise the time limit (--time-limit)"
    except UserCodeError as error:
        why = str(error)
    return (Diagnosis("unfinished", f"no cause is known, for the diagnosis was cut off: {why}"),)


def chosen_checks(only: Iterable[str] | None, skip: Iterable[str], quick: bool) -> list[str]:
    """Names of the checks to make, in their order.

    Raises:
        InputError: one does not exist, or none is left.
    """
    skip = [skip] if isinstance(skip, str) else list(skip)
    only = [only] if isinstance(only, str) else None if only is None else list(only)
    asked = (*(only or ()), *skip)
    faults = [unknown("check", name, CHECKS) for name in asked if name not in CHECKS]
    if faults:
        raise InputError(faults)
    left_out = {*skip, *(SLOW if quick and only is None else ())}
    names = [name for name in CHECKS if name not in left_out and (only is None or name in only)]
    if not names:
        raise bad_value("only", only, "at least one check", "skip fewer")
    return names
