"""What a right-hand side decides by looking at the state, and whether it stays so.

A Taylor series knows one smooth function. Where a right-hand side chooses between several, as
in `jnp.where(squared > 0, ...)` or `abs`, the choice is made once, just after the start, and the
branch that was taken is followed. It counts as an assumption, which is looked at again wherever
a step ends: a guard against a division by zero that never happens keeps it; a switch does not.
What changes and changes back within one step is not seen.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ropeode.precision import in_float64
from ropeode.problems.problem import Problem
from ropeode.references.extended.entries import CHOICES
from ropeode.references.extended.jaxprs import Value, bind, is_float, walk
from ropeode.references.extended.rules import STEPS

# States are looked at so many at once, so that one compilation serves all.
_BLOCK = 128
# The choices are made so much of a frame after the start: at the start itself, what begins to
# move has no sign yet.
_AFTER = 1e-3


def chooses(equation: Any, inputs: Sequence[Value]) -> bool:
    """Whether a primitive makes a choice by looking at floating-point numbers that move."""
    looks = any(
        value.moves and is_float(variable)
        for value, variable in zip(inputs, equation.invars, strict=True)
    )
    if not looks or len(equation.outvars) != 1:
        return False
    name = equation.primitive.name
    return name in CHOICES or name in STEPS or not is_float(equation.outvars[0])


def chosen(equation: Any, contents: Sequence[Any], results: Sequence[Any]) -> Any:
    """The choice of a primitive that makes one."""
    name = equation.primitive.name
    if name in ("abs", "cbrt"):
        return contents[0] >= 0
    if name in ("max", "min"):
        return contents[0] >= contents[1]
    if name == "clamp":
        low, x, high = contents
        return (x >= low).astype(int) + (x > high)
    return results[0]


class Guards:
    """The choices of a problem's right-hand side, made shortly after a time.

    Arguments:
        problem: whose they are.
        traced: its right-hand side as a jaxpr.
        t: where the solution starts.
        y: the state there.
    """

    def __init__(self, problem: Problem, traced: Any, t: float, y: np.ndarray):
        self.names: list[str] = []
        leaves = [Value(leaf, False) for leaf in jax.tree.leaves(problem.args)]

        def watch(t: Any, y: Any) -> list[Any]:
            watched = _Watch()
            walk(traced, [Value(t, True), Value(y, True), *leaves], watched)
            self.names = watched.names
            return watched.choices

        self._watch = jax.jit(jax.vmap(watch))
        jax.eval_shape(self._watch, np.array([t]), y[None])
        self.choices: list[np.ndarray] = []
        if self.names:
            at, state = _shortly_after(problem, t, y)
            self.choices = [each[0] for each in next(self._choices_at([at], state[None]))]

    @in_float64
    def first_break(self, ts: Sequence[float], states: np.ndarray) -> tuple[int, str] | None:
        """The first state at which a choice changes, and the primitive that makes it.

        Arguments:
            ts: times.
            states: ``(times, *state)``.
        """
        if not self.names:
            return None
        for block, choices in enumerate(self._choices_at(ts, states)):
            other = np.stack(
                [
                    np.any((now != choice).reshape(len(now), -1), axis=1)
                    for now, choice in zip(choices, self.choices, strict=True)
                ]
            )
            if np.any(other):
                at = int(np.argmax(np.any(other, axis=0)))
                return block * _BLOCK + at, self.names[int(np.argmax(other[:, at]))]
        return None

    def _choices_at(self, ts: Sequence[float], states: np.ndarray) -> Iterator[list[np.ndarray]]:
        for first in range(0, len(ts), _BLOCK):
            t = np.asarray(ts[first : first + _BLOCK], dtype=np.float64)
            y = states[first : first + _BLOCK]
            # The last state fills the block up, so that all blocks are equally long.
            rows = np.minimum(np.arange(_BLOCK), len(t) - 1)
            yield [np.asarray(each)[: len(t)] for each in self._watch(t[rows], y[rows])]


class _Watch:
    """Arrays of JAX, and the choices that primitives make on the way."""

    def __init__(self) -> None:
        self.names: list[str] = []
        self.choices: list[Any] = []

    def constant(self, array: Any) -> Any:
        return jnp.asarray(array)

    def apply(self, equation: Any, inputs: Sequence[Value]) -> list[Any]:
        contents = [value.content for value in inputs]
        results = bind(equation, contents)
        if chooses(equation, inputs):
            self.names.append(equation.primitive.name)
            self.choices.append(chosen(equation, contents, results))
        return results


def _shortly_after(problem: Problem, t: float, y: np.ndarray) -> tuple[float, np.ndarray]:
    """A time shortly after the start and the state there, by one step of a Runge-Kutta method."""
    stops = np.array([*problem.ts, *problem.jump_times])
    dt = _AFTER * float(np.min(stops[stops > t]) - t)
    slope = jax.jit(problem.rhs)

    def rhs(t: float, y: Any) -> np.ndarray:
        return np.asarray(slope(t, y, problem.args))

    # Not at the start itself, which may be a jump time and then ends the piece before.
    k1 = rhs(float(np.nextafter(t, np.inf)), y)
    k2 = rhs(t + dt / 2, y + dt / 2 * k1)
    k3 = rhs(t + dt / 2, y + dt / 2 * k2)
    k4 = rhs(t + dt, y + dt * k3)
    return t + dt, y + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
