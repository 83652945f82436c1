"""A step that is watched: when and where it asks for a slope, and what it makes of the answers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from ropeode import callbacks
from ropeode.errors import RopeodeError, call_user_code
from ropeode.problems import PythonRhs
from ropeode.problems.links import LinearDamping
from ropeode.simulation import on_user_clock, one_at_a_time
from ropeode.steppers import Equations, Phase, Stepper, System

# A step that asks for more slopes than these hangs.
MOST_CALLS = 10_000

# How closely it must keep what the problem holds.
_ROUNDING = 1e-14

# Gives the slope at a call: of its number, counted from 0, time, and state ``(halves, numbers)``.
Slope = Callable[[int, float, np.ndarray], np.ndarray]


class TooManyCalls(RopeodeError):
    """A step asked for more slopes than it was to."""


class NotReadable(Exception):
    """A step is no method of the kind that is tried; says why, after "it"."""


class Kind(NamedTuple):
    """What a step may be a method for.

    Fields:
        start: a state as the stepper sees it, ``(2, nodes, dim)`` for a mechanical one.
        free: which positions can move, ``(nodes, dim)``; of another state, which numbers can.
        args: what its functions are handed last.
        mechanical: whether it sees positions and velocities.
        second_order: whether positions and velocities may have their own coefficients.
    """

    start: np.ndarray
    free: np.ndarray
    args: Any
    mechanical: bool
    second_order: bool


class Recording(NamedTuple):
    """What a run of a few steps asked for, and its result.

    Fields:
        times: of the calls, ``(calls,)``.
        states: of the calls, ``(calls, halves, numbers)``.
        result: the state at the end, ``(halves, numbers)``.
    """

    times: np.ndarray
    states: np.ndarray
    result: np.ndarray


class RecordedStep:
    """A stepper on an equation whose right-hand side is written as it runs.

    Its states are ``(halves, numbers)``: those numbers that the problem lets move. Positions and
    velocities are two halves, any other state is one.

    Arguments:
        stepper: whose steps are watched.
        kind: of its state.
        in_jax: whether JAX compiles the step, which then calls back for each slope; else it runs
            in Python, where parts of it are compiled only if it never is as a whole.
    """

    def __init__(self, stepper: Stepper, kind: Kind, in_jax: bool):
        mechanical = self._mechanical = kind.mechanical
        self.shape = (2 if mechanical else 1, int(np.sum(kind.free)))
        self._in_jax = in_jax
        self._free = np.broadcast_to(kind.free, kind.start.shape)
        self._held = np.where(self._free, 0.0, kind.start)
        self._slope: Slope = lambda i, t, y: np.zeros_like(y)
        self._most_calls = 0
        self._times: list[float] = []
        self._states: list[np.ndarray] = []
        written = PythonRhs(self._called)

        def slope(t: Any, y: Any, args: Any) -> Any:
            if in_jax:
                return written(t, y, args)
            if isinstance(y, Tracer) and stepper.compiled is not False:
                raise TypeError("JAX compiles a part of the step")
            return written.in_numpy(t, y, args)

        def rhs(t: Any, y: Any, args: Any) -> Any:
            if not isinstance(y, Phase):
                return slope(t, y, ())
            value = slope(t, _stacked(y.x, y.v), ())
            return Phase(value[0], value[1])

        def acceleration(t: Any, x: Any, v: Any, args: Any) -> Any:
            return slope(t, _stacked(x, v), ())[1]

        system = System(
            Equations(rhs, acceleration, kind.args),
            mechanical,
            # Steppers that treat damping on their own have none to treat.
            damping=LinearDamping(0.0, 0.0) if mechanical else None,
        )
        functions = (
            lambda t, y, dt: stepper.init(system, t, Phase(*y) if mechanical else y, dt),
            lambda t, carried, dt: stepper.step(system, t, carried, dt),
            lambda t, carried, dt: stepper.state(system, t, carried, dt),
        )
        self._init, self._step, self._state = map(jax.jit, functions) if in_jax else functions

    def _called(self, t: float, y: np.ndarray) -> np.ndarray:
        count = len(self._times)
        if count >= self._most_calls:
            raise TooManyCalls(f"it asked for more than {self._most_calls} slopes")
        self._times.append(t)
        self._states.append(self._moving(y))
        return self._whole(self._slope(count, t, self._states[-1]), np.zeros_like(y))

    def _moving(self, y: np.ndarray) -> np.ndarray:
        """The numbers that move."""
        return y[self._free].reshape(self.shape)

    def _whole(self, moving: np.ndarray, y: np.ndarray) -> np.ndarray:
        """A state or slope whose other numbers are those of `y`."""
        whole = y.copy()
        whole[self._free] = moving.reshape(-1)
        return whole

    def run(
        self,
        slope: Slope,
        t: float,
        y: np.ndarray,
        dt: float,
        *,
        steps: int = 1,
        most_calls: int = MOST_CALLS,
    ) -> Recording:
        """Take a few steps.

        Arguments:
            slope: gives the slope at each call.
            t: time at the start.
            y: state at the start, ``(halves, numbers)``.
            dt: step size.
            steps: how many.
            most_calls: how many slopes it may ask for.

        Raises:
            NotReadable: it moves what the problem holds.
            TooManyCalls: it asked for too many slopes.
            UserCodeError: the step raised.
        """
        self._slope, self._times, self._states = slope, [], []
        self._most_calls = most_calls

        def steps_taken() -> Any:
            carried = self._init(t, self._whole(y, self._held), dt)
            for i in range(steps):
                carried = self._step(t + i * dt, carried, dt)
            return self._state(t + steps * dt, carried, dt)

        with one_at_a_time(), np.errstate(all="ignore"), callbacks.raised_again():
            # What JAX compiles on the way is no time of the user's.
            watched = () if self._in_jax else (on_user_clock,)
            result = call_user_code("step", *watched, steps_taken)
            result = np.stack([np.asarray(half) for half in result]) if self._mechanical else result
            result = np.array(result, dtype=float)
        held = self._held[~self._free]
        moved = np.max(np.abs(result[~self._free] - held), initial=0.0)
        if moved > _ROUNDING * np.max(np.abs(held), initial=0.0):
            raise NotReadable("moves what the problem holds")
        states = np.array(self._states).reshape(len(self._states), *self.shape)
        return Recording(np.array(self._times), states, self._moving(result))


def _stacked(x: Any, v: Any) -> Any:
    # NumPy's own, where it will do: it is much faster.
    return (np if isinstance(x, np.ndarray) and isinstance(v, np.ndarray) else jnp).stack([x, v])
