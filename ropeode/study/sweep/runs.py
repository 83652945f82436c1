"""The runs of a sweep: one stepper with one number of steps on many problems."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np

from ropeode.analysis.errors import RESOLUTION_FACTOR, ErrorSeries
from ropeode.analysis.motion import Words, motion_words
from ropeode.analysis.roundoff import from_double, in_other_units
from ropeode.errors import InputError
from ropeode.norms import Norm, distance
from ropeode.problems.ensemble import Ensemble, family
from ropeode.problems.problem import Problem
from ropeode.references.reference import motion
from ropeode.simulation import Trajectory, simulate
from ropeode.steppers.base import Stepper
from ropeode.study.sweep.references import Known


class Subject(NamedTuple):
    """A problem and what is known of its solution.

    Fields:
        problem: that is solved.
        rescaled: the same in other units.
        norm: in which errors are measured.
        known: its reference; None if there is none.
        size: how far it moves inside the horizon; infinite without a reference.
    """

    problem: Problem
    rescaled: Problem
    norm: Norm
    known: Known | None
    size: float

    @property
    def resolution(self) -> np.ndarray:
        """Ten times the reference's bound at the trusted samples but the first."""
        assert self.known is not None
        return RESOLUTION_FACTOR * self.known.bounds[self.norm.quantity][1:]


def subject(problem: Problem, norm: Norm, known: Known | None) -> Subject:
    """A problem, ready to be run."""
    size = np.inf if known is None else float(motion(problem, known.states, norm)[-1])
    return Subject(problem, in_other_units(problem), norm, known, size)


@dataclasses.dataclass(frozen=True)
class Run:
    """What a run comes to; the fields mean the same in `ropeode.study.accuracy_table.Row`.

    Arguments:
        dt: step size.
        status: of the run.
        diverged_at: frame of the first state that is not finite.
        rhs_evaluations: of the right-hand side.
        words: of a rope's motion; None where they were not asked for or it cannot hang.
        error_final: None if unresolved or unknown, as the others.
        error_max: likewise.
        error_rms: likewise.
        round_off: None where there is no reference, or the run diverged.
    """

    dt: float
    status: Literal["ok", "diverged"]
    diverged_at: int | None
    rhs_evaluations: int
    words: Words | None
    error_final: float | None = None
    error_max: float | None = None
    error_rms: float | None = None
    round_off: float | None = None


def run_all(
    subjects: Sequence[Subject], stepper: Stepper, steps_per_frame: int, motion_too: Sequence[bool]
) -> list[Run]:
    """Run a stepper on many problems, and again in other units where there is a reference.

    Arguments:
        subjects: the problems.
        stepper: that is run.
        steps_per_frame: equal steps in each frame.
        motion_too: for each problem, whether the motion of a rope is to be told.
    """
    runs = _simulated([each.problem for each in subjects], stepper, steps_per_frame)
    known = [
        each.known is not None and run.status == "ok"
        for each, run in zip(subjects, runs, strict=True)
    ]
    doubles = iter(
        _simulated(
            [each.rescaled for each, yes in zip(subjects, known, strict=True) if yes],
            stepper,
            steps_per_frame,
        )
    )
    return [
        _run(each, run, next(doubles) if yes else None, _words(run) if words else None)
        for each, run, yes, words in zip(subjects, runs, known, motion_too, strict=True)
    ]


def _simulated(
    problems: Sequence[Problem], stepper: Stepper, steps_per_frame: int
) -> list[Trajectory]:
    """The runs of all problems, those of one family side by side."""
    families: dict[Any, list[int]] = {}
    for index, problem in enumerate(problems):
        families.setdefault(family(problem), []).append(index)
    runs: dict[int, Trajectory] = {}
    for indices in families.values():
        # Programs are compiled for a number of members; so for few numbers.
        full = 1 << (len(indices) - 1).bit_length()
        padded = indices + indices[-1:] * (full - len(indices))
        together = Ensemble.of([problems[index] for index in padded])
        found = simulate(together, stepper, steps_per_frame)
        runs |= {index: found[at] for at, index in enumerate(indices)}
    return [runs[index] for index in range(len(problems))]


def _run(
    subject: Subject, trajectory: Trajectory, double: Trajectory | None, words: Words | None
) -> Run:
    found = Run(
        dt=trajectory.dt,
        status=trajectory.status,
        diverged_at=trajectory.diverged_at,
        rhs_evaluations=trajectory.rhs_evaluations,
        words=words,
    )
    if double is None:
        return found
    assert subject.known is not None
    norm, states = subject.norm, subject.known.states
    trusted = len(states)
    apart = distance(subject.problem, norm, trajectory.states[:trusted], states)
    series = ErrorSeries(norm, trajectory.times[1:trusted], apart[1:], subject.resolution)
    return dataclasses.replace(
        found,
        error_final=series.final,
        error_max=series.max,
        error_rms=series.rms,
        round_off=from_double(trajectory, double, trusted, norm),
    )


def _words(trajectory: Trajectory) -> Words | None:
    try:
        return motion_words(trajectory)
    except InputError:
        # No rope, or one that cannot hang.
        return None
