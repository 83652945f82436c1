"""Where the nodes are, at samples close enough to be watched as a film."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from ropeode.analysis.errors import RESOLUTION_FACTOR
from ropeode.errors import InputError
from ropeode.norms import Norm, distance, norm_for
from ropeode.problems.problem import Problem
from ropeode.references.reference import Reference, problem_of, reference_for
from ropeode.steppers.base import Stepper
from ropeode.study.accuracy_table import Progress, check_steps, chosen_steppers
from ropeode.study.curves import runs
from ropeode.validation import complaint

DEFAULT_STEPPERS = ("semi-implicit-euler",)
DEFAULT_STEPS_PER_FRAME = 64

_MOST_SAMPLES_PER_FRAME = 8
# Of a film; with more, it is long enough with fewer of them in each frame.
_ENOUGH_SAMPLES = 400


@dataclasses.dataclass(frozen=True, eq=False)
class NodePath:
    """The nodes of one run.

    Arguments:
        stepper: its name with options.
        positions: ``(samples, nodes, dim)``, up to the last finite sample.
        errors: at the samples inside the trust horizon, ``(samples,)``.
        diverged_at: the first frame at whose end the run was not finite; None if it stayed
            finite.
    """

    stepper: str
    positions: np.ndarray
    errors: np.ndarray
    diverged_at: int | None


@dataclasses.dataclass(frozen=True, eq=False)
class NodePaths:
    """The nodes of runs and of their reference.

    Arguments:
        problem: what was solved.
        reference: of the problem with all the samples; its horizon is one of them.
        norm: in which errors are measured.
        samples_per_frame: how many intervals each frame of the problem is divided into.
        steps_per_frame: of all the runs.
        resolution: ten times the reference's bound at the samples inside the horizon; no
            digit of an error below it is to be believed.
        paths: one for each stepper.
    """

    problem: Problem
    reference: Reference
    norm: Norm
    samples_per_frame: int
    steps_per_frame: int
    resolution: np.ndarray
    paths: tuple[NodePath, ...]

    @property
    def times(self) -> np.ndarray:
        """All the sample times, ``(samples,)``."""
        return self.reference.problem.ts


def node_paths(
    problem: Problem | Reference,
    steppers: Sequence[str | Stepper] = DEFAULT_STEPPERS,
    steps_per_frame: int = DEFAULT_STEPS_PER_FRAME,
    *,
    norm: str | None = None,
    accuracy: float | None = None,
    rtol: float | None = None,
    progress: Progress = lambda text, fraction: None,
    **asked: Any,
) -> NodePaths:
    """Run steppers on a problem that is sampled up to 8 times in each frame.

    The samples lie on steps, so that the runs are those that a table makes; nothing is
    interpolated.

    Arguments:
        problem: what to solve, whose positions must have 2 or 3 components; or a reference of
            it, which is taken with its own samples.
        steppers: steppers, or their names with options.
        steps_per_frame: a whole number, the same for all.
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
    if problem.mechanics is None or problem.positions(problem.y0[None]).shape[2] not in (2, 3):
        raise InputError(
            complaint(
                "problem",
                problem.name,
                "a problem whose positions have 2 or 3 components",
                "choose one that moves in a plane or in space, such as rope or kepler",
            )
        )
    chosen, (steps,) = chosen_steppers(problem, steppers), check_steps([steps_per_frame])
    measure = norm_for(problem, norm)
    stored = isinstance(given, Reference)
    parts = 1 if stored else _parts(problem.frames, steps)
    finer = problem if stored else _sampled(problem, parts)
    known = reference_for(
        given if stored else finer,
        accuracy,
        rtol,
        progress=lambda text: progress(text, 0.0),
        **asked,
    )
    trusted = known.states[: known.trusted]
    return NodePaths(
        problem=problem,
        reference=known,
        norm=measure,
        samples_per_frame=parts,
        steps_per_frame=steps,
        resolution=RESOLUTION_FACTOR * known.bound(measure),
        paths=tuple(
            NodePath(
                stepper=run.stepper.label,
                positions=run.positions,
                errors=distance(finer, measure, run.states, trusted),
                diverged_at=None if run.diverged_at is None else -(-run.diverged_at // parts),
            )
            for run in runs(finer, chosen, [steps // parts], progress)
        ),
    )


def _parts(frames: int, steps: int) -> int:
    """Into how many intervals of whole steps a frame is divided."""
    most = min(_MOST_SAMPLES_PER_FRAME, max(1, _ENOUGH_SAMPLES // frames))
    return max(parts for parts in range(1, most + 1) if steps % parts == 0)


def _sampled(problem: Problem, parts: int) -> Problem:
    """The problem with that many samples in each frame; the old ones stay as they are."""
    frames = np.arange(problem.frames * parts + 1) / parts
    return dataclasses.replace(
        problem, ts=np.interp(frames, np.arange(problem.frames + 1.0), problem.ts)
    )
