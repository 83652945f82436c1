"""The rows of a task: every case held against a certified reference."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ropeode.analysis.stability import MOST_STEPS, stability_limit
from ropeode.errors import InputError
from ropeode.norms import norm_for
from ropeode.simulation import step_size
from ropeode.steppers import stepper as stepper_named
from ropeode.steppers.base import Stepper
from ropeode.study.accuracy_table import order_of
from ropeode.study.sweep.batches import Task
from ropeode.study.sweep.cases import Case
from ropeode.study.sweep.columns import RESULTS, failed_row
from ropeode.study.sweep.key import surroundings
from ropeode.study.sweep.makers import FileMaker, Maker, maker_for
from ropeode.study.sweep.references import Known, Refused, known_reference
from ropeode.study.sweep.runs import Run, Subject, run, subject
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
        InputError: a reference cannot be written.
    """
    try:
        maker = _maker(task)
    except InputError as error:
        return [failed_row(case.values(), "failed", in_one_line(error)) for case in task.cases]
    problems: dict[str, list[Case]] = {}
    for case in task.cases:
        problems.setdefault(case.problem_key, []).append(case)
    rows: dict[str, Row] = {}
    for cases in problems.values():
        rows |= _rows(maker, cases, folder)
    return [rows[case.key] for case in task.cases]


def _maker(task: Task) -> Maker:
    """What makes the problems of a task.

    Raises:
        InputError: this process has other software than the keys were made with, or another
            file of the problem, so that the rows would not be those that the keys name.
    """
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


def _rows(maker: Maker, cases: Sequence[Case], folder: Path) -> dict[str, Row]:
    """The rows of the cases of one problem, by key."""
    first = cases[0]
    try:
        problem = maker.build(first.parameters)
        norm = norm_for(problem, first.settings.norm)
    except Exception as error:
        return _failed(cases, error)
    known = known_reference(folder, first.problem_key, problem, first.settings.asked)
    of = subject(problem, norm, known if isinstance(known, Known) else None)
    rows: dict[str, Row] = {}
    for label in dict.fromkeys(case.stepper for case in cases):
        own = [case for case in cases if case.stepper == label]
        try:
            rows |= _of_stepper(of, stepper_named(label), own)
        except Exception as error:
            rows |= _failed(own, error)
    for row in rows.values():
        if row["status"] != "failed":
            _tell_reference(row, of, known, first.problem_key)
    return rows


def _failed(cases: Sequence[Case], error: Exception) -> dict[str, Row]:
    why = in_one_line(error)
    return {case.key: failed_row(case.values(), "failed", why) for case in cases}


def _of_stepper(of: Subject, stepper: Stepper, cases: Sequence[Case]) -> dict[str, Row]:
    """The rows of the cases of one problem with one stepper, by key."""
    settings = cases[0].settings
    factors = settings.order_factors if of.known is not None else ()
    asked = {case.steps_per_frame for case in cases}
    needed = sorted({n * factor for n in asked for factor in (1, *factors)})
    # What several cases need is run once.
    runs = {n: run(of, stepper, n, motion_too=n in asked) for n in needed}
    stability = _stability(of, stepper) if settings.largest_stable_dt else {}
    rows = {}
    for case in cases:
        found = runs[case.steps_per_frame]
        row = {**case.values(), **dict.fromkeys(RESULTS), **_of_run(found), **stability}
        if found.status == "diverged":
            _add_reason(row, f"no longer finite at frame {found.diverged_at}")
        if factors:
            ladder = {case.steps_per_frame * f: runs[case.steps_per_frame * f] for f in factors}
            row |= _order(of, stepper, ladder)
        rows[case.key] = row
    return rows


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
