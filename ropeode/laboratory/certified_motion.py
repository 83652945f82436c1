"""The reference of a problem as the page shows it, with all that its runs are compared with."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Sequence

import numpy as np

from ropeode.analysis import energy_errors, in_other_units
from ropeode.laboratory.drawings import Drawing, drawing_of, finite_samples
from ropeode.norms import Norm, distance, norm_for
from ropeode.problems import Problem
from ropeode.progress import Progress, part_of
from ropeode.references import (
    Reference,
    ReferenceOptions,
    problem_of,
    reference_for,
)
from ropeode.simulation import Method, Trajectory, simulate
from ropeode.study import EnergyCurves, Row, energies_of, rows_of_run, sampled_finer
from ropeode.threads import cores, threads

# Samples in each frame, and in all.
_IN_A_FRAME, _IN_ALL = 8, 200


@dataclasses.dataclass(frozen=True, eq=False)
class CertifiedMotion:
    """A certified reference, at the frames and between them.

    Arguments:
        reference: at the samples of the problem; that of an accuracy table.
        finer: the same solution with more samples in each frame, for the eye; its certificate
            covers them all.
        samples_per_frame: a power of two.
        drawing: how the problem is drawn.
        rescaled: the problem in other units, which shows the round-off of runs.
    """

    reference: Reference
    finer: Reference
    samples_per_frame: int
    drawing: Drawing
    rescaled: Problem

    @property
    def problem(self) -> Problem:
        """What is solved."""
        return self.reference.problem

    @functools.cached_property
    def norm(self) -> Norm:
        """In which errors are measured."""
        return norm_for(self.problem)

    @functools.cached_property
    def points(self) -> np.ndarray:
        """What is drawn, ``(samples, points, 2)``."""
        return self.drawing.points(self.finer.times, self.finer.states)

    @functools.cached_property
    def energy(self) -> EnergyCurves | None:
        """The true energy; None where the problem has none."""
        if self.problem.energy is None:
            return None
        finer = self.finer
        return energies_of(finer.problem, finer, finer.states[: finer.trusted], ())

    @property
    def nbytes(self) -> int:
        """Memory that it takes, in bytes."""
        arrays = (self.reference.states, self.finer.states, self.points)
        return sum(each.nbytes for each in arrays)

    def every(self, steps_per_frame: int) -> int:
        """A run has every so manieth of the samples: those at the ends of its steps."""
        return self.samples_per_frame // int(np.gcd(self.samples_per_frame, steps_per_frame))

    @functools.cached_property
    def sampled(self) -> Callable[[int], Problem]:
        """The problem with every so manieth of the samples."""

        @functools.cache
        def with_every(every: int) -> Problem:
            if every == self.samples_per_frame:
                return self.problem
            return self.finer.problem.changed(ts=np.array(self.finer.problem.ts[::every]))

        return with_every

    def run(self, method: Method, steps_per_frame: int, progress: Progress) -> Trajectory:
        """A run with as many of the finer samples as its steps end on."""
        every = self.every(steps_per_frame)
        steps = steps_per_frame * every // self.samples_per_frame
        return simulate(self.sampled(every), method, steps, progress=progress)

    def row(self, method: Method, steps_per_frame: int, progress: Progress) -> Row:
        """The row of the accuracy table."""
        what = self.problem, self.rescaled, method, steps_per_frame, self.reference, [self.norm]
        (row,) = rows_of_run(*what, progress)
        return row

    def differences(self, states: np.ndarray, every: int) -> dict[str, np.ndarray]:
        """The arrays of a `ropeode.laboratory.messages.Run`, in float64.

        Arguments:
            states: of the run at its leading samples, ``(times, *state)``.
            every: so manieth of the reference's samples.
        """
        finer, problem = self.finer, self.sampled(every)
        with np.errstate(over="ignore", invalid="ignore"):
            drawn = self.drawing.points(problem.ts[: len(states)], states)
            count = finite_samples(drawn)
            differences = drawn[:count] - self.points[::every][:count]
        trusted = min(len(states), -(-finer.trusted // every))
        truth = finer.states[::every][:trusted]
        arrays = {
            "differences": differences,
            "errors": distance(problem, self.norm, states[:trusted], truth),
        }
        if self.energy is not None:
            # As many states each time, so that one compilation serves runs that ended early.
            missing = len(problem.ts) - len(states)
            whole = np.concatenate([states, np.repeat(problem.y0[None], missing, axis=0)])
            energies = problem.energies(whole)[: len(states)]
            arrays["energy_differences"] = energy_errors(energies, self.energy.values[::every])
        return {name: each[: finite_samples(each)] for name, each in arrays.items()}


def certified_motion(
    source: Problem | Reference, methods: Sequence[Method], progress: Progress
) -> CertifiedMotion:
    """Compute the reference of a problem, and the same between its samples.

    Arguments:
        source: a problem; or its reference, which has the samples that it has.
        methods: steppers that are compiled meanwhile, before anyone waits for them.
        progress: called before each run of a solver.

    Raises:
        ReferenceRefused: no reference can be certified.
    """
    problem = problem_of(source)
    parts = 1 if isinstance(source, Reference) else _parts(problem.frames)
    finer_problem = sampled_finer(problem, parts)
    assert isinstance(finer_problem, Problem)
    rescaled = in_other_units(problem)
    with threads(cores()) as pool:
        for method in methods:
            for each in (problem, finer_problem, rescaled):
                pool.submit(simulate, each, method, 1)
        reference = reference_for(source, ReferenceOptions(), part_of(progress, 0.0, 0.5))
        finer = reference
        if parts > 1:
            finer = reference_for(finer_problem, ReferenceOptions(), part_of(progress, 0.5, 1.0))
    return CertifiedMotion(reference, finer, parts, drawing_of(problem), rescaled)


def _parts(frames: int) -> int:
    """A power of two, so that most numbers of steps per frame end on all samples."""
    parts = _IN_A_FRAME
    while parts > 1 and parts * frames > _IN_ALL:
        parts //= 2
    return parts
