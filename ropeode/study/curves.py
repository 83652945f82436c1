"""Errors and energies of steppers against time."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ropeode.analysis.errors import RESOLUTION_FACTOR
from ropeode.errors import InputError
from ropeode.norms import Norm, distance, norm_for
from ropeode.problems.problem import Problem
from ropeode.references.reference import Reference, motion, problem_of, reference_for
from ropeode.simulation import Trajectory, simulate
from ropeode.steppers.base import Stepper
from ropeode.study.accuracy_table import (
    DEFAULT_STEPS_PER_FRAME,
    Progress,
    check_steps,
    chosen_steppers,
)
from ropeode.validation import complaint


@dataclasses.dataclass(frozen=True, eq=False)
class Curve:
    """One run's number at each sample time.

    Arguments:
        stepper: its name with options.
        steps_per_frame: steps between two samples.
        times: sample times, ``(times,)``, no further than the run and the number are finite.
        values: the number there, ``(times,)``.
        diverged_at: the time of the first sample at which the run was not finite; None if it
            stayed finite.
    """

    stepper: str
    steps_per_frame: int
    times: np.ndarray
    values: np.ndarray
    diverged_at: float | None


@dataclasses.dataclass(frozen=True, eq=False)
class ErrorCurves:
    """Errors against time, inside the trust horizon and without the first sample.

    Arguments:
        problem: what was solved.
        reference: with its certificate.
        norm: in which errors are measured.
        motion: how far a node (or component) gets from its start inside the horizon.
        times: the sample times inside the horizon, without the first, ``(times,)``.
        bound: the reference's estimated error bound there, ``(times,)``.
        resolution: ten times that; no digit of an error below it is to be believed.
        curves: one for each run, steppers in the order asked for.
    """

    problem: Problem
    reference: Reference
    norm: Norm
    motion: float
    times: np.ndarray
    bound: np.ndarray
    resolution: np.ndarray
    curves: tuple[Curve, ...]


@dataclasses.dataclass(frozen=True, eq=False)
class EnergyCurves:
    """Energies against time.

    Arguments:
        problem: what was solved.
        reference: with its certificate.
        times: the sample times inside the trust horizon, ``(times,)``.
        values: the reference's energy there, ``(times,)``.
        curves: one for each run, steppers in the order asked for; these do not end at the
            horizon.
    """

    problem: Problem
    reference: Reference
    times: np.ndarray
    values: np.ndarray
    curves: tuple[Curve, ...]


def error_curves(
    problem: Problem | Reference,
    steppers: Sequence[str | Stepper] | None = None,
    steps_per_frame: Sequence[int] = DEFAULT_STEPS_PER_FRAME,
    *,
    norm: str | None = None,
    accuracy: float | None = None,
    rtol: float | None = None,
    progress: Progress = lambda text, fraction: None,
    **asked: Any,
) -> ErrorCurves:
    """Run steppers and measure their distance from a reference at each sample.

    A run that diverged has errors up to its last finite state.

    Arguments:
        problem: what to solve, or a reference of it that exists already.
        steppers: as for `ropeode.accuracy_table`.
        steps_per_frame: whole numbers, each once.
        norm: one of `ropeode.norms.NORMS`; by default the problem's first.
        accuracy: as for `ropeode.reference`.
        rtol: as for `ropeode.reference`.
        progress: called with what is being done and the fraction that is done.
        asked: `level`, `digits` and `time_limit` of `ropeode.reference`.

    Raises:
        InputError: one line for each argument that cannot be used.
        ReferenceRefused: no reference can be had for the problem.
    """
    given, problem = problem, problem_of(problem)
    chosen, ladder = chosen_steppers(problem, steppers), check_steps(steps_per_frame)
    measure = norm_for(problem, norm)
    known = reference_for(given, accuracy, rtol, progress=lambda text: progress(text, 0.0), **asked)
    inside = slice(1, known.trusted)
    bound = known.bound(measure)[inside]
    curves = []
    for run in runs(problem, chosen, ladder, progress):
        errors = distance(problem, measure, run.states, known.states[: known.trusted])[1:]
        curves.append(_curve(run, run.times[1 : 1 + len(errors)], errors))
    return ErrorCurves(
        problem=problem,
        reference=known,
        norm=measure,
        motion=float(motion(problem, known.states, measure)[known.trusted - 1]),
        times=known.times[inside],
        bound=bound,
        resolution=RESOLUTION_FACTOR * bound,
        curves=tuple(curves),
    )


def energy_curves(
    problem: Problem | Reference,
    steppers: Sequence[str | Stepper] | None = None,
    steps_per_frame: Sequence[int] = DEFAULT_STEPS_PER_FRAME,
    *,
    accuracy: float | None = None,
    rtol: float | None = None,
    progress: Progress = lambda text, fraction: None,
    **asked: Any,
) -> EnergyCurves:
    """Run steppers and take the energy at each sample, and that of a reference.

    Arguments:
        problem: what to solve, which must have an energy; or a reference of it.
        steppers: as for `ropeode.accuracy_table`.
        steps_per_frame: whole numbers, each once.
        accuracy: as for `ropeode.reference`.
        rtol: as for `ropeode.reference`.
        progress: called with what is being done and the fraction that is done.
        asked: `level`, `digits` and `time_limit` of `ropeode.reference`.

    Raises:
        InputError: one line for each argument that cannot be used.
        ReferenceRefused: no reference can be had for the problem.
    """
    given, problem = problem, problem_of(problem)
    if problem.energy is None:
        raise InputError(
            complaint(
                "problem",
                problem.name,
                "a problem that has an energy",
                "give it one, Problem(..., energy=...), or choose what needs none",
            )
        )
    chosen, ladder = chosen_steppers(problem, steppers), check_steps(steps_per_frame)
    known = reference_for(given, accuracy, rtol, progress=lambda text: progress(text, 0.0), **asked)
    return EnergyCurves(
        problem=problem,
        reference=known,
        times=known.times[: known.trusted],
        values=problem.energies(known.states[: known.trusted]),
        curves=tuple(
            _curve(run, run.times, problem.energies(run.states))
            for run in runs(problem, chosen, ladder, progress)
        ),
    )


def runs(
    problem: Problem, steppers: Sequence[Stepper], ladder: Sequence[int], progress: Progress
) -> Iterator[Trajectory]:
    """Each stepper at each number of steps per frame, one after the other."""
    total, done = len(steppers) * sum(ladder), 0
    for stepper in steppers:
        for steps in ladder:
            progress(f"{stepper.label}: {steps} steps per frame", done / total)
            yield simulate(problem, stepper, steps)
            done += steps
    progress("done", 1.0)


def _curve(run: Trajectory, times: np.ndarray, values: np.ndarray) -> Curve:
    # The energy of a state may be infinite where the state is not.
    finite = int(np.argmin(np.append(np.isfinite(values), False)))
    return Curve(
        stepper=run.stepper.label,
        steps_per_frame=run.steps_per_frame,
        times=times[:finite],
        values=values[:finite],
        diverged_at=None if run.diverged_at is None else float(run.problem.ts[run.diverged_at]),
    )
