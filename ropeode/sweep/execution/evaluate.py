"""The rows of a task: every case is compared with a certified reference."""

from __future__ import annotations

import contextlib
import itertools
import time
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ropeode.analysis import (
    classify_motion,
    distance_of_runs,
    error_series,
    in_other_units,
    keeps_units,
    moved,
    resolution,
)
from ropeode.errors import InputError
from ropeode.norms import Norm, norm_for
from ropeode.problems import Ensemble, Problem, family_of
from ropeode.references import Reference
from ropeode.simulation import Method, Trajectory, method_of, simulate, step_size
from ropeode.steppers import Stepper
from ropeode.study import order_of
from ropeode.sweep.design.cases import Case, Settings, Task
from ropeode.sweep.design.columns import RESULTS, Row, failed_row
from ropeode.sweep.design.content_hash import software
from ropeode.sweep.design.problem_factory import ProblemFactory, problem_factory
from ropeode.sweep.design.steppers import stepper_from
from ropeode.sweep.execution.parts import Part
from ropeode.sweep.execution.references import references_of
from ropeode.theory import MOST_STEPS_OF_GROWTH, stability_limit
from ropeode.validation import in_one_line

# After so many seconds the rows that are finished are handed back, to be written. With fewer, much
# that problems share would be computed for few of them.
PART_S = 60.0


def evaluate(task: Task, folder: Path, seconds: float = PART_S) -> list[Row]:
    """Compute the rows of a task, in the order of its cases, or of its first problems.

    But for their `seconds` they are the same whatever process computes them and whatever else is
    in the task. If a case cannot be run, its row says why.

    Arguments:
        task: to compute.
        folder: of the sweep, where references are kept.
        seconds: where the whole task takes longer, the rows of its first problems are
            returned: of as many as that suffices for, and of one at least.

    Raises:
        InputError: a reference cannot be written; or this process has other software, or
            another file of the problem or of a stepper, than the keys were computed with, so
            that its rows would not be those of the keys.
    """
    settings = task.cases[0].settings
    factory = _factory(settings)
    steppers = {
        label: stepper_from(settings.steppers[label], settings.folder)
        for label in dict.fromkeys(case.stepper for case in task.cases)
    }
    rows: dict[str, Row] = {}
    built: dict[str, tuple[Problem, Norm]] = {}
    for key, cases in _grouped(task.cases, lambda case: case.problem_key).items():
        try:
            problem = factory.build(cases[0].parameters)
            built[key] = problem, norm_for(problem, settings.norm)
        except Exception as error:
            rows |= _failed(cases, error)
    began = time.perf_counter()
    references = references_of(
        folder,
        {key: problem for key, (problem, _) in built.items()},
        settings.reference_options,
        keep=settings.keep_references,
        seconds=seconds / 2.0,
    )
    subjects = {key: subject(*built[key], outcome) for key, outcome in references.items()}
    part = Part([key for key in built if key in subjects], seconds / 2.0)
    runnable = [case for case in task.cases if case.problem_key in subjects]
    each = (time.perf_counter() - began) / max(1, len(runnable))
    for label, cases in _grouped(runnable, lambda case: case.stepper).items():
        for key, row in _rows_of_stepper(steppers[label], cases, subjects, part).items():
            rows[key] = {**row, "seconds": each + row["seconds"]}
    return [rows[case.key] for case in itertools.takewhile(lambda c: c.key in rows, task.cases)]


def _grouped(cases: Iterable[Case], by: Callable[[Case], str]) -> dict[str, list[Case]]:
    groups: dict[str, list[Case]] = {}
    for case in cases:
        groups.setdefault(by(case), []).append(case)
    return groups


def _factory(settings: Settings) -> ProblemFactory:
    """The factory of a task's problems; raises as `evaluate` does."""
    here = software()
    if different := [name for name in here if here[name] != settings.software.get(name)]:
        versions = ", ".join(
            f"{name} {here[name]} and not {settings.software.get(name)}" for name in different
        )
        raise InputError(
            f"worker: it has {versions}; allowed: the software that the sweep was started with. "
            "Fix: install the same versions on all machines."
        )
    factory = problem_factory(settings.problem, settings.folder)
    if factory.identity != settings.identity:
        raise InputError(
            f"problem: {settings.problem} has been changed since the sweep was started; allowed: "
            "the same file in all processes. Fix: start the sweep again."
        )
    return factory


def _failed(cases: Sequence[Case], error: Exception) -> dict[str, Row]:
    reason = in_one_line(error)
    return {case.key: failed_row(case.inputs(), "failed", reason) for case in cases}


def _rows_of_stepper(
    stepper: Stepper, cases: Sequence[Case], subjects: Mapping[str, Subject], part: Part
) -> dict[str, Row]:
    """The rows of the cases of one stepper, by key, for the problems of a part of a task."""
    own = {case.steps_per_frame for case in cases}
    users = Counter(
        (case.problem_key, n) for case in cases for n in _ladder(case, subjects[case.problem_key])
    )
    # All runs that the cases need, each made once, by problem and number of steps.
    runs: dict[tuple[str, int], Run] = {}
    took: dict[tuple[str, int], float] = {}

    def run(keys: Sequence[str], n: int) -> float:
        """The seconds that it takes to run the stepper on some problems."""
        began = time.perf_counter()
        results = run_all([subjects[key] for key in keys], stepper, n, n in own)
        seconds = time.perf_counter() - began
        for key, result in zip(keys, results, strict=True):
            runs[key, n], took[key, n] = result, seconds / len(keys)
        return seconds

    compiled = _is_compiled(stepper, subjects[cases[0].problem_key])
    for at, n in enumerate(dict.fromkeys(n for _, n in users) if compiled else ()):
        # If one of the problems raises, each is run alone below, so that the others have rows.
        with contextlib.suppress(Exception):
            seconds = run([key for key in part.keys if (key, n) in users], n)
            # In the first the program is compiled, which serves all numbers of steps.
            part.spend(seconds if at else 0.0)
    rows: dict[str, Row] = {}
    for key, of_problem in _grouped(cases, lambda case: case.problem_key).items():
        if key not in part.keys:
            continue
        of, stability, began = subjects[key], {}, time.perf_counter()
        for case in of_problem:
            start, steps = time.perf_counter(), _ladder(case, of)
            try:
                for n in steps:
                    if (key, n) not in runs:
                        run([key], n)
                start = time.perf_counter()
                if case.settings.largest_stable_dt and not stability:
                    stability = _stability(of.problem, stepper)
                ladder = {n: runs[key, n] for n in steps}
                rows[case.key] = _row(case, of, stepper, ladder, stability)
            except Exception as error:
                rows |= _failed([case], error)
            shares = (took.get((key, n), 0.0) / users[key, n] for n in steps)
            rows[case.key]["seconds"] = time.perf_counter() - start + sum(shares)
        if not compiled:
            part.spend(time.perf_counter() - began, finished=part.keys.index(key) + 1)
    return rows


def _is_compiled(stepper: Stepper, of: Subject) -> bool:
    """Whether JAX compiles the stepper's runs, so that many problems are run side by side."""
    try:
        return method_of(stepper, of.problem).trial.compiled
    except Exception:
        # The rows say what it raises.
        return False


def _ladder(case: Case, of: Subject) -> list[int]:
    """The numbers of steps that a case needs, its own first."""
    factors = case.settings.order_factors if of.reference is not None else ()
    return [case.steps_per_frame * factor for factor in (factors or (1,))]


def _row(
    case: Case, of: Subject, stepper: Stepper, ladder: Mapping[int, Run], stability: Row
) -> Row:
    """The row of a case, from the runs on its ladder."""
    own = ladder[case.steps_per_frame]
    row = {**case.inputs(), **dict.fromkeys(RESULTS), **own._asdict(), **stability}
    reasons = [stability.get("reason"), of.refusal]
    if own.status == "diverged":
        reasons.insert(1, f"no longer finite at frame {own.diverged_at}")
    if own.status == "unsolved":
        reasons.insert(1, f"equations of a step not solved at frame {own.diverged_at}")
    if of.reference is not None:
        finest = float(resolution(of.reference, of.norm)[-1])
        row |= {
            "reference": case.problem_key,
            "trusted": of.reference.trusted,
            "horizon": of.reference.horizon,
            "horizon_reason": of.reference.certificate.horizon_reason,
            "resolution": finest,
            "motion_size": of.motion_size,
        }
        if case.settings.order_factors:
            row |= _order(of, stepper, ladder, finest)
    elif own.status == "ok":
        row["status"] = "no-reference"
    return {**row, "reason": "; ".join(filter(None, reasons)) or None}


def _order(of: Subject, stepper: Stepper, ladder: Mapping[int, Run], finest: float) -> Row:
    """The observed order from the runs with several numbers of steps."""
    result = order_of(of.problem, stepper, [*ladder.values()], finest, of.motion_size)
    order = result.order
    steps = {run.dt: n for n, run in ladder.items()}
    left_out: dict[str, list[int]] = {}
    for each in order.left_out:
        left_out.setdefault(each.reason, []).append(steps[each.dt])
    low, high = order.ci95 or (None, None)
    return {
        "observed_order": order.observed,
        "order_low": low,
        "order_high": high,
        "order_verdict": order.verdict,
        "order_used": _listed(steps[dt] for dt in order.used),
        "order_left_out": "; ".join(f"{why}: {_listed(ns)}" for why, ns in left_out.items()),
        "order_why": order.why,
        "expected_order": result.expected,
    }


def _listed(numbers: Iterable[int]) -> str:
    return ", ".join(map(str, sorted(numbers)))


def _stability(problem: Problem, stepper: Stepper) -> Row:
    try:
        limit = stability_limit(problem, stepper)
    except InputError as error:
        return {"reason": f"no largest stable dt: {in_one_line(error)}"}
    if limit is None:
        return {
            "reason": f"no largest stable dt: unstable at {MOST_STEPS_OF_GROWTH} steps per frame"
        }
    return {"stability_limit": limit, "largest_stable_dt": step_size(problem, limit)}


class Subject(NamedTuple):
    """A problem, with all that its runs need.

    Fields:
        problem: that is solved.
        rescaled: the same in other units.
        norm: in which errors are measured.
        reference: None if there is none.
        refusal: why there is none.
        motion_size: how far it moves inside the horizon; infinite without a reference.
        family: equal for problems that can be run side by side, in other units too.
    """

    problem: Problem
    rescaled: Problem
    norm: Norm
    reference: Reference | None
    refusal: str | None
    motion_size: float
    family: Hashable


def subject(problem: Problem, norm: Norm, outcome: Reference | str) -> Subject:
    """A problem, ready to be run.

    Arguments:
        problem: that is solved.
        norm: in which errors are measured.
        outcome: the reference up to its trust horizon, or why there is none.
    """
    rescaled, alike = in_other_units(problem), family_of(problem)
    if not isinstance(outcome, Reference):
        return Subject(problem, rescaled, norm, None, outcome, np.inf, alike)
    return Subject(problem, rescaled, norm, outcome, None, moved(outcome, norm), alike)


class Run(NamedTuple):
    """The results of a run, in the columns of the same names; see `columns.RESULTS`.

    Errors, `resolved` and `round_off` are None without a reference. `round_off` is also None if
    the stepper computes forces of its own, and what describes motion if it was not requested.
    """

    dt: float
    status: str
    diverged_at: int | None
    rhs_evaluations: int | None
    error_final: float | None = None
    error_max: float | None = None
    error_rms: float | None = None
    resolved: bool | None = None
    round_off: float | None = None
    motion: str | None = None
    swings: int | None = None
    settled_at: int | None = None


def run_all(
    subjects: Sequence[Subject], stepper: Stepper, steps_per_frame: int, with_motion: bool
) -> list[Run]:
    """Run a stepper on many problems, and again in other units where there is a reference.

    Each run is independent of the others.

    Arguments:
        subjects: the problems.
        stepper: that is run.
        steps_per_frame: equal steps in each frame.
        with_motion: whether to describe the motion of ropes.
    """
    families: dict[Hashable, list[int]] = {}
    for index, each in enumerate(subjects):
        families.setdefault(each.family, []).append(index)
    runs: dict[int, Run] = {}
    for indices in families.values():
        members = [subjects[index] for index in indices]
        method = method_of(stepper, members[0].problem)
        trajectories = _side_by_side([each.problem for each in members], method, steps_per_frame)
        first = dict(zip(indices, trajectories, strict=True))
        again = [
            index
            for index, run in first.items()
            if (of := subjects[index]).reference is not None
            and run.status == "ok"
            and keeps_units(of.problem, method, of.rescaled)
        ]
        rescaled = [subjects[index].rescaled for index in again]
        repeated = dict(zip(again, _side_by_side(rescaled, method, steps_per_frame), strict=True))
        for index, run in first.items():
            runs[index] = _run(subjects[index], run, repeated.get(index), with_motion)
    return [runs[index] for index in range(len(subjects))]


def _run(
    of: Subject, trajectory: Trajectory, repeated: Trajectory | None, with_motion: bool
) -> Run:
    run = Run(
        dt=trajectory.dt,
        status=trajectory.status,
        diverged_at=trajectory.diverged_at,
        rhs_evaluations=trajectory.rhs_evaluations,
        resolved=None if of.reference is None else False,
        **(_motion(trajectory) if with_motion else {}),
    )
    if of.reference is None or run.status != "ok":
        return run
    series = error_series(trajectory, of.reference, of.norm.name)
    if repeated is not None:
        round_off = distance_of_runs(trajectory, repeated, of.reference.trusted, of.norm)
        run = run._replace(round_off=round_off)
    return run._replace(
        error_final=series.final,
        error_max=series.max,
        error_rms=series.rms,
        resolved=series.max is not None,
    )


def _side_by_side(
    problems: Sequence[Problem], method: Method, steps_per_frame: int
) -> list[Trajectory]:
    """The runs of problems of one family."""
    if not problems:
        return []
    # Each number of members needs a program of its own, so only powers of two are used.
    full = 1 << (len(problems) - 1).bit_length()
    padding = [problems[-1]] * (full - len(problems))
    together = simulate(Ensemble.of([*problems, *padding]), method, steps_per_frame)
    return [together[index] for index in range(len(problems))]


def _motion(trajectory: Trajectory) -> dict[str, Any]:
    try:
        words = classify_motion(trajectory)
    except InputError:
        # No rope, or one that cannot hang.
        return {}
    return {"motion": words.verdict, "swings": words.swings, "settled_at": words.settled_at}
