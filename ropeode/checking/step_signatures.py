"""The forms in which a stepper may be brought, seen as `init`, `step` and `state`."""

from __future__ import annotations

import abc
import dataclasses
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np

from ropeode.errors import UserCodeError
from ropeode.problems.problem import Mechanics, Problem
from ropeode.simulation import system
from ropeode.steppers.base import Stepper
from ropeode.steppers.phase import Phase


class Equations(NamedTuple):
    """A problem's functions, in JAX or in NumPy.

    Fields:
        rhs: ``rhs(t, y, args)``.
        acceleration: ``acceleration(t, x, v, args)``; None where the problem is not mechanical.
        mechanics: with that acceleration; None likewise.
    """

    rhs: Callable
    acceleration: Callable | None
    mechanics: Mechanics | None

    @classmethod
    def of(cls, problem: Problem) -> Equations:
        """Those of a problem, in JAX."""
        mechanics = problem.mechanics
        return cls(problem.rhs, mechanics.acceleration if mechanics else None, mechanics)


class Form(abc.ABC):
    """How a stepper is called. What it carries from step to step is its own affair.

    All states are ``stack([x, v])`` where the problem is mechanical.

    Class attributes:
        in_python_only: JAX cannot trace it, and need not try.
        in_jax_only: it takes JAX's arrays and functions, and never NumPy's.
        takes_damping: it can be told of forces that depend on velocities.
        equal_frames: it needs one step size for the whole run.
    """

    in_python_only: ClassVar[bool] = False
    in_jax_only: ClassVar[bool] = False
    takes_damping: ClassVar[bool] = True
    equal_frames: bool = False

    @property
    def documented_order(self) -> int | None:
        """The order that it is said to have where it comes from; None where nothing is said."""
        return None

    @abc.abstractmethod
    def step(self, equations: Equations, args: Any, t: Any, carried: Any, dt: Any) -> Any:
        """What is carried at ``t + dt``, from what is carried at `t`."""

    def init(self, equations: Equations, args: Any, t: Any, y: Any, dt: Any) -> Any:
        """What is carried into the first step."""
        del equations, args, t, dt
        return y

    def state(self, equations: Equations, args: Any, t: Any, carried: Any, dt: Any) -> Any:
        """The state at time `t`."""
        del equations, args, t, dt
        return carried


@dataclasses.dataclass(frozen=True)
class RhsForm(Form):
    """A function ``step(rhs, t, y, dt, args)`` that returns the new state."""

    function: Callable

    def step(self, equations: Equations, args: Any, t: Any, carried: Any, dt: Any) -> Any:
        """One step."""
        new = self.function(equations.rhs, t, carried, dt, args)
        return checked_array("y", new, np.shape(carried))


@dataclasses.dataclass(frozen=True)
class AccelerationForm(Form):
    """A function ``step(acceleration, t, x, v, dt, args)`` that returns the new x and v."""

    function: Callable

    def init(self, equations: Equations, args: Any, t: Any, y: Any, dt: Any) -> Any:
        """Positions and velocities apart."""
        del equations, args, t, dt
        return y[0], y[1]

    def step(self, equations: Equations, args: Any, t: Any, carried: Any, dt: Any) -> Any:
        """One step."""
        x, v = carried
        new = self.function(equations.acceleration, t, x, v, dt, args)
        if isinstance(new, tuple | list) and len(new) == 2:
            return tuple(
                checked_array(name, each, np.shape(x)) for name, each in zip("xv", new, strict=True)
            )
        if isinstance(new, tuple | list):
            given = f"{type(new).__name__} of length {len(new)}"
        else:
            given = f"{type(new).__name__} of shape {np.shape(new)}"
        raise UserCodeError(
            f"step: it returned {given}; allowed: the new positions and the new velocities. "
            "Fix: end it with `return x_new, v_new`."
        )

    def state(self, equations: Equations, args: Any, t: Any, carried: Any, dt: Any) -> Any:
        """Positions and velocities as one state."""
        del equations, args, t, dt
        # NumPy's own, where it will do: `jnp.stack` of NumPy arrays costs a hundred times as much.
        plain = all(isinstance(each, np.ndarray) for each in carried)
        return (np if plain else jnp).stack(carried)


@dataclasses.dataclass(frozen=True)
class StepperForm(Form):
    """A `Stepper`, ropeode's own or a user's."""

    stepper: Stepper

    def init(self, equations: Equations, args: Any, t: Any, y: Any, dt: Any) -> Any:
        """As the stepper does."""
        start = y if equations.mechanics is None else Phase(y[0], y[1])
        return self.stepper.init(_bound(equations, args), t, start, dt)

    def step(self, equations: Equations, args: Any, t: Any, carried: Any, dt: Any) -> Any:
        """As the stepper does."""
        return self.stepper.step(_bound(equations, args), t, carried, dt)

    def state(self, equations: Equations, args: Any, t: Any, carried: Any, dt: Any) -> Any:
        """As the stepper does."""
        y = self.stepper.state(_bound(equations, args), t, carried, dt)
        if not isinstance(y, tuple):
            return y
        plain = all(isinstance(each, np.ndarray) for each in y)
        return (np if plain else jnp).stack(tuple(y))


def _bound(equations: Equations, args: Any) -> Any:
    return system(equations.rhs, equations.mechanics, args)


def checked_array(name: str, value: Any, shape: tuple[int, ...]) -> Any:
    """An array that a user's step returned.

    Arguments:
        name: of what it is.
        value: what was returned.
        shape: that it must have.

    Raises:
        UserCodeError: it has another shape, or is not of type float64.
    """
    if not hasattr(value, "dtype"):
        value = np.asarray(value)
    if value.shape != shape:
        raise UserCodeError(
            f"step: it returned {name} of shape {value.shape}; allowed: that of what it was given, "
            f"{shape}. Fix: return the new {name}, for all nodes and components."
        )
    if value.dtype != np.float64:
        raise UserCodeError(
            f"step: it returned {name} of type {value.dtype}; allowed: float64. Fix: compute with "
            f"the arrays as they are given, without converting them."
        )
    return value
