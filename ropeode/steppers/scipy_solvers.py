"""SciPy's `OdeSolver` classes as steppers of constant step."""

from __future__ import annotations

import dataclasses
import functools
import inspect
from collections.abc import Callable
from typing import Any

import jax
import numpy as np
from jax.tree_util import Partial
from scipy import integrate

from ropeode.steppers.base import ProblemClass, Stepper, System
from ropeode.steppers.phase import Phase
from ropeode.validation import bad_value

# What exports solvers, and what these derive from.
LIBRARY, SOLVER = integrate, integrate.OdeSolver
# Why a solver cannot be graded.
REFUSED = {
    integrate.BDF: "it chooses among orders 1 to 5, and a step rests on those before it",
    integrate.LSODA: "it chooses among methods and orders, and a step rests on those before it",
}
# The orders in SciPy's documentation.
_ORDERS: dict[Callable, int] = {
    integrate.RK23: 3,
    integrate.RK45: 5,
    integrate.DOP853: 8,
    integrate.Radau: 5,
}
# How closely Radau solves its equations, in units of the state. Rounding hides what is left, and
# the six iterations that it allows itself still get there.
_NEWTON = 1e-14
# A tolerance that lets any error pass, of the largest component.
_LOOSE = 1e6


@dataclasses.dataclass(frozen=True)
class ScipyStepper(Stepper):
    """A solver class, of which each step makes a new solver that takes one step.

    The first step is as long as the largest one and all there is to go, and any error is
    tolerated. The solver's time is that since the step began, so that all steps of a frame are
    equally long to the last bit.
    """

    family = "SciPy"
    compiled = False
    method: Callable[..., integrate.OdeSolver]

    @property
    def label(self) -> str:
        """As on the command line."""
        return f"scipy:{getattr(self.method, '__name__', 'solver')}"

    def order(self, problem_class: ProblemClass) -> int | None:
        """As in SciPy's documentation; None for classes from elsewhere."""
        return _ORDERS.get(self.method)

    def step(self, system: System, t: Any, carried: Any, dt: Any) -> Any:
        """One step; not-a-number where the solver would have taken a shorter one."""
        y = np.stack(tuple(carried)) if isinstance(carried, Phase) else carried
        if not np.all(np.isfinite(y)):
            return carried
        rhs, args = system.equations.rhs, system.equations.args

        def field(since: float, flat: np.ndarray) -> np.ndarray:
            return rhs(t + since, flat.reshape(y.shape), args).reshape(-1)

        solver = self.solver(system, t, field, y, dt)
        solver.step()
        taken = solver.status == "finished" and solver.step_size == dt
        new = solver.y.reshape(y.shape) if taken else np.full_like(y, np.nan)
        return Phase(new[0], new[1]) if isinstance(carried, Phase) else new

    def solver(
        self, system: System, t: float, field: Callable, y: np.ndarray, dt: float, **options: Any
    ) -> integrate.OdeSolver:
        """A solver that is about to take one step of length `dt`."""
        tolerances = {"rtol": 1e-3, "atol": np.inf, **options}
        return self.method(field, 0.0, y.reshape(-1), dt, first_step=dt, max_step=dt, **tolerances)


class RadauStepper(ScipyStepper):
    """Radau, whose Newton iteration converges in a norm that is made of the tolerances.

    With the tolerances that let any error pass it would end at once. So they are finite, and
    the limit of the iteration is set on the solver. The Jacobian is exact: differences across a
    spring without length have no limit.
    """

    def solver(
        self, system: System, t: float, field: Callable, y: np.ndarray, dt: float, **options: Any
    ) -> integrate.OdeSolver:
        """As in `ScipyStepper`, with a limit of its own for the iteration."""
        rhs, args = system.equations.rhs, system.equations.args
        in_jax = getattr(rhs, "in_jax", None) or Partial(rhs)
        loose = _LOOSE * max(1.0, float(np.max(np.abs(y))))
        options["jac"] = lambda since, flat: np.asarray(
            _jacobian(in_jax, t + since, flat, args, y.shape)
        )
        solver = super().solver(system, t, field, y, dt, atol=loose, **options)
        assert isinstance(solver, integrate.Radau)
        solver.newton_tol = _NEWTON / loose
        return solver


@functools.partial(jax.jit, static_argnames="shape")
def _jacobian(rhs: Partial, t: Any, flat: Any, args: Any, shape: tuple[int, ...]) -> Any:
    """That of a right-hand side in JAX, on flat states."""

    def field(y: Any) -> Any:
        return rhs(t, y.reshape(shape), args).reshape(-1)

    return jax.jacfwd(field)(flat)


def by_object(given: Any) -> ScipyStepper | None:
    """An `OdeSolver` class as a stepper; None if it is none.

    Raises:
        InputError: it cannot take constant steps, or is a solver object, which has its problem
            already.
    """
    if isinstance(given, integrate.OdeSolver):
        name = type(given).__name__
        raise bad_value(
            "solver of scipy",
            f"{name} object",
            "classes; an object has its problem already",
            f"give the class, scipy.integrate.{name}",
        )
    if not (inspect.isclass(given) and issubclass(given, integrate.OdeSolver)):
        return None
    for refused, why in REFUSED.items():
        if issubclass(given, refused):
            raise bad_value(
                "solver of scipy",
                given.__name__,
                f"one-step methods of one order; {why}",
                "take another, such as scipy:RK45",
            )
    return (RadauStepper if issubclass(given, integrate.Radau) else ScipyStepper)(given)
