"""The check of a stepper: all that applies, one finding each, and a verdict."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import Any

from ropeode.checking.check_context import Examination, references_ahead
from ropeode.checking.checks import CHECKS, SLOW
from ropeode.checking.problems import convergence_problems
from ropeode.checking.report import CheckReport, Claims, Diagnosis, Finding
from ropeode.checking.step_signatures import Form
from ropeode.checking.stepper_loading import brought, examined
from ropeode.checking.time_limit import kept_output, within
from ropeode.errors import InputError
from ropeode.precision import in_float64
from ropeode.steppers import stepper
from ropeode.steppers.base import Stepper
from ropeode.validation import check_positive, check_whole, complaint, unknown

Progress = Callable[[str, float], None]
TIME_LIMIT = 60.0
# The checks whose failure a diagnosis may explain.
EXPLAINED = {name for name in CHECKS if name.startswith("order-")} | {"node-order", "float32"}


def check_stepper(
    step: Any,
    expected_order: int | None = None,
    *,
    method: str | None = None,
    symplectic: bool | None = None,
    reversible: bool | None = None,
    conserves_energy: bool | None = None,
    only: Iterable[str] | None = None,
    skip: Iterable[str] = (),
    quick: bool = False,
    diagnose: bool = True,
    time_limit: float = TIME_LIMIT,
    progress: Progress = lambda text, fraction: None,
) -> CheckReport:
    """Check a stepper: does it solve the right equation, and how well?

    Arguments:
        step: a function ``step(rhs, t, y, dt, args)`` that returns the new state ``(2, nodes,
            dim)``, or ``step(acceleration, t, x, v, dt, args)`` that returns the new positions
            and velocities ``(nodes, dim)``, in NumPy or JAX; a `Stepper`, class or object; a
            name, as on the command line. `args` is a `CheckArgs`.
        expected_order: that its author claims.
        method: the stepper of ropeode that it is meant to be, such as ``velocity-verlet``; it
            must then have that one's order on each problem, limit of stability, and structure.
        symplectic: whether its author claims that it is.
        reversible: likewise.
        conserves_energy: whether its author claims that energy stays bounded in the long run.
        only: names of checks; no others are made.
        skip: names of checks that are not made.
        quick: leave out the checks in `SLOW`, and the diagnosis.
        diagnose: look for the cause of what fails.
        time_limit: in seconds, for each check.
        progress: called with what is being done and the fraction that is done.

    Returns:
        The report; ``report.passed`` is the verdict.

    Raises:
        InputError: an argument cannot be used.
        UserCodeError: the step raises, hangs, or returns what is no state; its own exception is
            the cause.
    """
    claims = checked_claims(expected_order, method, symplectic, reversible, conserves_energy)
    names = chosen_checks(only, skip, quick)
    limit = check_positive("time_limit", time_limit, example="60")
    started = time.perf_counter()
    label, form = brought(step)
    if claims == Claims() and isinstance(form, Stepper):
        claims = Claims(method=form.label)
    if claims == Claims() and isinstance(form, Form):
        claims = Claims(order=form.documented_order)
    needed = [each for name, each in convergence_problems().items() if f"order-{name}" in names]
    references_ahead(needed)
    with kept_output() as printed:
        candidate, manners = within(limit, lambda: examined(label, form))
        examination = Examination(candidate, claims, manners, _declared(claims, form))
        findings = []
        for done, name in enumerate(names):
            progress(name, done / len(names))
            findings.append(_made(examination, name, limit))
            if name == "determinism" and findings[-1].status == "fail":
                # What does not repeat cannot be judged by its runs.
                findings += [Finding(each, "skip", "does not repeat") for each in names[1:]]
                break
        failed = {finding.check for finding in findings if finding.status == "fail"}
        diagnosis: tuple[Diagnosis, ...] = ()
        if diagnose and not quick and failed & EXPLAINED:
            progress("diagnosis", 1.0)
            diagnosis = within(limit, lambda: _diagnosed(examination))
    notes = []
    if text := manners.printed or printed.getvalue():
        first = text.strip().splitlines()[0] if text.strip() else ""
        notes.append(f"the step prints, which costs time (its first line: {first[:60]!r})")
    progress("done", 1.0)
    return CheckReport(
        label=label,
        claims=claims,
        findings=tuple(findings),
        diagnosis=diagnosis,
        notes=tuple(notes),
        seconds=time.perf_counter() - started,
    )


def _diagnosed(examination: Examination) -> tuple[Diagnosis, ...]:
    # Not above: it imports diffrax and optimistix, and most steppers need none of it.
    from ropeode.checking.diagnosis.diagnose import diagnose

    return diagnose(examination)


def _made(examination: Examination, name: str, limit: float) -> Finding:
    """One check; enters float64 again, which is a thread's own."""
    return within(limit, lambda: in_float64(CHECKS[name])(examination))


def _declared(claims: Claims, form: Form | Stepper) -> Stepper | None:
    """The stepper whose declared facts are claimed: a method by name, or what was brought."""
    if isinstance(form, Stepper) and claims.method in (None, form.label):
        return form
    return None if claims.method is None else stepper(claims.method)


def checked_claims(
    order: int | None = None,
    method: str | None = None,
    symplectic: bool | None = None,
    reversible: bool | None = None,
    conserves_energy: bool | None = None,
) -> Claims:
    """What is claimed, where it can be.

    Raises:
        InputError: the order is no whole number from 1 on, there is no such method, or both
            are given.
    """
    if order is not None:
        order = check_whole("expected_order", order, at_least=1, example="2")
    if method is not None:
        if order is not None:
            raise InputError(
                complaint(
                    "expected_order", order, "none beside a method, which has its own", "drop one"
                )
            )
        method = stepper(method).label
    return Claims(order, method, symplectic, reversible, conserves_energy)


def chosen_checks(only: Iterable[str] | None, skip: Iterable[str], quick: bool) -> list[str]:
    """Names of the checks to make, in their order.

    Raises:
        InputError: one does not exist, or none is left.
    """
    skip = [skip] if isinstance(skip, str) else list(skip)
    only = [only] if isinstance(only, str) else None if only is None else list(only)
    faults = [
        unknown("check", name, CHECKS) for name in (*(only or ()), *skip) if name not in CHECKS
    ]
    if faults:
        raise InputError(faults)
    left_out = {*skip, *(SLOW if quick and only is None else ())}
    names = [name for name in CHECKS if name not in left_out and (only is None or name in only)]
    if not names:
        raise InputError(complaint("only", only, "at least one check", "skip fewer"))
    return names
