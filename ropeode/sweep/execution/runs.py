"""The runs of a sweep: one stepper with one number of steps on many problems."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ropeode.analysis import (
    distance_of_runs,
    error_series,
    in_other_units,
    keeps_units,
    motion_words,
    moved,
)
from ropeode.errors import InputError
from ropeode.norms import Norm
from ropeode.problems import Ensemble, Problem, family_of
from ropeode.references import Reference
from ropeode.simulation import Method, Trajectory, method_of, simulate
from ropeode.steppers import Stepper


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
        words = motion_words(trajectory)
    except InputError:
        # No rope, or one that cannot hang.
        return {}
    return {"motion": words.verdict, "swings": words.swings, "settled_at": words.settled_at}
