"""Compiled programs that run steppers, one for each family of runs."""

from __future__ import annotations

import functools
import threading
import time
from collections.abc import Callable
from typing import Any

import jax
import numpy as np

from ropeode import cache
from ropeode.cache import Source, described
from ropeode.simulation.method import Family
from ropeode.simulation.trajectory import Iterations
from ropeode.simulation.user_clock import on_user_clock
from ropeode.steppers import BuiltIn


class Program:
    """A compiled loop for one family of runs; of several threads that ask for it one compiles it.

    Arguments:
        family: of runs.
        capacity: the most frames that it runs in one go.
        blocks: the most of them.
    """

    def __init__(self, family: Family, capacity: int, blocks: int):
        self.capacity = capacity
        self._of = family, capacity, blocks
        self._lock = threading.Lock()
        self._compiled: Callable | None = None
        # Seconds that compiling took; 0 once they were taken.
        self._compile_seconds = 0.0

    def compile(self) -> None:
        """Compile it, where that has not been done.

        The numbers of steps, and of frames of each block, are run-time values.
        """
        with self._lock:
            if self._compiled is not None:
                return
            started = time.perf_counter()
            compiled, facts = cache.program(_description(*self._of), lambda: _source(*self._of))
            # Of the right-hand side, to start, in a step, and for a sample, without those that the
            # stepper counts; None where they are made in a loop, whose length nobody knows.
            self._evaluations = facts["evaluations"]
            # Stands for what is carried where there is nothing yet.
            self._nothing = [np.zeros(shape, dtype) for shape, dtype in facts["carried"]]
            self._compiled = compiled
            self._compile_seconds = time.perf_counter() - started

    def run(
        self,
        y0: np.ndarray,
        args: Any,
        ts: np.ndarray,
        lengths: np.ndarray,
        steps: int,
        carried: Any = None,
        count: int = 1,
    ) -> tuple[np.ndarray, np.ndarray, Iterations, Any]:
        """Run the frames between sample times, in one go.

        Arguments:
            y0: initial states, ``(blocks, *state)``.
            args: of the problem; each leaf has the blocks first.
            ts: sample times, at most one more than the capacity.
            lengths: of the frames.
            steps: in each frame.
            carried: what an earlier call returned; None at the start.
            count: how many of the blocks are run.

        Returns:
            How many frames were run of each block: fewer where no run of it is finite any more.
            The states at their ends, ``(blocks, capacity, *state)``. What the stepper said of its
            iterations since the start. What the next call goes on from.
        """
        compiled = self._compiled
        assert compiled is not None
        frames, states, solved, jacobians, *carried = on_user_clock(
            lambda *given: jax.block_until_ready(compiled(*given)),
            y0,
            args,
            # What follows is not read.
            np.resize(ts, self.capacity + 1),
            np.resize(lengths, self.capacity),
            np.where(np.arange(len(y0)) < count, len(lengths), 0),
            np.int64(steps),
            np.bool_(carried is None),
            self._nothing if carried is None else carried,
        )
        said = Iterations(np.asarray(solved), np.asarray(jacobians))
        return np.asarray(frames), np.asarray(states), said, carried

    def calls(
        self, steps: int, starts: np.ndarray, frames: np.ndarray, jacobians: np.ndarray
    ) -> tuple[np.ndarray | None, np.ndarray | None]:
        """How often runs evaluate the right-hand side and its Jacobian, if it is known.

        Arguments:
            steps: in a frame, or a part of one between jumps.
            starts: of the method in each run, ``(runs,)``.
            frames: of each run, or such parts, ``(runs,)``.
            jacobians: that the stepper counted, each with the right-hand side, ``(runs,)``.
        """
        if self._evaluations is None:
            return None, None
        to_start, per_step, per_sample = self._evaluations
        return to_start * starts + (per_step * steps + per_sample) * frames + jacobians, jacobians

    def take_compile_seconds(self) -> float:
        """The seconds that compiling took; 0 for every later use of the program."""
        seconds, self._compile_seconds = self._compile_seconds, 0.0
        return seconds


# Those used last are kept.
_program = functools.lru_cache(maxsize=256)(Program)


def program(family: Family, capacity: int, blocks: int) -> Program:
    """The program for so many frames and blocks, compiled where that has not been done."""
    own = _program(family, capacity, blocks)
    own.compile()
    return own


def _description(family: Family, capacity: int, blocks: int) -> str | None:
    """What tells a program of ropeode's own from all others; None for one of the user's."""
    args = jax.tree.unflatten(family.args_tree, family.args_leaves)
    stepper = family.method.stepper
    if not isinstance(stepper, BuiltIn):
        return None
    of_problem = family.rhs, family.mechanics, family.y0, args
    return described((stepper, of_problem, family.sides, family.layout, capacity, blocks))


def _source(family: Family, capacity: int, blocks: int) -> Source:
    # Not above: a program that is kept needs none.
    from ropeode.simulation.driver import source_of

    return source_of(family, capacity, blocks)
