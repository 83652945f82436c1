"""Grades trajectories from any program: does it solve the problem, and with which order?"""

from __future__ import annotations

import dataclasses
import functools
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ropeode.checking.claims import checked_claims
from ropeode.checking.convergence import finest_is_unstable
from ropeode.checking.diagnosis.rope_forces import has_rope_forces
from ropeode.checking.energy_drift import at_rest, measure_drift
from ropeode.checking.report import CheckReport, Claims, Diagnosis, Finding, exactly
from ropeode.checking.trajectories.checked_runs import checked_runs
from ropeode.checking.trajectories.convergence import order_finding
from ropeode.checking.trajectories.departures import departure
from ropeode.checking.trajectories.explanations import (
    Explanation,
    explain,
    explain_columns,
)
from ropeode.checking.trajectories.known_methods import same_method
from ropeode.checking.trajectories.more_runs import more_runs
from ropeode.checking.trajectories.other_ropes import other_rope
from ropeode.checking.trajectories.run_files import FEWEST, Files, Run, finite, names_of
from ropeode.checking.trajectories.time_errors import late_samples
from ropeode.problems import Problem
from ropeode.progress import Progress, bar, shows_progress
from ropeode.references import Reference, ReferenceOptions, problem_of, reference_for
from ropeode.simulation import step_size
from ropeode.steppers import as_stepper
from ropeode.study import problem_class

# In the order of the report.
GRADE_CHECKS = ("initial-state", "order", "pins", "energy")
# An observed order that is not 1.
_MORE_THAN_FIRST = 1.5
# A pinned node may move by so many units of rounding of the problem's size.
_PIN_ROUNDINGS = 500.0
# A problem conserves energy if a certified solution loses less than this part of the exchanged
# energy.
_CONSERVED = 1e-6
# Fewer samples do not distinguish a drift from an oscillation.
_MANY_SAMPLES = 64


@shows_progress
def grade(
    files: Sequence[str | Path],
    problem: Problem | Reference,
    dts: ArrayLike | None = None,
    expected_order: int | None = None,
    *,
    method: str | None = None,
    damped_order: int | None = None,
    accuracy: float | None = None,
    rtol: float | None = None,
    diagnose: bool = True,
    progress: Progress = bar,
    **asked: Any,
) -> CheckReport:
    """Compare trajectories of one program, with several step sizes, with a certified reference.

    Files are read one after the other, and only the samples at the problem's sample times are kept.
    docs/howto/grade.md describes their format.

    Arguments:
        files: CSV, NPZ or NetCDF, at least three, one for each step size.
        problem: the problem that the program should solve, or a reference of it.
        dts: step size of each file; None if the files contain it, or their names the steps per
            frame.
        expected_order: the order that the program should have; None to measure it.
        method: the stepper of ropeode that the program is meant to be, in place of an order.
        damped_order: the order that is enough if the problem has damping, as 1 for velocity Verlet
            with forces from the velocity at the start of the step.
        accuracy: as for `ropeode.reference`.
        rtol: as for `ropeode.reference`.
        diagnose: look for the cause if the order is wrong or not claimed.
        progress: called with the current task and the fraction that is done.
        asked: `level`, `digits` and `time_limit` of `ropeode.reference`.

    Returns:
        The report; ``report.passed`` is the verdict.

    Raises:
        InputError: an argument or a file cannot be used; one line for each, with the place.
        ReferenceRefused: no reference of the problem can be certified.

    Examples:
        >>> import numpy as np
        >>> from ropeode import Rope, grade, simulate
        >>> rope = Rope(num_nodes=4).problem(frames=3)
        >>> files = ["16.npz", "32.npz", "64.npz"]
        >>> for file, steps in zip(files, [16, 32, 64]):
        ...     run = simulate(rope, "rk4", steps)
        ...     np.savez(file, dt=run.dt, t=run.times, positions=run.positions)
        >>> grade(files, rope, expected_order=4).verdict
        'right'
    """
    started = time.perf_counter()
    claims = checked_claims(Claims(expected_order, method, damped_order=damped_order))
    own = problem_of(problem)
    expected = claims.order_on(problem_class(own))
    if claims.method is not None:
        stepper = as_stepper(claims.method)
        stepper.require(own)
        expected = stepper.order(problem_class(own))
    options = ReferenceOptions(accuracy=accuracy, rtol=rtol, **asked)

    @functools.cache
    def certified() -> Reference:
        return reference_for(problem, options, lambda text, _: progress(text, 0.9))

    runs, off = checked_runs(
        files, own, dts, certified, lambda text, share: progress(text, 0.9 * (share or 0.0))
    )
    reference, known = certified(), finite(runs)

    @functools.cache
    def other() -> Diagnosis | None:
        return other_rope(reference, known, lambda problem: reference_for(problem, options))

    @functools.cache
    def program(changes: int = 1) -> Diagnosis | None:
        # What needs fewer changes is none with more of them.
        fewer = changes > 1 and program() is not None
        return None if fewer else _program(reference, runs, changes)

    @functools.cache
    def departs() -> Diagnosis | None:
        return departure(reference, known)

    own_files = Files(files, own, dts)
    order, notes = _order(reference, runs, own_files, claims, expected, other, departs, program)
    findings = (
        Finding("initial-state", "pass", f"the first sample is the initial state {exactly(off)}"),
        order,
        _pins_finding(reference, runs),
        _energy_finding(reference, runs),
    )
    diagnosis: tuple[Diagnosis, ...] = ()
    wrong = order.status == "fail"
    mistake = program() if diagnose and wrong else None
    if diagnose and wrong and len(known) < FEWEST:
        mistake = mistake or program(2)
    if mistake is not None and mistake.cause != "method":
        diagnosis = (_or_so_written(reference, known, mistake),)
    elif diagnose and len(known) >= FEWEST and (wrong or expected is None):
        progress("diagnosis", 0.95)
        late = late_samples(reference, known)
        if wrong and late is None and mistake and _refutes(mistake, claims, expected):
            diagnosis = (mistake,)
        elif wrong:
            causes = (expected, late, other, departs, program)
            diagnosis = _diagnosed(reference, known, own_files, order, *causes)
        elif late is not None and _is_unintended(late, order):
            # No claim is refuted, but such a program is hardly intended.
            notes = (*notes, "; ".join(filter(None, (late.line, late.remedy))))
    progress("done", 1.0)
    return CheckReport(
        label=names_of(runs),
        claims=claims,
        findings=findings,
        diagnosis=diagnosis,
        notes=(*notes, *_notes(runs, reference, order)),
        seconds=time.perf_counter() - started,
    )


def _order(
    reference: Reference,
    runs: Sequence[Run],
    files: Files,
    claims: Claims,
    expected: int | None,
    other: Callable[[], Diagnosis | None],
    departs: Callable[[], Diagnosis | None],
    program: Callable[..., Diagnosis | None],
) -> tuple[Finding, tuple[str, ...]]:
    """The verdict on convergence; no order is needed if a mistake in the files explains all."""
    finding, notes = order_finding(reference, runs, expected)
    if finding.status == "pass":
        named = program() if _is_symplectic(claims) else None
        if named is None or not _refutes(named, claims, expected):
            return finding, notes
        line = f"{finding.line}; claimed to be {claims.method}, but {named.line}"
        return dataclasses.replace(finding, status="fail", line=line), ()
    if (named := program()) is not None and named.cause == "float32":
        line = f"{finding.line}: {named.line}; {named.remedy}"
        return dataclasses.replace(finding, status="undetermined", line=line), ()
    if finding.status == "fail":
        return finding, notes
    if named is not None and _refutes(named, claims, expected):
        return _refuted(finding, named), ()
    known = finite(runs)
    if len(known) >= FEWEST:
        late = late_samples(reference, known)
        # Half a step may be the error of a method of order 1.
        if late is not None and late.cause != "sample-time":
            return Finding("order", "fail", f"no order; {late.line}", late.evidence), ()
        if (later := departs()) is not None:
            return Finding("order", "fail", f"no order; {later.line}", later.evidence), ()
        written = explain(reference, known, files, coarse=False)
        if written is not None and not written.like_another_problem:
            return Finding("order", "fail", f"no order; {written.words}"), ()
        if other() is not None:
            return Finding("order", "fail", "no order; the files fit another rope"), ()
    # Of all changes to the program, two at once take the longest to find.
    if (named := program(2)) is not None:
        return _refuted(finding, named), ()
    # Not above: it runs steppers, which takes longer than all the rest.
    if (same := same_method(reference, runs)) is not None:
        stable = finding.convergence is not None and not finest_is_unstable(finding.convergence)
        if stable and same.shows(expected):
            return dataclasses.replace(finding, status="pass", line=same.line), ()
        if same.refutes(expected):
            return Finding("order", "fail", f"no order; {same.line}"), ()
    advice = functools.partial(more_runs, reference, runs, claims, expected)
    return order_finding(reference, runs, expected, advice)


def _refuted(finding: Finding, named: Diagnosis) -> Finding:
    """Without an order, the program that is named decides."""
    evidence = {**finding.evidence, **named.evidence}
    line = f"no order; {named.line}"
    return dataclasses.replace(finding, status="fail", line=line, evidence=evidence)


def _is_symplectic(claims: Claims) -> bool:
    """Whether a symplectic method is claimed."""
    return claims.method is not None and bool(as_stepper(claims.method).symplectic)


def _refutes(named: Diagnosis, claims: Claims, expected: int | None) -> bool:
    """Whether the program that computes the positions is not what is claimed."""
    if named.cause != "method":
        return True
    # Methods that are the same here tell nothing of each other.
    if "methods" in named.evidence:
        return False
    too_low = expected is not None and named.evidence["order"] < expected
    return too_low or (_is_symplectic(claims) and not named.evidence["symplectic"])


def _program(reference: Reference, runs: Sequence[Run], changes: int) -> Diagnosis | None:
    """The program whose numbers are those of the runs in their first frames.

    Arguments:
        reference: of the problem.
        runs: from coarse to fine.
        changes: how many, 2 where no program with at most 1 was found.
    """
    # Not above: right programs do not need it.
    from ropeode.checking.diagnosis.program_words import diagnose_program

    states = [(run.dt, run.states) for run in runs]
    return diagnose_program(reference.problem, states, reference.states, changes)


def _or_so_written(reference: Reference, runs: Sequence[Run], mistake: Diagnosis) -> Diagnosis:
    """The mistake of a program, with one in writing its files that would look the same."""
    if mistake.cause != "parameters" or len(runs) < FEWEST:
        return mistake
    written = explain_columns(reference, runs)
    if written is None or not written.like_another_problem:
        return mistake
    line = f"{mistake.line}; or, which is the same in the files, {written.line}"
    return dataclasses.replace(mistake, line=line)


def _pins_finding(reference: Reference, runs: Sequence[Run]) -> Finding:
    """Whether pinned nodes stay in place."""
    problem, dim = reference.problem, runs[0].layout.dim
    free = getattr(problem.args, "free", None)
    if free is None or np.all(free):
        return Finding("pins", "skip", "nothing is pinned")
    pinned = np.flatnonzero(np.asarray(free) == 0.0)
    worst, line = 0.0, ""
    for run in runs:
        places = run.values[: run.reached, pinned, :dim]
        moved = np.max(np.abs(places - places[0]), axis=2)
        largest = float(np.max(moved))
        if largest > max(worst, _PIN_ROUNDINGS * run.epsilon * problem.scale):
            sample, node = np.unravel_index(np.argmax(moved), moved.shape)
            line = (
                f"pinned node {pinned[node]} is {largest:.1e} away from its place at t = "
                f"{problem.ts[sample]:g} (dt = {run.dt:g})"
            )
        worst = max(worst, largest)
    if line:
        return Finding("pins", "fail", line, {"moved": worst})
    return Finding("pins", "pass", f"pinned nodes stay in place {exactly(worst)}", {"moved": worst})


def _energy_finding(reference: Reference, runs: Sequence[Run]) -> Finding:
    """How the energy behaves at the largest and smallest steps, if the problem conserves it."""
    problem = reference.problem
    if problem.energy is None or problem.mechanics is None:
        return Finding("energy", "skip", "the problem has no energy")
    if runs[0].quantities != problem.quantities:
        return Finding("energy", "skip", "the files have no velocities")
    states = reference.states[: reference.trusted]
    energies = problem.energies(states)
    exchanged = float(np.ptp(energies - problem.energies(at_rest(states))))
    if exchanged == 0.0 or np.ptp(energies) > _CONSERVED * exchanged:
        return Finding("energy", "skip", "the problem does not conserve its energy")
    if len(problem.ts) < _MANY_SAMPLES:
        return Finding(
            "energy",
            "skip",
            f"needs {_MANY_SAMPLES} samples to distinguish a drift from an oscillation",
        )
    lines, evidence = [], {}
    with np.errstate(all="ignore"):
        for run in (runs[0], runs[-1]):
            drift = measure_drift(problem, run.states)
            lines.append(f"dt {run.dt:g}: {drift.line}")
            evidence[f"{run.dt:g}"] = {"verdict": drift.verdict, **drift.evidence}
    return Finding("energy", "note", "; ".join(lines), evidence)


def _is_unintended(late: Diagnosis, order: Finding) -> bool:
    """Whether late samples lower the order: a method of order 1 may have such errors anyway."""
    orders = {} if order.convergence is None else order.convergence.orders
    others = [each.observed for name, each in orders.items() if name not in late.evidence["late"]]
    return late.evidence["late"] != ["position"] and all(
        observed is not None and observed > _MORE_THAN_FIRST for observed in others
    )


def _diagnosed(
    reference: Reference,
    runs: Sequence[Run],
    files: Files,
    order: Finding,
    expected: int | None,
    late: Diagnosis | None,
    other: Callable[[], Diagnosis | None],
    departs: Callable[[], Diagnosis | None],
    program: Callable[..., Diagnosis | None],
) -> tuple[Diagnosis, ...]:
    """What is wrong with the files, or what they solve instead of the problem."""
    if (found := late or departs()) is not None:
        return (found,)
    written = explain(reference, runs, files)
    if written is not None and not written.like_another_problem:
        return (_of_files(written),)
    if (rope := other()) is not None:
        return (rope,)
    if (both := program(2)) is not None:
        return (_or_so_written(reference, runs, both),)
    orders = {} if order.convergence is None else order.convergence.orders
    if all(each.verdict == "converges" for each in orders.values()) and (named := program()):
        return (named,)
    solved = _solved(reference, runs)
    if solved[0].cause == "unknown" and not has_rope_forces(reference.problem):
        # Of ropes the methods have been tried already.
        same = same_method(reference, runs)
        if same is not None and same.refutes(expected):
            return (same.diagnosis(reference.problem),)
    if written is None:
        return tuple(_with_what_is_right(each, order) for each in solved)
    if solved[0].cause == "unknown":
        read_so = _of_files(written)
        line = (
            f"{read_so.line}; or the program solves the problem with that change, which is the same"
        )
        return (dataclasses.replace(read_so, line=line),)
    line = f"{solved[0].line}; or, which is the same in the files, {written.line}"
    return (dataclasses.replace(solved[0], line=line), *solved[1:])


def _of_files(written: Explanation) -> Diagnosis:
    """The diagnosis that a program solves the problem, and writes it wrongly."""
    evidence = {"read_so": written.agreement}
    line, remedy = written.line, written.fix
    if (late := late_samples(written.reference, written.runs)) is not None:
        line += f". Moreover, {late.line}"
        remedy = "; ".join(filter(None, (remedy, late.remedy)))
        evidence |= late.evidence
    return Diagnosis(written.cause, line, evidence, remedy)


def _with_what_is_right(diagnosis: Diagnosis, order: Finding) -> Diagnosis:
    """An unknown cause, with the quantities that converge to the solution if others do not."""
    orders = {} if order.convergence is None else order.convergence.orders
    right = {name: each for name, each in orders.items() if each.verdict == "converges"}
    wrong = [name for name, each in orders.items() if each.verdict == "does not converge"]
    if diagnosis.cause != "unknown" or not right or not wrong:
        return diagnosis
    words = " and ".join(f"{name} (order {each.observed:.2f})" for name, each in right.items())
    line = f"{diagnosis.line}. Only {' and '.join(wrong)} is wrong; right is {words}"
    return dataclasses.replace(diagnosis, line=line)


def _solved(reference: Reference, runs: Sequence[Run]) -> tuple[Diagnosis, ...]:
    """What the runs solve instead of the problem."""
    # Not above: right programs do not need it.
    from ropeode.checking.diagnosis.trajectories import diagnose_trajectories

    problem, quantities = reference.problem, runs[0].quantities
    states = [(run.dt, run.states.copy()) for run in runs]
    if len(quantities) < len(problem.quantities):
        for _, each in states:
            each[:, 1] = np.nan
    with np.errstate(all="ignore"):  # Runs that blew up have huge numbers.
        return diagnose_trajectories(problem, reference, states, quantities)


def _notes(runs: Sequence[Run], reference: Reference, order: Finding) -> list[str]:
    notes = [
        f"the run with dt = {run.dt:g} diverged at t = {run.diverged.time:g} "
        f"({run.diverged.where}: {run.diverged.given:g}), and does not count"
        for run in runs
        if run.diverged is not None
    ]
    notes += [
        f"{run.path.name}: dt = {run.dt:g} does not divide the {run.interval:g} between samples; "
        "the last step before each sample must be shorter"
        for run in finite(runs)
        if run.uneven and order.status != "pass"
    ]
    if reference.horizon is not None:
        notes.append(
            f"only samples before t = {reference.horizon:g} count, where the reference is trusted"
        )
    if runs[0].named:
        one = step_size(reference.problem, 1)
        steps = ", ".join(f"{one / run.dt:g} in {run.path.name}" for run in runs)
        notes.append(f"steps per frame are those of the file names: {steps}")
    if runs[0].quantities != reference.problem.quantities:
        notes.append("the files have no velocities: only positions are graded")
    return notes
