"""diffrax's solvers as steppers: `AbstractSolver.init` and `step`, with steps of one size."""

from __future__ import annotations

import dataclasses
import functools
import inspect
from typing import Any

import diffrax
import jax
import jax.numpy as jnp
import optimistix

from ropeode.equality import ByContent
from ropeode.errors import InputError
from ropeode.steppers.base import ProblemClass, Stepper, System
from ropeode.steppers.phase import Phase
from ropeode.validation import bad_value

# What exports solvers, and what these derive from.
LIBRARY, SOLVER = diffrax, diffrax.AbstractSolver
# The root finder of implicit solvers that were given none with a tolerance: their own takes it
# from an adaptive controller, which there is none of here, and VeryChord of diffrax 0.7.2 gives
# up on every step that its second iteration does not settle (patrick-kidger/diffrax#754).
# Newton's method squares its error, so that what is left of the equations at this tolerance is
# rounding.
_NEWTON = optimistix.Newton(rtol=1e-9, atol=1e-9)
_UNSET = diffrax.Kvaerno3().root_finder.rtol


@dataclasses.dataclass(frozen=True, eq=False)
class DiffraxStepper(ByContent, Stepper):
    """A solver that takes the whole right-hand side as one term."""

    family = "diffrax"
    compiled = True
    solver: diffrax.AbstractSolver

    def _contents(self) -> Any:
        """The solver with its options."""
        return jax.tree.flatten(self.solver)

    @property
    def label(self) -> str:
        """As on the command line."""
        return f"diffrax:{type(self.solver).__name__}"

    def order(self, problem_class: ProblemClass) -> int | None:
        """What the solver says of itself, for ordinary differential equations."""
        return self.solver.order(diffrax.ODETerm(lambda t, y, args: y))

    def init(self, system: System, t: Any, y: Any, dt: Any) -> Any:
        """The state as the solver wants it, and what the solver carries itself."""
        y = self.split(y)
        own = self.solver.init(self.terms(system), t, t + dt, y, system.equations.args)
        return y, own, jnp.asarray(True)

    def step(self, system: System, t: Any, carried: Any, dt: Any) -> Any:
        """One step; not-a-number where an implicit equation was not solved."""
        old, own, solved = carried
        y, _, _, own, result = self.solver.step(
            self.terms(system), t, t + dt, old, system.equations.args, own, made_jump=False
        )
        now = result == diffrax.RESULTS.successful
        finite = jnp.all(jnp.stack([jnp.all(jnp.isfinite(leaf)) for leaf in jax.tree.leaves(old)]))
        y = jax.tree.map(lambda leaf: jnp.where(now, leaf, jnp.nan), y)
        return y, own, solved & (now | ~finite)

    def state(self, system: System, t: Any, carried: Any, dt: Any) -> Any:
        """The state alone."""
        y = carried[0]
        return Phase(y[0], y[1]) if system.mechanical else y

    def solved(self, carried: Any) -> Any:
        """Whether diffrax has always reported success."""
        return carried[2]

    def terms(self, system: System) -> Any:
        """The equations as this solver wants them."""
        return diffrax.ODETerm(system.equations.rhs)

    def split(self, y: Any) -> Any:
        """The state as this solver wants it: one array."""
        return jnp.stack(tuple(y)) if isinstance(y, Phase) else y


class ExplicitImplicitStepper(DiffraxStepper):
    """A solver that takes a slow term explicitly and a fast one implicitly (IMEX).

    The force at rest at time 0 is implicit, along with ``x' = v``: springs and gravity. What
    velocity and time change of it is explicit: damping and drive.
    """

    needs = "second order"

    def terms(self, system: System) -> Any:
        """Both terms, in the order of the solver's tableaus."""
        acceleration = system.equations.acceleration

        def springs(t: Any, y: Any, args: Any) -> Any:
            return acceleration(jnp.zeros_like(t), y[0], jnp.zeros_like(y[1]), args)

        def implicit(t: Any, y: Any, args: Any) -> Any:
            return jnp.stack([y[1], springs(t, y, args)])

        def explicit(t: Any, y: Any, args: Any) -> Any:
            forces = acceleration(t, y[0], y[1], args)
            return jnp.stack([jnp.zeros_like(y[1]), forces - springs(t, y, args)])

        return diffrax.MultiTerm(
            *(
                diffrax.ODETerm(implicit if tableau.implicit else explicit)
                for tableau in _tableaus(self.solver)
            )
        )


class PositionVelocityStepper(DiffraxStepper):
    """A solver that takes ``x' = f(t, v)`` and ``v' = g(t, x)`` as two terms."""

    needs = "second order, no damping"

    def terms(self, system: System) -> Any:
        """Both terms."""

        def velocity(t: Any, v: Any, args: Any) -> Any:
            del t, args
            return v

        def force(t: Any, x: Any, args: Any) -> Any:
            return system.equations.acceleration(t, x, jnp.zeros_like(x), args)

        return diffrax.ODETerm(velocity), diffrax.ODETerm(force)

    def split(self, y: Any) -> Any:
        """Positions and velocities."""
        return tuple(y)


def by_object(given: Any) -> DiffraxStepper | None:
    """A solver object, or a class that is made without arguments; None if it is neither.

    Raises:
        InputError: it is a solver that is not for ordinary differential equations, or a
            class that needs arguments.
    """
    if inspect.isclass(given) and issubclass(given, diffrax.AbstractSolver):
        return _of_class(given)
    if not isinstance(given, diffrax.AbstractSolver):
        return None
    return _stepper_class(given)(_with_root_finder(given))


@functools.cache
def _of_class(solver: type[diffrax.AbstractSolver]) -> DiffraxStepper | None:
    """One and the same stepper each time, so that its compiled programs are reused."""
    try:
        made = solver()
    except TypeError:
        raise InputError(
            f"diffrax:{solver.__name__}: it cannot be made without arguments; allowed: solvers "
            f"that can. Fix: make it in Python, as in "
            f"check_stepper(diffrax.{solver.__name__}(...))."
        ) from None
    return by_object(made)


def _stepper_class(solver: diffrax.AbstractSolver) -> type[DiffraxStepper]:
    structure = solver.term_structure
    tableaus = _tableaus(solver)
    if len(tableaus) == 2 and sum(bool(tableau.implicit) for tableau in tableaus) == 1:
        return ExplicitImplicitStepper
    if structure is diffrax.AbstractTerm or structure is diffrax.ODETerm:
        return DiffraxStepper
    if structure == (diffrax.AbstractTerm, diffrax.AbstractTerm):
        return PositionVelocityStepper
    name = type(solver).__name__
    raise bad_value(
        "solver of diffrax",
        name,
        "solvers of ordinary differential equations; this one wants a noise term, or others "
        "that a rope has not",
        "take another, such as diffrax:Heun",
    )


def _tableaus(solver: Any) -> tuple[Any, ...]:
    """Those of a solver that has several."""
    if isinstance(solver, diffrax.AbstractWrappedSolver):
        return _tableaus(solver.solver)
    tableau = getattr(solver, "tableau", None)
    return tableau.tableaus if isinstance(tableau, diffrax.MultiButcherTableau) else ()


def _with_root_finder(solver: Any) -> Any:
    """Give an implicit solver a root finder that needs no adaptive controller."""
    if isinstance(solver, diffrax.AbstractWrappedSolver):
        return dataclasses.replace(solver, solver=_with_root_finder(solver.solver))
    if not isinstance(solver, diffrax.AbstractImplicitSolver):
        return solver
    finder = solver.root_finder
    unset = finder.rtol is _UNSET or finder.atol is _UNSET
    return dataclasses.replace(solver, root_finder=_NEWTON) if unset else solver
