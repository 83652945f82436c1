"""Grades trajectories from any program: does it solve the problem, and with which order?"""

from __future__ import annotations

import dataclasses
import functools
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ropeode.analysis import ObservedOrder
from ropeode.checking.convergence import finest_is_unstable
from ropeode.checking.diagnosis.rope_forces import has_rope_forces
from ropeode.checking.energy_drift import at_rest, measure_drift
from ropeode.checking.report import CheckReport, Claims, Diagnosis, Finding, exactly
from ropeode.checking.trajectories.checked_runs import checked_runs, explain, explain_columns
from ropeode.checking.trajectories.columns import Explanation
from ropeode.checking.trajectories.convergence import order_finding
from ropeode.checking.trajectories.departures import departure
from ropeode.checking.trajectories.known_methods import Identity, same_method
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

    Only the samples at the problem's sample times count.
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
    claims = Claims(expected_order, method, damped_order=damped_order)
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

    asked_of = Files(files, own, dts)
    runs = checked_runs(
        asked_of, certified, lambda text, share: progress(text, 0.9 * (share or 0.0))
    )
    reference = certified()
    causes = _Causes(reference, runs, asked_of, claims, expected, options)
    order, notes, cause = _judged(causes, diagnose=diagnose)
    off = max(float(np.max(run.first_errors)) for run in runs)
    findings = (
        Finding("initial-state", "pass", f"the first sample is the initial state {exactly(off)}"),
        order,
        _pins_finding(reference, runs),
        _energy_finding(reference, runs),
    )
    if diagnose and order.status != "fail" and expected is None:
        late = causes.late
        if late is not None and _is_unintended(late, order):
            # No claim is refuted, but such a program is hardly intended.
            notes = (*notes, "; ".join(filter(None, (late.line, late.remedy))))
    progress("done", 1.0)
    return CheckReport(
        label=names_of(runs),
        claims=claims,
        findings=findings,
        diagnosis=() if cause is None else (cause,),
        notes=(*notes, *_notes(runs, reference)),
        seconds=time.perf_counter() - started,
    )


@dataclasses.dataclass(frozen=True)
class _Causes:
    """What may be wrong with a program or its files, sought when it is needed.

    Arguments:
        reference: of the problem.
        runs: from coarse to fine.
        files: of the runs.
        claims: of the author.
        expected: the order that follows from them.
        options: of references.
    """

    reference: Reference
    runs: Sequence[Run]
    files: Files
    claims: Claims
    expected: int | None
    options: ReferenceOptions

    @functools.cached_property
    def known(self) -> tuple[Run, ...]:
        """The runs that did not diverge."""
        return tuple(finite(self.runs))

    @functools.cached_property
    def late(self) -> Diagnosis | None:
        """Samples of another time."""
        return late_samples(self.reference, self.known) if len(self.known) >= FEWEST else None

    @functools.cached_property
    def program(self) -> Diagnosis | None:
        """The program that computes the runs, with one change at most."""
        return self._program(1)

    @functools.cached_property
    def same(self) -> Identity | None:
        """The method of ropeode that computes the runs."""
        return same_method(self.reference, self.runs)

    def _program(self, changes: int) -> Diagnosis | None:
        # Not above: right programs do not need it.
        from ropeode.checking.diagnosis.program_words import diagnose_program

        states = [(run.dt, run.states) for run in self.runs]
        return diagnose_program(self.reference.problem, states, self.reference.states, changes)

    @property
    def claims_symplectic(self) -> bool:
        """Whether a symplectic method is claimed."""
        method = self.claims.method
        return method is not None and bool(as_stepper(method).symplectic)

    @property
    def is_refuted(self) -> bool:
        """Whether the program that computes the positions is not what is claimed."""
        program = self.program
        if program is None or program.cause != "method":
            return program is not None
        # Methods that are the same here tell nothing of each other.
        if "methods" in program.evidence:
            return False
        too_low = self.expected is not None and program.evidence["order"] < self.expected
        return too_low or (self.claims_symplectic and not program.evidence["symplectic"])

    def sought(self, order: Finding) -> Iterator[Diagnosis]:
        """The causes in turn, of which the first counts.

        Arguments:
            order: a verdict; where it is `undetermined` those are left out that need an order.
        """
        reference, known, program = self.reference, self.known, self.program
        wrong, several, written = order.status == "fail", len(known) >= FEWEST, None
        if program is not None and program.cause != "method":
            yield self._or_so_written(program)
        # Half a step may be the error of a method of order 1.
        if (late := self.late) is not None and (wrong or late.cause != "sample-time"):
            yield late
        if program is not None and self.is_refuted:
            yield program
        if several:
            if (departs := departure(reference, known)) is not None:
                yield departs
            written = explain(lambda: reference, self.files, known, coarse=wrong)
            if written is not None and not written.like_another_problem:
                yield written.diagnosis
            certified = functools.partial(reference_for, options=self.options)
            if (other := other_rope(reference, known, certified)) is not None:
                yield other
        # Of all changes to the program, two at once take the longest to find.
        if program is None and (both := self._program(2)) is not None:
            yield self._or_so_written(both)
        # Of ropes with an order, the methods have been tried as programs.
        same = None if wrong and has_rope_forces(reference.problem) else self.same
        if same is not None and same.refutes(self.expected):
            yield same.diagnosis(reference.problem)
        if several and wrong:
            yield self._of_the_limit(order, written)

    def _or_so_written(self, mistake: Diagnosis) -> Diagnosis:
        """The mistake of a program, with one in writing its files that would look the same."""
        if mistake.cause != "parameters" or len(self.known) < FEWEST:
            return mistake
        written = explain_columns(self.reference, self.known)
        if written is None or not written.like_another_problem:
            return mistake
        line = f"{mistake.line}; or, which is the same in the files, {written.line}"
        return dataclasses.replace(mistake, line=line)

    def _of_the_limit(self, order: Finding, written: Explanation | None) -> Diagnosis:
        """What the runs solve instead of the problem; or files so written look the same."""
        # Not above: right programs do not need it.
        from ropeode.checking.diagnosis.trajectories import diagnose_trajectories

        if self.program and all(each.verdict == "converges" for each in _orders(order).values()):
            return self.program
        states = [(run.dt, run.states) for run in self.known]
        with np.errstate(all="ignore"):  # Runs that blew up have huge numbers.
            solved = diagnose_trajectories(self.reference, states, self.known[0].quantities)
        if written is None:
            return solved
        if solved.cause == "unknown":
            solved = written.diagnosis
            also = "the program solves the problem with that change, which is the same"
        else:
            also = f"which is the same in the files, {written.line}"
        return dataclasses.replace(solved, line=f"{solved.line}; or {also}")


def _judged(
    causes: _Causes, *, diagnose: bool
) -> tuple[Finding, tuple[str, ...], Diagnosis | None]:
    """The verdict on convergence, its notes, and the cause if it is wrong.

    Arguments:
        causes: of what may be wrong.
        diagnose: whether a cause is sought where the verdict does not need it.
    """
    reference, runs, expected = causes.reference, causes.runs, causes.expected
    finding, notes = order_finding(reference, runs, expected)
    if finding.status == "pass":
        if not (causes.claims_symplectic and causes.is_refuted and (named := causes.program)):
            return finding, notes, None
        line = f"{finding.line}; claimed to be {causes.claims.method}, but {named.line}"
        finding, notes = dataclasses.replace(finding, status="fail", line=line), ()
    elif (named := causes.program) is not None and named.cause == "float32":
        line = f"{finding.line}: {named.line}; {named.remedy}"
        return dataclasses.replace(finding, status="undetermined", line=line), (), None
    if finding.status == "fail":
        return finding, notes, next(causes.sought(finding), None) if diagnose else None
    if (cause := next(causes.sought(finding), None)) is not None:
        # Without an order, a cause that is named decides.
        evidence = {**finding.evidence, **cause.evidence}
        line = f"no order; {cause.line}"
        return (
            dataclasses.replace(finding, status="fail", line=line, evidence=evidence),
            (),
            cause if diagnose else None,
        )
    stable = finding.convergence is not None and not finest_is_unstable(finding.convergence)
    if stable and causes.same is not None and causes.same.shows(expected):
        return dataclasses.replace(finding, status="pass", line=causes.same.line), (), None
    advice = functools.partial(more_runs, reference, runs, causes.claims.method, expected)
    return *order_finding(reference, runs, expected, advice), None


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


def _orders(order: Finding) -> Mapping[str, ObservedOrder]:
    """Those of each quantity, where any were observed."""
    return {} if order.convergence is None else order.convergence.orders


def _is_unintended(late: Diagnosis, order: Finding) -> bool:
    """Whether late samples lower the order: a method of order 1 may have such errors anyway."""
    others = [
        each.observed for name, each in _orders(order).items() if name not in late.evidence["late"]
    ]
    return late.evidence["late"] != ["position"] and all(
        observed is not None and observed > _MORE_THAN_FIRST for observed in others
    )


def _notes(runs: Sequence[Run], reference: Reference) -> list[str]:
    notes = [
        f"the run with dt = {run.dt:g} diverged at t = {run.diverged.time:g} "
        f"({run.diverged.where}: {run.diverged.given:g}), and does not count"
        for run in runs
        if run.diverged is not None
    ]
    if reference.horizon is not None:
        notes.append(
            f"only samples before t = {reference.horizon:g} count, where the reference is trusted"
        )
    if runs[0].named:
        one = step_size(reference.problem, 1)
        steps = ", ".join(f"{one / run.dt:g} in {run.path.name}" for run in runs)
        notes.append(f"steps per frame go by the file names: {steps}")
    if runs[0].quantities != reference.problem.quantities:
        notes.append("the files have no velocities: only positions are graded")
    return notes
