"""The rows of a task: every case held against a certified reference."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ropeode.analysis.stability import MOST_STEPS, stability_limit
from ropeode.errors import InputError
from ropeode.norms import Norm, norm_for
from ropeode.problems.problem import Problem
from ropeode.simulation import step_size
from ropeode.steppers import as_stepper
from ropeode.steppers.base import Stepper
from ropeode.study.accuracy_table import order_of
from ropeode.sweep.design.cases import Case
from ropeode.sweep.design.columns import RESULTS, failed_row
from ropeode.sweep.design.content_hash import surroundings
from ropeode.sweep.design.problem_factory import FileMaker, Maker, maker_for
from ropeode.sweep.execution.references import Known, Refused, known_references
from ropeode.sweep.execution.runs import Run, Subject, run_all, subject
from ropeode.sweep.execution.tasks import Task
from ropeode.validation import in_one_line

Row = dict[str, Any]


def evaluate(task: Task, folder: Path) -> list[Row]:
    """Compute the rows of a task, in the order of its cases.

    They are the same whatever process computes them and whatever else is in the task. What
    goes wrong with a case is told in its row.

    Arguments:
        task: what to compute.
        folder: of the sweep, where references are kept.

    Raises:
        InputError: a reference cannot be written; or this process has other software than the
            keys were made with, or another file of the problem, so that its rows would not be
            those that the keys name.
    """
    maker = _maker(task)
    rows: dict[str, Row] = {}
    built: dict[str, tuple[Problem, Norm]] = {}
    for key, cases in _grouped(task.cases, lambda case: case.problem_key).items():
        try:
            problem = maker.build(cases[0].parameters)
            built[key] = problem, norm_for(problem, cases[0].settings.norm)
        except Exception as error:
            rows |= _failed(cases, error)
    references = known_references(
        folder,
        {key: problem for key, (problem, _) in built.items()},
        task.cases[0].settings.asked,
        keep=task.keep,
    )
    subjects = {
        key: subject(problem, norm, known if isinstance(known, Known) else None)
        for key, (problem, norm) in built.items()
        for known in [references[key]]
    }
    left = [case for case in task.cases if case.problem_key in subjects]
    for label, cases in _grouped(left, lambda case: case.stepper).items():
        rows |= _of_stepper(as_stepper(label), cases, subjects)
    for case in left:
        row = rows[case.key]
        if row["status"] != "failed":
            key = case.problem_key
            _tell_reference(row, subjects[key], references[key], key)
    return [rows[case.key] for case in task.cases]


def _grouped(cases: Iterable[Case], by: Callable[[Case], str]) -> dict[str, list[Case]]:
    found: dict[str, list[Case]] = {}
    for case in cases:
        found.setdefault(by(case), []).append(case)
    return found


def _maker(task: Task) -> Maker:
    """What makes the problems of a task; raises as `evaluate` does."""
    first = task.cases[0]
    here = surroundings(str(first.settings.asked.get("level", "consensus")))
    if different := [name for name in here if here[name] != task.surroundings.get(name)]:
        told = ", ".join(f"{n} {here[n]} and not {task.surroundings.get(n)}" for n in different)
        raise InputError(
            f"worker: it has {told}; allowed: what the sweep was started with. Fix: install the "
            "same versions on all machines."
        )
    maker = maker_for(first.problem, task.folder)
    if isinstance(maker, FileMaker) and maker.digest != task.digest:
        raise InputError(
            f"problem: {first.problem} has been changed since the sweep was started; allowed: "
            "the same file in all processes. Fix: start the sweep again."
        )
    return maker


def _failed(cases: Sequence[Case], error: Exception) -> dict[str, Row]:
    why = in_one_line(error)
    return {case.key: failed_row(case.values(), "failed", why) for case in cases}


def _of_stepper(
    stepper: Stepper, cases: Sequence[Case], subjects: Mapping[str, Subject]
) -> dict[str, Row]:
    """The rows of the cases that have one stepper, by key."""
    runs = _runs(stepper, cases, subjects)
    rows: dict[str, Row] = {}
    stability: dict[str, Row] = {}
    for case in cases:
        key, of = case.problem_key, subjects[case.problem_key]
        try:
            if case.settings.largest_stable_dt and key not in stability:
                stability[key] = _stability(of, stepper)
            ladder = {n: runs[key, n] for n in _ladder(case, of)}
            rows[case.key] = _row(of, stepper, case, ladder, stability.get(key, {}))
        except Exception as error:
            rows |= _failed([case], error)
    return rows


def _ladder(case: Case, of: Subject) -> list[int]:
    """The numbers of steps that a case needs, its own first."""
    factors = case.settings.order_factors if of.known is not None else ()
    return [case.steps_per_frame * factor for factor in (factors or (1,))]


def _runs(
    stepper: Stepper, cases: Sequence[Case], subjects: Mapping[str, Subject]
) -> dict[tuple[str, int], Run | Exception]:
    """All the runs that cases need, each made once, by problem and number of steps."""
    asked = {(case.problem_key, case.steps_per_frame) for case in cases}
    needed: dict[int, dict[str, Subject]] = {}
    for case in cases:
        of = subjects[case.problem_key]
        for n in _ladder(case, of):
            needed.setdefault(n, {})[case.problem_key] = of
    runs: dict[tuple[str, int], Run | Exception] = {}
    for n, together in needed.items():
        keys = list(together)
        words = [(key, n) in asked for key in keys]
        try:
            found = run_all(list(together.values()), stepper, n, words)
        except Exception:
            # One of them it is; the others are not to suffer for it.
            found = [
                _alone(of, stepper, n, word)
                for of, word in zip(together.values(), words, strict=True)
            ]
        runs |= {(key, n): run for key, run in zip(keys, found, strict=True)}
    return runs


def _alone(of: Subject, stepper: Stepper, steps_per_frame: int, words: bool) -> Run | Exception:
    try:
        return run_all([of], stepper, steps_per_frame, [words])[0]
    except Exception as error:
        return error


def _row(
    of: Subject,
    stepper: Stepper,
    case: Case,
    ladder: Mapping[int, Run | Exception],
    stability: Row,
) -> Row:
    """A row without what it says of the reference.

    Raises:
        Exception: that one of its runs ended with.
    """
    runs = {}
    for n, run in ladder.items():
        if isinstance(run, Exception):
            raise run
        runs[n] = run
    own = runs[case.steps_per_frame]
    row = {**case.values(), **dict.fromkeys(RESULTS), **_of_run(own), **stability}
    if own.status == "diverged":
        _add_reason(row, f"no longer finite at frame {own.diverged_at}")
    if of.known is not None and case.settings.order_factors:
        row |= _order(of, stepper, runs)
    return row


def _of_run(found: Run) -> Row:
    row: Row = {
        "status": found.status,
        "dt": found.dt,
        "diverged_at": found.diverged_at,
        "rhs_evaluations": found.rhs_evaluations,
        "error_final": found.error_final,
        "error_max": found.error_max,
        "error_rms": found.error_rms,
        "resolved": found.error_max is not None,
        "round_off": found.round_off,
    }
    if found.words is not None:
        row |= {
            "motion": found.words.verdict,
            "swings": found.words.swings,
            "settled_at": found.words.settled_at,
        }
    return row


def _order(of: Subject, stepper: Stepper, ladder: Mapping[int, Run]) -> Row:
    """The observed order from the runs with several numbers of steps."""
    expected = order_of(of.problem, stepper, [*ladder.values()], of.resolution[-1], of.size)
    order = expected.order
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
        "expected_order": expected.expected,
    }


def _listed(numbers: Iterable[int]) -> str:
    return ", ".join(map(str, sorted(numbers)))


def _stability(of: Subject, stepper: Stepper) -> Row:
    try:
        limit = stability_limit(of.problem, stepper)
    except InputError as error:
        return {"reason": f"no largest stable dt: {in_one_line(error)}"}
    if limit is None:
        return {"reason": f"no largest stable dt: unstable at {MOST_STEPS} steps per frame"}
    return {"stability_limit": limit, "largest_stable_dt": step_size(of.problem, limit)}


def _tell_reference(row: Row, of: Subject, known: Known | Refused, key: str) -> None:
    """Put what is known of the reference into a row."""
    if isinstance(known, Refused):
        row["resolved"] = None
        if row["status"] == "ok":
            row["status"] = "no-reference"
        _add_reason(row, known.reason)
        return
    row |= {
        "reference": key,
        "trusted": len(known.states),
        "horizon": known.horizon,
        "horizon_reason": known.reason,
        "resolution": float(of.resolution[-1]),
        "motion_size": of.size,
    }


def _add_reason(row: Row, reason: str) -> None:
    row["reason"] = "; ".join(filter(None, [row["reason"], reason]))
