"""Trajectories from files as the values that plots and films are drawn from."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ropeode.analysis import differences, distances, error_series, resolution
from ropeode.checking.trajectories.checked_runs import checked_runs
from ropeode.checking.trajectories.convergence import converging_runs, shown, worst_rounding
from ropeode.checking.trajectories.known_methods import steps_per_frame
from ropeode.checking.trajectories.run_files import Files, Run, names_of
from ropeode.norms import Norm, norm_for
from ropeode.problems import Problem
from ropeode.progress import Progress, bar, shows_progress
from ropeode.references import Reference, ReferenceOptions, problem_of, reference_for
from ropeode.study import (
    AccuracyTable,
    Curve,
    EnergyCurves,
    ErrorCurves,
    NodePath,
    NodePaths,
    Row,
    StepperOrder,
    check_energy,
    check_positions,
    energies_of,
    errors_of,
    parts_of,
    sampled_finer,
)
from ropeode.validation import bad_value

# How far from a whole number the samples in a frame may be, by rounding of the times.
_WHOLE = 0.01


@shows_progress
def trajectory_errors(
    files: Sequence[str | Path],
    problem: Problem | Reference,
    dts: ArrayLike | None = None,
    *,
    norm: str | None = None,
    progress: Progress = bar,
    **asked: Any,
) -> AccuracyTable:
    """Errors of trajectories against step size, and their observed order, as an accuracy table.

    All files are runs of one stepper, whose name is theirs. Nobody knows how long they took.

    Arguments:
        files: CSV, NPZ or NetCDF, as `ropeode.grade` reads them, one for each step size.
        problem: that the program solves, or a reference of it.
        dts: step size of each file; None where the files contain it.
        norm: one of `ropeode.norms.NORMS`; by default the problem's first.
        progress: called with what is being done and the fraction that is done.
        asked: `accuracy`, `rtol`, `level`, `digits` and `time_limit` of `ropeode.reference`.

    Raises:
        InputError: an argument or a file cannot be used; one line for each, with the place.
        ReferenceRefused: no reference of the problem can be certified.

    Examples:
        >>> import numpy as np
        >>> from ropeode import Rope, simulate, trajectory_errors
        >>> rope = Rope(num_nodes=4).problem(frames=3)
        >>> run = simulate(rope, "rk4", steps_per_frame=16)
        >>> np.savez("run.npz", dt=run.dt, t=run.times, positions=run.positions)
        >>> f"{trajectory_errors(['run.npz'], rope).rows[0].error_max:.1e}"
        '9.0e-07'
    """
    runs, measure = _runs(files, problem, dts, norm, progress, asked)
    reference = _reference(problem, progress, asked)
    observed = converging_runs(reference, runs, norms=[measure])
    order = observed.quantities[measure.quantity].order
    if order.verdict != "converges" or not shown(order):
        # As `ropeode grade` has it: the largest round-off that a sound program has counts, too.
        worst = functools.partial(worst_rounding, reference=reference)
        order = converging_runs(reference, runs, worst, norms=[measure]).orders[measure.quantity]
    name, smallest = names_of(runs), observed.quantities[measure.quantity].resolution
    series = [error_series(run.states, reference, measure.name) for run in runs]
    return AccuracyTable(
        problem=reference.problem,
        reference=reference,
        norm=measure,
        rows=tuple(
            Row(
                stepper=name,
                steps_per_frame=steps,
                dt=run.dt,
                status="ok",
                diverged_at=None,
                error_final=errors.final,
                error_max=errors.max,
                error_rms=errors.rms,
                resolved=errors.max is not None,
                resolution=smallest,
                round_off=None,
                rhs_evaluations=None,
                seconds=math.nan,
            )
            for run, steps, errors in zip(runs, steps_per_frame(runs), series, strict=True)
        ),
        orders=(StepperOrder(name, None, order),),
    )


@shows_progress
def trajectory_error_curves(
    files: Sequence[str | Path],
    problem: Problem | Reference,
    dts: ArrayLike | None = None,
    *,
    norm: str | None = None,
    progress: Progress = bar,
    **asked: Any,
) -> ErrorCurves:
    """Errors of trajectories against time, for `ropeode.plot_errors`.

    Arguments and errors are those of `trajectory_errors`.

    Examples:
        >>> import numpy as np
        >>> from ropeode import Rope, simulate, trajectory_error_curves
        >>> rope = Rope(num_nodes=4).problem(frames=3)
        >>> run = simulate(rope, "rk4", steps_per_frame=16)
        >>> np.savez("run.npz", dt=run.dt, t=run.times, positions=run.positions)
        >>> trajectory_error_curves(["run.npz"], rope)
        <ErrorCurves: rope, 4 nodes, damping 0.01, 3 frames; position-max of 1 run (run.npz)>
    """
    runs, measure = _runs(files, problem, dts, norm, progress, asked)
    reference = _reference(problem, progress, asked)
    times = reference.times[1 : reference.trusted]
    errors = [distances(run.states, reference, measure)[1:] for run in runs]
    return errors_of(reference, measure, _curves(runs, times, errors))


@shows_progress
def trajectory_energy_curves(
    files: Sequence[str | Path],
    problem: Problem | Reference,
    dts: ArrayLike | None = None,
    *,
    progress: Progress = bar,
    **asked: Any,
) -> EnergyCurves:
    """Energies of trajectories against time, for `ropeode.plot_energies`.

    Arguments and errors are those of `trajectory_errors`; the files need velocities.

    Examples:
        >>> import numpy as np
        >>> from ropeode import Rope, simulate, trajectory_energy_curves
        >>> rope = Rope(num_nodes=4).problem(frames=3)
        >>> run = simulate(rope, "rk4", steps_per_frame=16)
        >>> x, v = run.positions, run.velocities
        >>> np.savez("run.npz", dt=run.dt, t=run.times, positions=x, velocities=v)
        >>> trajectory_energy_curves(["run.npz"], rope)
        <EnergyCurves: rope, 4 nodes, damping 0.01, 3 frames; energies of 1 run (run.npz)>
    """
    own = problem_of(problem)
    check_energy(own)
    runs, _ = _runs(files, problem, dts, None, progress, asked, needed=own.quantities)
    reference = _reference(problem, progress, asked)
    energies = [own.energies(each.states) for each in runs]
    known = reference.states[: reference.trusted]
    return energies_of(own, reference, known, tuple(_curves(runs, own.ts, energies)))


@shows_progress
def trajectory_paths(
    files: Sequence[str | Path],
    problem: Problem | Reference,
    dts: ArrayLike | None = None,
    *,
    norm: str | None = None,
    progress: Progress = bar,
    **asked: Any,
) -> NodePaths:
    """The nodes of trajectories, for `ropeode.animate`.

    Where all files have samples between those of the problem, the film shows up to 8 in each
    frame. Arguments and errors are those of `trajectory_errors`.

    Examples:
        >>> import numpy as np
        >>> from ropeode import Rope, simulate, trajectory_paths
        >>> rope = Rope(num_nodes=4).problem(frames=3)
        >>> run = simulate(rope, "rk4", steps_per_frame=16)
        >>> np.savez("run.npz", dt=run.dt, t=run.times, positions=run.positions)
        >>> trajectory_paths(["run.npz"], rope)
        <NodePaths: rope, 4 nodes, damping 0.01, 3 frames; 4 samples of 1 run
        (run.npz, dt = 0.0625)>
    """
    own = problem_of(problem)
    check_positions(own)
    runs, measure = _runs(files, problem, dts, norm, progress, asked)
    parts = 1 if isinstance(problem, Reference) else _parts(own, runs)
    if parts > 1:
        sampled = sampled_finer(problem, parts)
        runs, _ = _runs(files, sampled, dts, norm, progress, asked)
    else:
        sampled = problem
    reference = _reference(sampled, progress, asked)
    return NodePaths(
        problem=own,
        reference=reference,
        norm=measure,
        samples_per_frame=parts,
        steps_per_frame=None,
        resolution=resolution(reference, measure),
        paths=tuple(
            NodePath(
                stepper=run.label,
                positions=own.positions(run.states),
                errors=distances(run.states, reference, measure),
                differences=own.positions(differences(run.states, reference)),
                diverged_at=None,
            )
            for run in runs
        ),
    )


def _runs(
    files: Sequence[str | Path],
    problem: Problem | Reference,
    dts: ArrayLike | None,
    norm: str | None,
    progress: Progress,
    asked: dict[str, Any],
    needed: Sequence[str] = (),
) -> tuple[tuple[Run, ...], Norm]:
    """The files, read and checked, and the norm."""
    own = problem_of(problem)
    measure = norm_for(own, norm)
    runs = checked_runs(
        Files(files, own, dts, 1), lambda: _reference(problem, progress, asked), progress
    )
    for run in runs:
        if run.diverged is not None:
            fix = "leave out runs that diverged, or use smaller steps"
            raise bad_value(run.diverged.where, run.diverged.given, "a finite number", fix)
    if {measure.quantity, *needed} - {*runs[0].quantities}:
        given = f"none in {[str(run.path) for run in runs]}"
        allowed = "velocities in all files for what is to be drawn"
        fix = "write them, or choose a plot and a norm of positions"
        raise bad_value("velocities", given, allowed, fix)
    return runs, measure


def _reference(
    problem: Problem | Reference, progress: Progress, asked: dict[str, Any]
) -> Reference:
    return reference_for(problem, ReferenceOptions(**asked), lambda text, _: progress(text, 1.0))


def _curves(runs: Sequence[Run], times: np.ndarray, values: Sequence[np.ndarray]) -> list[Curve]:
    return [
        Curve(
            stepper=names_of(runs),
            label=f"dt = {run.dt:g}" if len(runs) == 1 else run.label,
            dt=run.dt,
            times=times[: len(each)],
            values=each[: len(times)],
        )
        for run, each in zip(runs, values, strict=True)
    ]


def _parts(problem: Problem, runs: Sequence[Run]) -> int:
    """Into how many parts a frame can be divided so that all files have samples there."""
    counts = [float(problem.ts[1] - problem.ts[0]) / run.interval for run in runs]
    whole = [round(count) for count in counts]
    if not problem.equal_frames or np.max(np.abs(np.subtract(counts, whole))) > _WHOLE:
        return 1
    return parts_of(problem.frames, int(np.gcd.reduce(whole)))
