"""The runs of a sweep: one stepper with one number of steps on many problems."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Hashable, Sequence
from typing import Literal, NamedTuple

import numpy as np

from ropeode.analysis.errors import RESOLUTION_FACTOR, ErrorSeries
from ropeode.analysis.motion import Words, motion_words
from ropeode.analysis.roundoff import in_other_units, in_own_units
from ropeode.errors import InputError
from ropeode.norms import Norm, distance, motion
from ropeode.problems.ensemble import Ensemble, family
from ropeode.problems.problem import Problem
from ropeode.simulation import Trajectory, simulate
from ropeode.steppers.base import Stepper
from ropeode.sweep.execution.references import Known


class Subject(NamedTuple):
    """A problem and what is known of its solution.

    Fields:
        problem: that is solved.
        rescaled: the same in other units.
        norm: in which errors are measured.
        known: its reference; None if there is none.
        size: how far it moves inside the horizon; infinite without a reference.
        family: equal for problems that can be run side by side, in other units too.
    """

    problem: Problem
    rescaled: Problem
    norm: Norm
    known: Known | None
    size: float
    family: Hashable

    @property
    def states(self) -> np.ndarray:
        """The reference at the trusted samples."""
        assert self.known is not None
        return self.known.states

    @property
    def trusted(self) -> int:
        """The number of these samples."""
        return len(self.states)

    @property
    def resolution(self) -> np.ndarray:
        """Ten times the reference's bound at the trusted samples but the first."""
        assert self.known is not None
        return RESOLUTION_FACTOR * self.known.bounds[self.norm.quantity][1:]


def subject(problem: Problem, norm: Norm, known: Known | None) -> Subject:
    """A problem, ready to be run."""
    size = np.inf if known is None else float(motion(problem, known.states, norm)[-1])
    return Subject(problem, in_other_units(problem), norm, known, size, family(problem))


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
    rhs_evaluations: int | None
    words: Words | None
    error_final: float | None = None
    error_max: float | None = None
    error_rms: float | None = None
    round_off: float | None = None


def run_all(
    subjects: Sequence[Subject], stepper: Stepper, steps_per_frame: int, motion_too: Sequence[bool]
) -> list[Run]:
    """Run a stepper on many problems, and again in other units where there is a reference.

    What becomes of each does not depend on the others.

    Arguments:
        subjects: the problems.
        stepper: that is run.
        steps_per_frame: equal steps in each frame.
        motion_too: for each problem, whether the motion of a rope is to be told.
    """
    families: dict[Hashable, list[int]] = {}
    for index, each in enumerate(subjects):
        families.setdefault(each.family, []).append(index)
    runs: dict[int, Run] = {}
    for indices in families.values():
        alike = [subjects[index] for index in indices]
        words = [motion_too[index] for index in indices]
        found = _run_family(alike, stepper, steps_per_frame, words)
        runs |= zip(indices, found, strict=True)
    return [runs[index] for index in range(len(subjects))]


def _run_family(
    subjects: Sequence[Subject], stepper: Stepper, steps_per_frame: int, motion_too: Sequence[bool]
) -> list[Run]:
    trajectories = _simulated([each.problem for each in subjects], stepper, steps_per_frame)
    runs = [
        Run(
            dt=each.dt,
            status=each.status,
            diverged_at=each.diverged_at,
            rhs_evaluations=each.rhs_evaluations,
            words=_words(each) if words else None,
        )
        for each, words in zip(trajectories, motion_too, strict=True)
    ]
    held = [
        index
        for index, (each, run) in enumerate(zip(subjects, runs, strict=True))
        if each.known is not None and run.status == "ok"
    ]
    if not held:
        return runs
    known = [subjects[index] for index in held]
    doubles = _simulated([each.rescaled for each in known], stepper, steps_per_frame)
    inside = [
        trajectories[index].states[: each.trusted] for index, each in zip(held, known, strict=True)
    ]
    errors = _apart(known, inside, [each.states for each in known])
    noise = _apart(
        known,
        inside,
        [in_own_units(run.states[: of.trusted]) for run, of in zip(doubles, known, strict=True)],
    )
    for place, index in enumerate(held):
        times = trajectories[index].times[1 : known[place].trusted]
        resolution = known[place].resolution
        series = ErrorSeries(known[place].norm, times, errors[place][1:], resolution)
        whole = doubles[place].status == "ok"
        runs[index] = dataclasses.replace(
            runs[index],
            error_final=series.final,
            error_max=series.max,
            error_rms=series.rms,
            round_off=float(np.max(noise[place])) if whole else np.inf,
        )
    return runs


def _simulated(
    problems: Sequence[Problem], stepper: Stepper, steps_per_frame: int
) -> list[Trajectory]:
    """The runs of problems of one family."""
    if stepper.iterates:
        return [simulate(problem, stepper, steps_per_frame) for problem in problems]
    # Programs are compiled for a number of members; so for few numbers.
    full = 1 << (len(problems) - 1).bit_length()
    spare = full - len(problems)
    together = _ensemble((*problems, *(problems[-1] for _ in range(spare))))
    found = simulate(together, stepper, steps_per_frame)
    return [found[index] for index in range(len(problems))]


@functools.lru_cache(maxsize=4)
def _ensemble(problems: tuple[Problem, ...]) -> Ensemble:
    """The same problems are run with many numbers of steps."""
    return Ensemble.of(problems)


def _apart(
    subjects: Sequence[Subject], some: Sequence[np.ndarray], others: Sequence[np.ndarray]
) -> list[np.ndarray]:
    """The distances of pairs of trajectories, all in one go.

    Arguments:
        subjects: whose they are, of one family and with one norm.
        some: states of each, ``(times, *state)``.
        others: the same; where one has fewer times, the others do not count.
    """
    counts = [min(len(a), len(b)) for a, b in zip(some, others, strict=True)]
    pairs = [
        np.concatenate([each[:count] for each, count in zip(series, counts, strict=True)])
        for series in (some, others)
    ]
    first = subjects[0]
    return np.split(distance(first.problem, first.norm, *pairs), np.cumsum(counts)[:-1])


def _words(trajectory: Trajectory) -> Words | None:
    try:
        return motion_words(trajectory)
    except InputError:
        # No rope, or one that cannot hang.
        return None
