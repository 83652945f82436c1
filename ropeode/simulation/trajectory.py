"""What a stepper made of a problem, or of many."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any, Literal, NamedTuple

import numpy as np

from ropeode.display import Sampled
from ropeode.problems import Ensemble, Problem
from ropeode.steppers import Stepper

# How a run ended.
Status = Literal["ok", "diverged", "unsolved"]


class Iterations(NamedTuple):
    """What a stepper says of the iterations inside its steps since the start of some runs.

    Fields:
        solved: whether its equations were solved, ``(blocks, lanes)``.
        jacobians: evaluated, each with the right-hand side; 0 where it does not say,
            ``(blocks, lanes)``.
    """

    solved: Any
    jacobians: Any

    def and_then(self, later: Iterations) -> Iterations:
        """Those of runs and of what went on from them."""
        return Iterations(self.solved & later.solved, self.jacobians + later.jacobians)


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Trajectory(Sampled):
    """What a stepper made of a problem.

    Arguments:
        problem: what was solved.
        stepper: with what.
        steps_per_frame: steps between two sample times; ``dt = frame/steps_per_frame``.
        times: the sample times up to the last one with a finite state, ``(times,)``.
        states: the states there, ``(times, *state)``; the first is the initial state.
        status: `ok`; `unsolved` if the equations of an implicit step were not solved; `diverged` if
            a state was not finite for another reason.
        diverged_at: the frame (index of the sample time) of the first state that was not finite,
            whatever the reason.
        rhs_evaluations: of the right-hand side (or acceleration), for the steps made; None where
            the step makes them in a loop, whose length nobody knows.
        jacobian_evaluations: of its Jacobian, by an implicit stepper; None likewise.
        seconds: to run, without compiling.
        compile_seconds: to trace and compile; 0 if that had been done before.

    Examples:
        >>> from ropeode import Rope, simulate
        >>> run = simulate(Rope(num_nodes=4).problem(frames=3), "rk4", steps_per_frame=16)
        >>> run
        <Trajectory: rk4, 16 steps/frame; rope, 4 nodes, damping 0.01, 3 frames; ok, 4 samples>
        >>> run.dt, run.rhs_evaluations
        (0.0625, 192)
    """

    problem: Problem
    stepper: Stepper
    steps_per_frame: int
    times: np.ndarray
    states: np.ndarray
    status: Status
    diverged_at: int | None
    rhs_evaluations: int | None
    jacobian_evaluations: int | None
    seconds: float = dataclasses.field(compare=False)
    compile_seconds: float = dataclasses.field(compare=False)

    @property
    def dt(self) -> float:
        """The step size; the largest where frames differ in length."""
        return step_size(self.problem, self.steps_per_frame)

    @property
    def lost(self) -> str | None:
        """What became of a run that ended early, in words; None if it did not."""
        if self.status == "ok":
            return None
        how = "diverged" if self.status == "diverged" else "was not solved"
        return f"{how} at frame {self.diverged_at}"

    @property
    def tree(self) -> Any:
        """The states as a pytree like the initial state, with an axis of times in each array."""
        return self.problem.unravel(self.states)

    @property
    def positions(self) -> np.ndarray:
        """Positions, ``(times, nodes, dim)``."""
        return self.problem.positions(self.states)

    @property
    def velocities(self) -> np.ndarray:
        """Velocities, ``(times, nodes, dim)``."""
        return self.problem.velocities(self.states)


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Trajectories(Sampled):
    """What a stepper made of members of an ensemble.

    ``trajectories[i]`` is a `Trajectory`.

    Arguments:
        ensemble: what was solved.
        start: the index of the first member that is in here.
        stepper: with what.
        steps_per_frame: steps between two sample times.
        states: ``(times, *state, members)``; not a number from the frame on where a member's
            state was not finite.
        frames: the index of the last sample time that was looked at for each member,
            ``(members,)``.
        finite: whether its state there was finite, ``(members,)``.
        solved: whether the equations of all its steps were solved, ``(members,)``.
        rhs_evaluations: of the right-hand side, for each member, ``(members,)``; None as for a
            `Trajectory`.
        jacobian_evaluations: of its Jacobian, likewise.
        seconds: to run all these members, without compiling.
        compile_seconds: to trace and compile; 0 if that had been done before.

    Examples:
        >>> from ropeode import Rope, simulate
        >>> ropes = Rope(num_nodes=4).ensemble(frames=3, damping=[0.0, 0.01, 0.1])
        >>> runs = simulate(ropes, "rk4", steps_per_frame=16)
        >>> runs.states.shape, runs[1].status
        ((4, 2, 2, 4, 3), 'ok')
    """

    ensemble: Ensemble
    start: int
    stepper: Stepper
    steps_per_frame: int
    states: np.ndarray
    frames: np.ndarray
    finite: np.ndarray
    solved: np.ndarray
    rhs_evaluations: np.ndarray | None
    jacobian_evaluations: np.ndarray | None
    seconds: float = dataclasses.field(compare=False)
    compile_seconds: float = dataclasses.field(compare=False)

    def __len__(self) -> int:
        return self.states.shape[-1]

    def __iter__(self) -> Iterator[Trajectory]:
        return map(self.__getitem__, range(len(self)))

    def __getitem__(self, index: int) -> Trajectory:
        """The trajectory of one of these members."""
        if not -len(self) <= index < len(self):
            raise IndexError(f"trajectory {index} of {len(self)}")
        index %= len(self)
        problem = self.ensemble[self.start + index]
        frame, finite = int(self.frames[index]), bool(self.finite[index])
        kept = frame + finite
        lost: Status = "diverged" if self.solved[index] else "unsolved"

        def count(each: np.ndarray | None) -> int | None:
            return None if each is None else int(each[index])

        return Trajectory(
            problem=problem,
            stepper=self.stepper,
            steps_per_frame=self.steps_per_frame,
            times=problem.ts[:kept],
            states=np.ascontiguousarray(self.states[:kept, ..., index]),
            status="ok" if finite else lost,
            diverged_at=None if finite else frame,
            rhs_evaluations=count(self.rhs_evaluations),
            jacobian_evaluations=count(self.jacobian_evaluations),
            seconds=self.seconds / len(self),
            compile_seconds=self.compile_seconds if index == 0 else 0.0,
        )


def step_size(problem: Problem, steps_per_frame: int) -> float:
    """The (largest) step size of a number of steps per frame."""
    return float(np.max(frame_lengths(problem))) / steps_per_frame


def frame_lengths(problem: Problem) -> np.ndarray:
    """The length of each frame; all the same number where they are equal but for rounding."""
    if problem.equal_frames:
        return np.full(problem.frames, (problem.ts[-1] - problem.ts[0]) / problem.frames)
    return np.diff(problem.ts)
