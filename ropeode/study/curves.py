"""Errors of steppers against time."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterable, Iterator, Sequence
from typing import Unpack

import numpy as np
from numpy.typing import ArrayLike

from ropeode.analysis import distances, moved, resolution
from ropeode.display import Tabular
from ropeode.norms import Norm, norm_for
from ropeode.problems import Problem
from ropeode.progress import Progress, bar, shows_progress
from ropeode.references import Asked, Reference, ReferenceOptions, problem_of, reference_for
from ropeode.simulation import Status, Trajectory, method_of, simulate
from ropeode.steppers import Stepper
from ropeode.study.accuracy_table import check_steps, chosen_steppers
from ropeode.study.error_constant import leading_term
from ropeode.validation import counted

# Lines that a reader can follow in a panel.
_STEPS_PER_FRAME = (16, 64, 256, 1024)


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Curve(Tabular):
    """A number of one run, such as its error, at each sample time.

    Arguments:
        stepper: its name with options; of trajectories from files, the names of the files.
        label: what sets the run apart from others of the stepper: its number of steps per
            frame, or its file.
        dt: step size, the largest where frames differ in length.
        times: sample times, ``(times,)``, up to the last at which the number is finite.
        values: the number there, ``(times,)``.
        diverged_at: the time of the first sample at which the run was not finite; None if it
            stayed finite.
        status: of the run, as for a `Trajectory`.
        steps_per_frame: steps between two samples; None for a trajectory from a file.
        predicted: by theory, the leading term of an error at all sample times of the study; None
            where there is no prediction.
    """

    stepper: str
    label: str
    dt: float
    times: np.ndarray
    values: np.ndarray
    diverged_at: float | None = None
    status: Status = "ok"
    steps_per_frame: int | None = None
    predicted: np.ndarray | None = None


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class ErrorCurves(Tabular):
    """Errors against time, inside the trust horizon and without the first sample.

    Arguments:
        problem: the problem of the runs.
        reference: with its certificate.
        norm: in which errors are measured.
        motion: how far a node (or component) gets from its start inside the horizon.
        times: the sample times inside the horizon, without the first, ``(times,)``.
        bound: the reference's estimated error bound there, ``(times,)``.
        resolution: ten times that; no digit of an error below it is to be believed.
        curves: one for each run, in the order of the steppers.
    """

    problem: Problem
    reference: Reference
    norm: Norm
    motion: float
    times: np.ndarray
    bound: np.ndarray
    resolution: np.ndarray
    curves: tuple[Curve, ...]


@shows_progress
def error_curves(
    problem: Problem | Reference,
    steppers: Sequence[str | Stepper] | None = None,
    steps_per_frame: ArrayLike = _STEPS_PER_FRAME,
    *,
    norm: str | None = None,
    predict: bool = False,
    progress: Progress = bar,
    **asked: Unpack[Asked],
) -> ErrorCurves:
    """Run steppers and measure their distance from a reference at each sample.

    A run that diverged has errors up to its last finite state.

    Arguments:
        problem: the problem to solve, or a reference of it.
        steppers: as for `ropeode.accuracy_table`.
        steps_per_frame: whole numbers, each once.
        norm: one of `ropeode.norms.NORMS`; by default the problem's first.
        predict: predict the leading terms of the errors from single steps as well.
        progress: called with what is being done and the fraction that is done.
        asked: options of `ropeode.reference`: accuracy, rtol, level, digits and time_limit.

    Raises:
        InputError: one line for each argument that cannot be used.
        ReferenceRefused: no reference of the problem can be certified.

    Examples:
        >>> from ropeode import Rope, error_curves
        >>> error_curves(Rope(num_nodes=4).problem(frames=3), ["rk4"], [16, 64])
        <ErrorCurves: rope, 4 nodes, damping 0.01, 3 frames; position-max of 2 runs (rk4)>
    """
    measure = norm_for(problem_of(problem), norm)
    own, options = problem_of(problem), ReferenceOptions(**asked)
    chosen, ladder = chosen_steppers(own, steppers), check_steps(steps_per_frame)
    reference = reference_for(problem, options, lambda text, _: progress(text, 0.0))

    @functools.cache
    def leading(stepper: Stepper) -> tuple[np.ndarray | None, int | None]:
        if not predict:
            return None, None
        # Not above: it takes as long to import as JAX, and most curves predict nothing.
        from ropeode.theory import predicted_error

        found = predicted_error(reference, method_of(stepper, reference.problem))
        if isinstance(found, str):
            return None, None
        return leading_term(reference.problem, measure, found), found.order

    runs = runs_of(own, chosen, ladder, progress)
    curves = (error_curve(run, reference, measure, *leading(run.stepper)) for run in runs)
    return errors_of(reference, measure, curves)


def error_curve(
    run: Trajectory,
    reference: Reference,
    norm: Norm,
    leading: np.ndarray | None = None,
    order: int | None = None,
) -> Curve:
    """The error of a run of any status against time, without the first sample.

    Arguments:
        run: on the problem of the reference.
        reference: that it is compared with.
        norm: in which errors are measured.
        leading: the predicted error over ``dt**order`` at all trusted samples but the first; None
            where there is no prediction.
        order: the power of dt; likewise.
    """
    curve = curve_of(run, run.times[1:], distances(run.states, reference, norm)[1:])
    if leading is None or order is None:
        return curve
    return dataclasses.replace(curve, predicted=leading * run.dt**order)


def errors_of(reference: Reference, norm: Norm, curves: Iterable[Curve]) -> ErrorCurves:
    """Errors of runs with what they are compared with.

    Arguments:
        reference: of the problem of the runs.
        norm: in which errors are measured.
        curves: of errors, without the first sample.
    """
    inside = slice(1, reference.trusted)
    return ErrorCurves(
        problem=reference.problem,
        reference=reference,
        norm=norm,
        motion=moved(reference, norm),
        times=reference.times[inside],
        bound=reference.bound(norm)[inside],
        resolution=resolution(reference, norm)[1:],
        curves=tuple(curves),
    )


def runs_of(
    problem: Problem, steppers: Sequence[Stepper], ladder: Sequence[int], progress: Progress
) -> Iterator[Trajectory]:
    """Each stepper at each number of steps per frame, one after the other."""
    total, done = len(steppers) * sum(ladder), 0
    for stepper in steppers:
        for steps in ladder:
            progress(f"{stepper.label}: {counted(steps, 'step')} per frame", done / total)
            yield simulate(problem, stepper, steps)
            done += steps
    progress("done", 1.0)


def curve_of(run: Trajectory, times: np.ndarray, values: np.ndarray) -> Curve:
    """Numbers of a run at times, both ``(times,)``, up to the last that is finite."""
    # Errors end at the horizon, and the energy of a state may be infinite where the state is not.
    finite = int(np.argmin(np.append(np.isfinite(values), False)))
    return Curve(
        stepper=run.stepper.label,
        label=f"{counted(run.steps_per_frame, 'step')}/frame",
        dt=run.dt,
        times=times[:finite],
        values=values[:finite],
        diverged_at=None if run.diverged_at is None else float(run.problem.ts[run.diverged_at]),
        status=run.status,
        steps_per_frame=run.steps_per_frame,
    )
