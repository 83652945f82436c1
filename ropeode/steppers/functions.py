"""Step functions of users as steppers."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Callable, Hashable
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from ropeode.errors import InputError, RopeodeError, UserCodeError
from ropeode.problems import StateStructure, positional
from ropeode.steppers.base import ProblemClass, Stepper, System
from ropeode.steppers.phase import Phase
from ropeode.validation import shortly


@dataclasses.dataclass(frozen=True)
class StepFunction(Stepper):
    """A user's function from a state to the next one, in JAX or NumPy."""

    PARAMETERS: ClassVar[tuple[str, ...]]

    function: Callable
    name: str  # type: ignore[misc]
    declared_order: int | None = None

    def order(self, problem_class: ProblemClass) -> int | None:
        """What its author claims, on every problem."""
        return self.declared_order


@dataclasses.dataclass(frozen=True)
class RhsFunction(StepFunction):
    """A function ``step(rhs, t, y, dt, args)`` that returns the new state.

    `y` is an array: for a mechanical problem ``stack([x, v])``, ``(2, nodes, dim)``. Where the
    problem's state is a pytree, `y` is that pytree, and `rhs` takes and returns such pytrees; a
    function that computes with `y` itself, as in ``y + dt * rhs(t, y, args)``, is given one array.
    """

    PARAMETERS: ClassVar[tuple[str, ...]] = ("rhs", "t", "y", "dt", "args")

    structure: StateStructure | None = None

    def on(self, structure: StateStructure | None) -> RhsFunction:
        """The stepper for problems with such a state."""
        return dataclasses.replace(self, structure=structure)

    def step(self, system: System, t: Any, carried: Any, dt: Any) -> Any:
        """One call of the function."""
        if not isinstance(carried, Phase):
            return checked_array("y", self._called(system, t, carried, dt), np.shape(carried))
        shape = carried.shape
        if isinstance(carried.x, Tracer):
            # While JAX traces it, the state is a `Phase` wherever that will do as an array: two
            # arrays apart make faster code than a stacked one.
            try:
                new = self._called(system, t, carried, dt)
            except Exception:
                new = self._called(system, t, jnp.stack(tuple(carried)), dt)
        else:
            new = self._called(system, t, np.stack(tuple(carried)), dt)
        if isinstance(new, Phase):
            x, v = (checked_array("y", each, shape[1:]) for each in new)
        else:
            x, v = checked_array("y", new, shape)
        return Phase(x, v)

    def _called(self, system: System, t: Any, y: Any, dt: Any) -> Any:
        rhs, args, structure = system.equations.rhs, system.equations.args, self.structure
        try:
            if structure is None:
                return self.function(rhs, t, y, dt, args)
            new = self._of_parts(structure, rhs, t, y, dt, args)
        except RopeodeError:
            raise
        except Exception as error:
            fix = "mend the error above"
            if structure is not None:
                comes = f"in parts, {structure.parts} in NumPy, and so does what rhs returns"
                fix += f"; Euler's step for such states is {structure.euler}"
            else:
                halves = ", y[0] the positions and y[1] the velocities" if system.mechanical else ""
                comes = f"as one NumPy array of shape {np.shape(y)}{halves}"
            if "numpy.ndarray" in str(error):
                fix += "; jnp.asarray makes an array of JAX of one of NumPy's"
            raise UserCodeError(
                f"step: it raised {shortly(error)}; allowed: code that runs where the state y "
                f"comes {comes}. Fix: {fix}."
            ) from error
        return new

    def _of_parts(
        self, structure: StateStructure, rhs: Any, t: Any, y: Any, dt: Any, args: Any
    ) -> Any:
        """One call of the function with a state in parts; in one array, if it computes with it."""

        def rhs_of_parts(t: Any, y: Any, args: Any) -> Any:
            fix = "hand over y as it comes, or what jax.tree.map makes of it"
            return structure.unravel(rhs(t, structure.ravel("y for rhs", y, fix=fix), args))

        try:
            new = self.function(rhs_of_parts, t, structure.unravel(y), dt, args)
        except TypeError as error:
            # A slice is no arithmetic: it would rest on an order of the components.
            if "unhashable" not in str(error):
                with contextlib.suppress(Exception):
                    return self.function(rhs, t, y, dt, args)
            raise
        flat = structure.ravel("step result", new, fix=f"end it as Euler's step: {structure.euler}")
        for path, part in jax.tree_util.tree_flatten_with_path(new)[0]:
            # Beside parts of float64 it would not show in `flat`.
            if getattr(part, "dtype", None) in (np.float32, np.float16):
                checked_array(f"y{jax.tree_util.keystr(path)}", part, np.shape(part))
        return flat


class AccelerationFunction(StepFunction):
    """A function ``step(acceleration, t, x, v, dt, args)`` that returns the new x and v."""

    PARAMETERS = ("acceleration", "t", "x", "v", "dt", "args")
    needs = "second order"

    def step(self, system: System, t: Any, carried: Phase, dt: Any) -> Phase:
        """One call of the function."""
        own = system.equations
        new = self.function(own.acceleration, t, carried.x, carried.v, dt, own.args)
        if isinstance(new, tuple | list) and len(new) == 2:
            shape = np.shape(carried.x)
            x, v = (checked_array(name, each, shape) for name, each in zip("xv", new, strict=True))
            return Phase(x, v)
        if isinstance(new, tuple | list):
            returned = f"{type(new).__name__} of length {len(new)}"
        else:
            returned = f"{type(new).__name__} of shape {np.shape(new)}"
        raise UserCodeError(
            f"step: it returned {returned}; allowed: the new positions and the new velocities. "
            "Fix: end it with `return x_new, v_new`."
        )


SIGNATURES: tuple[type[StepFunction], ...] = (RhsFunction, AccelerationFunction)


def signature_of(function: Callable) -> type[StepFunction] | None:
    """Which of `SIGNATURES` a function has; None if it has neither.

    Other names of parameters will do, but not the right names in another order.
    """
    parameters = positional(function) or []
    needed = [each.name for each in parameters if each.default is each.empty]
    names = tuple(each.name for each in parameters)
    for signature in SIGNATURES:
        wanted = signature.PARAMETERS
        fits = len(needed) <= len(wanted) <= len(names)
        shuffled = set(names) == set(wanted) and names != wanted
        if fits and not shuffled:
            return signature
    return None


def step_function(function: Callable, label: str) -> StepFunction:
    """A function with one of `SIGNATURES` as a stepper.

    Raises:
        InputError: its parameters are others.
    """
    signature = signature_of(function)
    if signature is None:
        names = ", ".join(each.name for each in positional(function) or [])
        raise InputError(
            f"step: its parameters are ({names}); allowed: ({', '.join(RhsFunction.PARAMETERS)}), "
            f"which returns the new y, or ({', '.join(AccelerationFunction.PARAMETERS)}), which "
            "returns the new x and v. Fix: write one of these."
        )
    # What was compiled for it is found again by its hash.
    hashable = function if isinstance(function, Hashable) else lambda *given: function(*given)
    return signature(hashable, label)


def checked_array(name: str, value: Any, shape: tuple[int, ...]) -> Any:
    """What a user's step returned for `name`, as an array.

    Raises:
        UserCodeError: it has another shape, or is neither of type float64 nor more precise.
    """
    if not hasattr(value, "dtype"):
        value = np.asarray(value)
    if value.shape != shape:
        raise UserCodeError(
            f"step: it returned {name} of shape {value.shape}; allowed: the shape of its input, "
            f"{shape}. Fix: return the new {name}, for all nodes and components."
        )
    if value.dtype == np.longdouble:
        value = value.astype(np.float64)
    if value.dtype != np.float64:
        raise UserCodeError(
            f"step: it returned {name} of type {value.dtype}; allowed: float64. Fix: compute with "
            "the arrays as they come, without converting them."
        )
    return value
