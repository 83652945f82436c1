"""What a right-hand side decides by looking at the state, and whether it stays so.

A Taylor series knows one smooth function. Where a right-hand side chooses between several, as
in `jnp.where(squared > 0, ...)` or `abs`, the choice is made once, just after the start, and the
branch that was taken is followed. It counts as an assumption, which is looked at again wherever
a step ends: a guard against a division by zero that never happens keeps it; a switch does not.
What changes and changes back within one step is not seen.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ropeode.precision import in_float64
from ropeode.problems import Problem, compiled
from ropeode.references.extended.jaxprs import Value, bind, is_float, refuse, steers, walk
from ropeode.references.extended.rules import choosing, chosen, differ, turns

# States are looked at so many at once, so that one compilation serves all.
_BLOCK = 128
# So much of a frame is shortly after a time.
_AFTER = 1e-3


def looked_at(equation: Any, inputs: Sequence[Value]) -> list[int]:
    """The inputs without a fraction, of a primitive with floating-point results, that move.

    Indices, conditions and whole numbers that follow from the state: each of them is a choice.
    """
    if not any(is_float(variable) for variable in equation.outvars):
        return []
    return [
        i
        for i, (value, variable) in enumerate(zip(inputs, equation.invars, strict=True))
        if value.moves and not is_float(variable)
    ]


def chooses(equation: Any, inputs: Sequence[Value]) -> bool:
    """Whether a primitive chooses by looking at floating-point numbers that move."""
    if not any(is_float(variable) for variable in equation.outvars) or not choosing(equation):
        return False
    return any(
        value.moves and is_float(variable)
        for value, variable in zip(inputs, equation.invars, strict=True)
    )


class Guards:
    """The choices of a problem's right-hand side at a time.

    Arguments:
        problem: whose they are.
        traced: its right-hand side as a jaxpr.
        t: when they are made.
        y: the state there.
    """

    def __init__(self, problem: Problem, traced: Any, t: float, y: np.ndarray):
        self._leaves = [jnp.asarray(leaf) for leaf in jax.tree.leaves(problem.args)]
        self._traced, self._steers = traced, steers(traced)
        self.choices: list[np.ndarray] = []
        if self._steers:
            self.choices = self.at(t, y)
            watched, self._watch = _watching(traced, self.choices)
        else:
            watched, self._watch = _watching_once(traced)
        leaves = [jax.ShapeDtypeStruct(leaf.shape, leaf.dtype) for leaf in self._leaves]
        if not watched:
            jax.eval_shape(self._watch, np.array([t]), y[None], leaves)
        self.names, self._angles = watched[0].names, watched[0].angles
        if self.names and not self._steers:
            self.choices = self.at(t, y)

    @in_float64
    def at(self, t: float, y: np.ndarray) -> list[np.ndarray]:
        """The choices at another time and state."""
        if self._steers:
            # Step by step, since branches and loops follow numbers.
            watched = _Watch(())
            _follow(self._traced, watched, jnp.asarray(t, dtype=float), y, self._leaves)
            return [np.asarray(each) for each in watched.choices]
        return [each[0] for each in next(self._choices_at([t], y[None]))]

    @in_float64
    def breaks(self, ts: Sequence[float], states: np.ndarray) -> list[tuple[int, str]]:
        """The states at which a choice differs, and the first primitive that makes it.

        Arguments:
            ts: times.
            states: ``(times, *state)``.
        """
        found: list[tuple[int, str]] = []
        if not self.names:
            return found
        for block, choices in enumerate(self._choices_at(ts, states)):
            # Behind a branch that is not the one followed, nothing means anything.
            other = np.stack(
                [
                    np.any(differ(now, choice, angles).reshape(len(now), -1), axis=1)
                    for now, choice, angles in zip(choices, self.choices, self._angles, strict=True)
                ]
            )
            for at in np.flatnonzero(np.any(other, axis=0)):
                found.append((block * _BLOCK + int(at), self.names[int(np.argmax(other[:, at]))]))
        return found

    def _choices_at(self, ts: Sequence[float], states: np.ndarray) -> Iterator[list[np.ndarray]]:
        for first in range(0, len(ts), _BLOCK):
            t = np.asarray(ts[first : first + _BLOCK], dtype=np.float64)
            y = states[first : first + _BLOCK]
            # The last state fills the block up, so that all blocks are equally long.
            rows = np.minimum(np.arange(_BLOCK), len(t) - 1)
            yield [
                np.asarray(each)[: len(t)] for each in self._watch(t[rows], y[rows], self._leaves)
            ]


class _Watch:
    """Arrays of JAX, and the choices that primitives make on the way.

    Arguments:
        before: the choices made elsewhere, which branches and loops follow; none to make them.
    """

    def __init__(self, before: Sequence[np.ndarray]) -> None:
        self.before = before
        self.names: list[str] = []
        self.choices: list[Any] = []
        self.angles: list[bool] = []

    def constant(self, array: Any) -> Any:
        return jnp.asarray(array)

    def apply(self, equation: Any, inputs: Sequence[Value]) -> list[Any]:
        contents = [value.content for value in inputs]
        results = bind(equation, contents)
        for i in looked_at(equation, inputs):
            if jnp.issubdtype(contents[i].dtype, jax.dtypes.extended):
                refuse(equation.primitive.name, " on keys that depend on the state or the time")
            self._keep(inputs[i].origin or equation.primitive.name, contents[i])
        if chooses(equation, inputs):
            choice = chosen(equation, contents, results)
            self._keep(equation.primitive.name, choice, turns(equation))
        return results

    def decide(self, value: Value) -> np.ndarray:
        before = self.before[len(self.choices)] if self.before else value.content
        self._keep(value.origin or "cond", value.content)
        return np.asarray(before)

    def stacked(self, rows: Sequence[Any], variable: Any) -> Any:
        if not rows:
            return jnp.zeros(variable.aval.shape, variable.aval.dtype)
        return jnp.stack(rows)

    def _keep(self, name: str, choice: Any, angles: bool = False) -> None:
        self.names.append(name)
        self.choices.append(choice)
        self.angles.append(angles)


def _follow(traced: Any, watched: _Watch, t: Any, y: Any, leaves: Sequence[Any]) -> None:
    args = [Value(leaf, False) for leaf in leaves]
    walk(traced, [Value(t, True), Value(jnp.asarray(y), True), *args], watched)


def _watching(traced: Any, before: Sequence[np.ndarray]) -> tuple[list[_Watch], Any]:
    """A compiled function of times, states and args that returns the choices.

    Returns:
        A list that holds what was watched once the function has been traced, and the function.
    """
    seen: list[_Watch] = []

    def watch(t: Any, y: Any, leaves: Sequence[Any]) -> list[Any]:
        watched = _Watch(before)
        _follow(traced, watched, t, y, leaves)
        seen.append(watched)
        return watched.choices

    return seen, jax.jit(jax.vmap(watch, in_axes=(0, 0, None)))


@functools.lru_cache(maxsize=64)
def _watching_once(traced: Any) -> tuple[list[_Watch], Any]:
    """The same, once for each jaxpr."""
    return _watching(traced, ())


@functools.lru_cache(maxsize=64)
def _traced(rhs: Any, inputs: tuple, structure: Any) -> Any:
    t, y, *leaves = (
        jax.ShapeDtypeStruct(each.shape, each.dtype, weak_type=each.weak_type) for each in inputs
    )
    return jax.make_jaxpr(rhs)(t, y, jax.tree.unflatten(structure, leaves))


@in_float64
def traced_once(problem: Problem) -> Any:
    """The right-hand side as a jaxpr, the same object for all problems that share it."""
    leaves, structure = jax.tree.flatten(problem.args)
    inputs = tuple(jax.typeof(leaf) for leaf in (0.0, problem.y0, *leaves))
    return _traced(problem.rhs, inputs, structure)


def just_after(problem: Problem, t: float, y: np.ndarray) -> tuple[float, np.ndarray]:
    """A time shortly after another one, and the state there.

    At the start itself, what begins to move has no sign yet. One step of a Runge-Kutta method is
    accurate enough to make choices.
    """
    stops = np.array([*problem.ts, *problem.jump_times])
    dt = _AFTER * float(np.min(stops[stops > t]) - t)
    slope = compiled(problem.rhs)

    def rhs(t: float, y: Any) -> np.ndarray:
        return np.asarray(slope(t, y, problem.args))

    # Not at the start itself, which may be a jump time and then ends the piece before.
    k1 = rhs(float(np.nextafter(t, np.inf)), y)
    k2 = rhs(t + dt / 2, y + dt / 2 * k1)
    k3 = rhs(t + dt / 2, y + dt / 2 * k2)
    k4 = rhs(t + dt, y + dt * k3)
    return t + dt, y + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
