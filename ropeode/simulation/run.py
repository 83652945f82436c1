"""Runs of steppers: over one problem, or over the members of an ensemble on all cores."""

from __future__ import annotations

import collections
import dataclasses
import threading
import time
from collections.abc import Iterator
from concurrent.futures import Future
from typing import Any, NamedTuple, SupportsIndex, overload

import jax
import numpy as np

from ropeode.errors import call_user_code
from ropeode.precision import in_float64
from ropeode.problems import (
    Ensemble,
    Numbers,
    Problem,
    require_memory,
    require_problem,
    without_memory,
)
from ropeode.progress import Progress, bar, shows_progress
from ropeode.simulation.jumps import Intervals, intervals, sides
from ropeode.simulation.layout import Layout
from ropeode.simulation.method import Family, Method, method_of
from ropeode.simulation.program import Program, program
from ropeode.simulation.python_driver import run_in_python
from ropeode.simulation.time_needed import LONGEST_S, TimeNeeded, check_longest
from ropeode.simulation.trajectory import Iterations, Trajectories, Trajectory
from ropeode.steppers import BuiltIn
from ropeode.threads import cores, threads
from ropeode.validation import check_kind, check_memory, check_whole

# States that one call of a program writes, and that a chunk of an ensemble holds, in bytes.
_SEGMENT = 2**23
_CHUNK = 2**24
_FEWEST_FRAMES, _MOST_FRAMES, _MOST_BLOCKS = 16, 128, 64
# Of a right-hand side in Python, to see that it keeps no memory.
_MOST_CALLS = 32
# A compiled run is tried with so many steps at first, and with no more than a part of its own.
_FEWEST_STEPS, _SHARE = 4096, 0.01


@overload
def simulate(
    given: Problem,
    stepper: Any,
    steps_per_frame: SupportsIndex,
    *,
    time_limit: float = ...,
    progress: Progress = ...,
) -> Trajectory: ...
@overload
def simulate(
    given: Ensemble,
    stepper: Any,
    steps_per_frame: SupportsIndex,
    *,
    time_limit: float = ...,
    progress: Progress = ...,
) -> Trajectories: ...
@shows_progress
def simulate(
    given: Problem | Ensemble,
    stepper: Any,
    steps_per_frame: SupportsIndex,
    *,
    time_limit: float = LONGEST_S,
    progress: Progress = bar,
) -> Trajectory | Trajectories:
    """Run a stepper over all frames of a problem, or of each member of an ensemble.

    A run that leaves the finite numbers is not computed much past the frame where it does, and
    does not hold up the others of its ensemble. Those are run side by side, on all cores; what
    becomes of a member does not depend on the others.

    Arguments:
        given: what to solve.
        stepper: whatever `ropeode.as_stepper` takes.
        steps_per_frame: equal steps in each interval between sample times; as many in each part of
            it if the right-hand side jumps inside.
        time_limit: seconds; a run that would take longer, as its first steps show, is refused.
        progress: called with the stepper's label and the fraction that is done.

    Raises:
        InputError: the stepper does not exist or cannot run on a problem, `steps_per_frame` is
            not a whole number >= 1, or so large that a run takes longer than the time limit; or
            the states do not fit into memory.
        UserCodeError: a user's step raised, returned something that is no state, or keeps hidden
            state.

    Examples:
        >>> from ropeode import Rope, simulate
        >>> run = simulate(Rope(num_nodes=4).problem(frames=3), "rk4", steps_per_frame=16)
        >>> run.status, run.states.shape
        ('ok', (4, 2, 2, 4))
        >>> run.positions[-1, 3].round(2)
        array([-399.93,  195.54])
    """
    if isinstance(given, Ensemble):
        # Twice: in chunks, and joined.
        each = 2 * (given.first.frames + 1) * given.first.y0.nbytes
        turns = "take them in turn with simulate_chunks, or sample fewer frames"
        check_memory(len(given), each, "ensemble", turns)
        limits = {"time_limit": time_limit, "progress": progress}
        return _joined(list(simulate_chunks(given, stepper, steps_per_frame, **limits)))
    require_problem(given)
    require_memory(given, copies=1)
    steps = check_whole("steps_per_frame", steps_per_frame, at_least=1, example="64")
    given.require_equations()
    method = method_of(stepper, given)
    own = Numbers(given.y0[..., None], jax.tree.map(lambda leaf: leaf[..., None], given.args))
    longest = check_longest(time_limit)
    job = _Job(Ensemble.of([given]), intervals(given), method, steps, Layout(1, None), 1, longest)
    with without_memory(given, _MOST_CALLS):
        return job.trajectories(0, own, progress)[0]


@shows_progress
def simulate_chunks(
    ensemble: Ensemble,
    stepper: Any,
    steps_per_frame: SupportsIndex,
    *,
    time_limit: float = LONGEST_S,
    progress: Progress = bar,
) -> Iterator[Trajectories]:
    """Run a stepper over an ensemble of any size, some members at a time.

    No more than a few chunks exist at once, so that memory stays bounded.

    Arguments:
        ensemble: what to solve.
        stepper, steps_per_frame, progress: as for `simulate`.
        time_limit: of the members that run together, a chunk at most.

    Returns:
        Trajectories of the first members, of the next ones, and so on.

    Raises:
        InputError: as for `simulate`.

    Examples:
        >>> from ropeode import Rope, simulate_chunks
        >>> ropes = Rope(num_nodes=4).ensemble(frames=3, damping=[0.0, 0.01, 0.1])
        >>> for some in simulate_chunks(ropes, "rk4", steps_per_frame=16):
        ...     print(some.start, some.states.shape)
        0 (4, 2, 2, 4, 3)
    """
    check_kind("ensemble", ensemble, Ensemble, "Ensemble.of")
    steps = check_whole("steps_per_frame", steps_per_frame, at_least=1, example="64")
    first = ensemble.first
    first.require_equations()
    method = method_of(stepper, first)
    for each in ensemble.built_apart:
        method.stepper.require(each)
    layout, count = Layout.of(first, method.stepper), cores()
    needed = layout.blocks(len(ensemble))
    block = (first.frames + 1) * first.y0.nbytes * layout.lanes
    # As many as fill a chunk, unless that would leave a core idle.
    blocks = min(max(_CHUNK // block, 1), _MOST_BLOCKS, -(-needed // count))
    longest = check_longest(time_limit)
    job = _Job(ensemble, intervals(first), method, steps, layout, blocks, longest)
    return job.in_chunks(count, progress)


def _joined(chunks: list[Trajectories]) -> Trajectories:
    """All chunks of an ensemble in one."""
    first = chunks[0]
    if len(chunks) == 1:
        return first

    def all_of(name: str) -> np.ndarray | None:
        parts = [getattr(chunk, name) for chunk in chunks]
        return None if any(part is None for part in parts) else np.concatenate(parts, axis=-1)

    return dataclasses.replace(
        first,
        **{name: all_of(name) for name in ("states", "frames", "finite", "solved")},
        **{name: all_of(name) for name in ("rhs_evaluations", "jacobian_evaluations")},
        seconds=sum(each.seconds for each in chunks),
        compile_seconds=sum(each.compile_seconds for each in chunks),
    )


class _Job(NamedTuple):
    """Members of an ensemble that are to be run, in so many steps per frame and blocks.

    A chunk of them may take so many seconds.
    """

    ensemble: Ensemble
    course: Intervals
    method: Method
    steps: int
    layout: Layout
    blocks: int
    longest: float

    def in_chunks(self, count: int, progress: Progress) -> Iterator[Trajectories]:
        """Trajectories of one chunk after the other, on so many threads."""
        members, size = self.layout.lanes * self.blocks, len(self.ensemble)
        shares = collections.Counter[int]()
        lock = threading.Lock()

        def chunk(start: int) -> Trajectories:
            numbers = self.ensemble.numbers(start, min(start + members, size))

            def seen(text: str, fraction: float | None) -> None:
                with lock:
                    shares[start] = (fraction or 0.0) * numbers.y0.shape[-1]
                    progress(text, sum(shares.values()) / size)

            with without_memory(self.ensemble.first, _MOST_CALLS):
                return self.trajectories(start, numbers, seen)

        starts = iter(range(0, size, members))
        waiting: collections.deque[Future[Trajectories]] = collections.deque()
        with threads(count) as pool:
            while True:
                # One more than there are threads, so that none waits for what is read here.
                while len(waiting) <= count and (start := next(starts, None)) is not None:
                    waiting.append(pool.submit(chunk, start))
                if not waiting:
                    return
                yield waiting.popleft().result()

    @in_float64
    def trajectories(self, start: int, numbers: Numbers, progress: Progress) -> Trajectories:
        """Run the members from `start` on whose numbers these are."""
        members = numbers.y0.shape[-1]
        if self.method.trial.compiled:
            y0, args = self.layout.fold(numbers, self.blocks)
            made = self._program(y0, args)
            self._refuse_too_long(made, y0, args, members)
            started = time.perf_counter()
            states, reached, said = self._segments(made, y0, args, members, progress)
            seconds = time.perf_counter() - started
            frames, finite = _ends(states, reached)
            run = self.course.samples[frames]
            starts = np.cumsum(self.course.fresh)[run - 1]
            calls, jacobians = made.calls(self.steps, starts, run, said.jacobians)
        else:
            started, made = time.perf_counter(), None
            states, reached, calls, said = self._in_python(start, members, progress)
            seconds = time.perf_counter() - started
            frames, finite = _ends(states, reached)
            jacobians = said.jacobians
        return Trajectories(
            ensemble=self.ensemble,
            start=start,
            stepper=self.method.stepper,
            steps_per_frame=self.steps,
            states=states,
            frames=frames,
            finite=finite,
            solved=said.solved,
            rhs_evaluations=calls,
            jacobian_evaluations=jacobians,
            seconds=seconds,
            compile_seconds=made.take_compile_seconds() if made else 0.0,
        )

    def _in_python(
        self, start: int, members: int, progress: Progress
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, Iterations]:
        """As `run_in_python` does, of one member after the other."""

        def run(index: int) -> tuple[np.ndarray, int, int, Iterations]:
            def seen(text: str, fraction: float | None) -> None:
                progress(text, (index + (fraction or 0.0)) / members)

            problem = self.ensemble[start + index]
            stepper, longest = self.method.stepper, self.longest / members
            return run_in_python(problem, stepper, self.steps, longest, seen)

        states, reached, calls, said = zip(*map(run, range(members)), strict=True)
        iterations = Iterations(*map(np.array, zip(*said, strict=True)))
        return np.stack(states, axis=-1), np.array(reached), np.array(calls), iterations

    def _refuse_too_long(self, made: Program, y0: np.ndarray, args: Any, members: int) -> None:
        """Raises:
        InputError: the run would take too long, as some of its first steps show.
        """
        (times, lengths, *_), count = self.course, self.layout.blocks(members)
        total, steps, start = self.steps * len(lengths), _FEWEST_STEPS, times[0]
        needed = TimeNeeded(self.longest, self.steps, len(lengths))
        while steps < _SHARE * total and not needed.known:
            length = steps * (lengths[:1] / self.steps)
            began = time.perf_counter()
            made.run(y0, args, np.append(start, start + length), length, steps, None, count)
            if not needed.tried(steps, time.perf_counter() - began):
                steps *= 4

    def _program(self, y0: np.ndarray, args: Any) -> Program:
        first = self.ensemble.first
        leaves, tree = jax.tree.flatten(args)
        family = Family(
            method=self.method,
            rhs=first.rhs,
            mechanics=first.mechanics,
            layout=self.layout,
            y0=jax.ShapeDtypeStruct(y0.shape[1:], y0.dtype),
            args_tree=tree,
            args_leaves=tuple(jax.ShapeDtypeStruct(leaf.shape[1:], leaf.dtype) for leaf in leaves),
            sides=sides(first),
        )
        # Powers of two, and not the smallest, so that few programs serve all lengths.
        fit = min(max(_SEGMENT // y0.nbytes, 1), _MOST_FRAMES)
        needed = max(first.frames, _FEWEST_FRAMES)
        frames = min(1 << (fit.bit_length() - 1), 1 << (needed - 1).bit_length())
        if isinstance(self.method.stepper, BuiltIn):
            return program(family, frames, self.blocks)
        return call_user_code("step", program, family, frames, self.blocks)

    def _segments(
        self, made: Program, y0: np.ndarray, args: Any, members: int, progress: Progress
    ) -> tuple[np.ndarray, np.ndarray, Iterations]:
        """States of the members, the last frame that the block of each was taken to, and more."""
        first, count = self.ensemble.first, self.layout.blocks(members)
        times, lengths, fresh, samples = self.course
        starts = np.append(np.flatnonzero(fresh), len(lengths))
        states = np.full((count, len(times), *y0.shape[1:]), np.nan)
        states[:, 0] = y0[:count]
        reached = np.zeros(count, dtype=np.int64)
        done, carried, before, said = 0, None, Iterations(True, 0), Iterations(True, 0)
        while done < len(lengths) and np.any(reached == done):
            if fresh[done] and done:
                y0, carried, before = np.array(y0), None, said
                y0[:count] = states[:, done]
            until = min(done + made.capacity, starts[np.searchsorted(starts, done, side="right")])
            ran, new, new_said, carried = made.run(
                y0,
                args,
                times[done : until + 1],
                lengths[done:until],
                self.steps,
                carried,
                count,
            )
            said = before.and_then(new_said)
            for block in np.flatnonzero(reached == done):
                reached[block] += ran[block]
                states[block, done + 1 : reached[block] + 1] = new[block, : ran[block]]
            done = until
            progress(self.method.stepper.label, done / len(lengths))
        states = self.layout.unfold(states[:, samples], first.y0.shape, members)
        said = Iterations(*(np.asarray(each).reshape(-1)[:members] for each in said))
        reached = np.searchsorted(samples, reached)
        return states, np.repeat(reached, self.layout.lanes)[:members], said


def _ends(states: np.ndarray, reached: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The last frame that counts of each member, and whether its state there is finite.

    States ``(times, *state, members)`` behind one that is not finite become not-a-number.
    """
    flat = states.reshape(len(states), -1, states.shape[-1])
    every = np.all(np.isfinite(flat), axis=1)
    finite: np.ndarray = np.all(every, axis=0)
    frames = np.where(finite, reached, np.argmin(every, axis=0))
    for member in np.flatnonzero(~finite):
        states[frames[member] :, ..., member] = np.nan
    return frames, finite
