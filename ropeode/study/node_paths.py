"""Where the nodes are, at samples close enough to be watched as a film."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Unpack

import numpy as np

from ropeode.analysis import differences, distances, resolution
from ropeode.display import Displayed, Tabular
from ropeode.norms import Norm, norm_for
from ropeode.problems import Problem
from ropeode.progress import Progress, bar, shows_progress
from ropeode.references import Asked, Reference, ReferenceOptions, problem_of, reference_for
from ropeode.simulation import Status
from ropeode.steppers import Stepper
from ropeode.study.accuracy_table import check_steps, chosen_steppers
from ropeode.study.curves import runs_of
from ropeode.validation import bad_value

PATH_STEPPERS = ("explicit-euler", "semi-implicit-euler", "rk4")
PATH_STEPS_PER_FRAME = 64

_MOST_SAMPLES_PER_FRAME = 8
# Of a film; with more, it is long enough with fewer of them in each frame.
_ENOUGH_SAMPLES = 200


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class NodePath(Displayed):
    """The nodes of one run.

    Arguments:
        stepper: its name with options; of a trajectory from a file, the file's name and dt.
        positions: ``(samples, nodes, dim)``, up to the last finite sample.
        errors: at the samples inside the trust horizon, ``(samples,)``.
        differences: positions minus those of the reference there, ``(samples, nodes, dim)``.
        diverged_at: the first frame at whose end the run was not finite; None if it stayed
            finite.
        status: of the run, as for a `Trajectory`.
    """

    stepper: str
    positions: np.ndarray
    errors: np.ndarray
    differences: np.ndarray
    diverged_at: int | None
    status: Status = "ok"


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class NodePaths(Tabular):
    """The nodes of runs and of their reference.

    Arguments:
        problem: the problem of the runs.
        reference: of the problem with all the samples; its horizon is one of them.
        norm: in which errors are measured.
        samples_per_frame: how many intervals each frame of the problem is divided into.
        steps_per_frame: of all the runs; None for trajectories from files.
        resolution: ten times the reference's bound at the samples inside the horizon; no
            digit of an error below it is to be believed.
        paths: one for each stepper.
    """

    problem: Problem
    reference: Reference
    norm: Norm
    samples_per_frame: int
    steps_per_frame: int | None
    resolution: np.ndarray
    paths: tuple[NodePath, ...]

    @property
    def times(self) -> np.ndarray:
        """All the sample times, ``(samples,)``."""
        return self.reference.problem.ts


@shows_progress
def node_paths(
    problem: Problem | Reference,
    steppers: Sequence[str | Stepper] = PATH_STEPPERS,
    steps_per_frame: int = PATH_STEPS_PER_FRAME,
    *,
    norm: str | None = None,
    progress: Progress = bar,
    **asked: Unpack[Asked],
) -> NodePaths:
    """Run steppers on a problem that is sampled up to 8 times in each frame.

    The samples lie on steps, so that the runs are those of a table; nothing is interpolated.

    Arguments:
        problem: the problem to solve, whose positions must have 2 or 3 components; or a
            reference of it, whose samples are those of the film.
        steppers: steppers, or their names with options.
        steps_per_frame: a whole number, the same for all.
        norm: one of `ropeode.norms.NORMS`; by default the problem's first.
        progress: called with what is being done and the fraction that is done.
        asked: options of `ropeode.reference`: accuracy, rtol, level, digits and time_limit.

    Raises:
        InputError: one line for each argument that cannot be used.
        ReferenceRefused: no reference of the problem can be certified.

    Examples:
        >>> from ropeode import Rope, node_paths
        >>> node_paths(Rope(num_nodes=4).problem(frames=3), ["rk4"], steps_per_frame=16)
        <NodePaths: rope, 4 nodes, damping 0.01, 3 frames; 25 samples of 1 run (rk4)>
    """
    source, problem = problem, problem_of(problem)
    check_positions(problem)
    chosen, (steps,) = chosen_steppers(problem, steppers), check_steps([steps_per_frame])
    measure, options = norm_for(problem, norm), ReferenceOptions(**asked)
    parts = 1 if isinstance(source, Reference) else parts_of(problem.frames, steps)
    sampled = sampled_finer(source, parts)
    reference = reference_for(sampled, options, lambda text, _: progress(text, 0.0))
    return NodePaths(
        problem=problem,
        reference=reference,
        norm=measure,
        samples_per_frame=parts,
        steps_per_frame=steps,
        resolution=resolution(reference, measure),
        paths=tuple(
            NodePath(
                stepper=run.stepper.label,
                positions=run.positions,
                errors=distances(run.states, reference, measure),
                differences=problem.positions(differences(run.states, reference)),
                diverged_at=None if run.diverged_at is None else -(-run.diverged_at // parts),
                status=run.status,
            )
            for run in runs_of(reference.problem, chosen, [steps // parts], progress)
        ),
    )


def check_positions(problem: Problem) -> None:
    """Refuse a problem that cannot be watched.

    Raises:
        InputError: its positions do not have 2 or 3 components.
    """
    if problem.mechanics is None or problem.positions(problem.y0[None]).shape[2] not in (2, 3):
        allowed = "a problem whose positions have 2 or 3 components"
        fix = "choose one that moves in a plane or in space, such as rope or kepler"
        raise bad_value("problem", problem.name, allowed, fix)


def parts_of(frames: int, steps: int) -> int:
    """Into how many intervals of whole steps a film divides a frame.

    Arguments:
        frames: of the problem.
        steps: in each frame.
    """
    most = min(_MOST_SAMPLES_PER_FRAME, max(1, _ENOUGH_SAMPLES // frames))
    return max(parts for parts in range(1, most + 1) if steps % parts == 0)


def sampled_finer(source: Problem | Reference, parts: int) -> Problem | Reference:
    """The problem with that many samples in each frame; the old ones stay as they are.

    Arguments:
        source: a problem; or a reference, which has the samples that it has.
        parts: intervals in each frame; 1 for a reference.
    """
    if isinstance(source, Reference):
        return source
    frames = np.arange(source.frames * parts + 1) / parts
    return dataclasses.replace(
        source, ts=np.interp(frames, np.arange(source.frames + 1.0), source.ts)
    )
