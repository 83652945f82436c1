"""Steppers as functions of JAX, for a user's own `jit`, `vmap` and `grad`."""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
from numpy.typing import ArrayLike

from ropeode.display import Displayed
from ropeode.precision import in_float64
from ropeode.problems import Problem, require_problem
from ropeode.simulation.jumps import intervals, sides
from ropeode.simulation.method import Method, method_of
from ropeode.simulation.system import on_stored_states
from ropeode.validation import bad_value, check_whole


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class JaxStepper(Displayed):
    """A stepper on a problem as functions of JAX: they can be compiled, mapped and differentiated.

    Made by `jax_stepper`. JAX must be in float64 mode:
    ``jax.config.update("jax_enable_x64", True)``. States `y` are as in ``problem.y0``, and
    `args` as in ``problem.args``; either may be traced. Steps of an own loop are
    ``carried = init(t, y, dt, args)``, then ``carried = step(t, carried, dt, args)`` for each
    ``t``, and ``state(t, carried, dt, args)`` where a state is needed. At the problem's jump times
    a step should end, and `init` begin the next one.

    A stepper that iterates until it has converged, such as rattle, can be differentiated forwards
    only (`jax.jvp`, `jax.jacfwd`), and one of diffrax backwards only (`jax.grad`, `jax.jacrev`).

    Arguments:
        problem: whose equations and sample times it has.
        method: the stepper, which JAX can compile.

    Examples:
        >>> import jax
        >>> from ropeode import Rope, jax_stepper
        >>> jax.config.update("jax_enable_x64", True)
        >>> rope = Rope(num_nodes=4).problem(frames=3)
        >>> rk4 = jax_stepper(rope, "rk4")
        >>> carried = rk4.step(0.0, rk4.init(0.0, rope.y0, 0.25, rope.args), 0.25, rope.args)
        >>> rk4.state(0.25, carried, 0.25, rope.args)[0, 1].round(3)
        Array([200.   , 199.969, 199.969, 199.969], dtype=float64)
    """

    problem: Problem
    method: Method

    def init(self, t: Any, y: Any, dt: Any, args: Any) -> Any:
        """What is carried into the first step from a state `y`, ``(*state,)``."""
        return self._functions()[0](args, t, y, dt)

    def step(self, t: Any, carried: Any, dt: Any, args: Any) -> Any:
        """What is carried after a step from `t` to ``t + dt``."""
        return self._functions()[1](args, t, carried, dt)

    def state(self, t: Any, carried: Any, dt: Any, args: Any) -> Any:
        """The state at `t`, ``(*state,)``."""
        return self._functions()[2](args, t, carried, dt)

    def states(
        self, steps_per_frame: int, y0: ArrayLike | None = None, args: Any = None
    ) -> jax.Array:
        """The states at the problem's sample times, as `simulate` computes them.

        Arguments:
            steps_per_frame: equal steps in each interval between sample times, as in `simulate`; a
                whole number that is not traced.
            y0: initial state, ``(*state,)``; by default the problem's.
            args: arguments of the right-hand side; by default the problem's.

        Returns:
            ``(times, *state)``. Those of a run that diverges are not finite.

        Raises:
            InputError: `steps_per_frame` cannot be used, or JAX is not in float64 mode.

        Examples:
            >>> import jax
            >>> from ropeode import Rope, jax_stepper
            >>> jax.config.update("jax_enable_x64", True)
            >>> rk4 = jax_stepper(Rope(num_nodes=4).problem(frames=3), "rk4")
            >>> slope = jax.grad(lambda y0: rk4.states(16, y0=y0)[-1, 0, 1, 3])(rk4.problem.y0)
            >>> slope[1, 1, 3].round(2)
            Array(2.95, dtype=float64)
        """
        steps = check_whole("steps_per_frame", steps_per_frame, at_least=1, example="64")
        init, step, state = self._functions()
        problem = self.problem
        start = jnp.asarray(problem.y0 if y0 is None else y0)
        own = problem.args if args is None else args
        times, lengths, fresh, samples = intervals(problem)
        dts = lengths / steps

        def interval(before: tuple, times: tuple) -> tuple:
            (carried, y), (t, end, dt, fresh) = before, times
            if problem.jump_times:
                begun = init(own, t, y, dt)
                carried = jax.tree.map(lambda new, old: jnp.where(fresh, new, old), begun, carried)

            def one_step(carried: Any, i: Any) -> tuple:
                return step(own, t + i * dt, carried, dt), None

            carried, _ = jax.lax.scan(one_step, carried, jnp.arange(steps))
            y = state(own, end, carried, dt)
            return (carried, y), y

        carried = init(own, times[0], start, dts[0])
        _, states = jax.lax.scan(interval, (carried, start), (times[:-1], times[1:], dts, fresh))
        return jnp.concatenate([start[None], states])[samples]

    def _functions(self) -> tuple:
        if not jax.config.jax_enable_x64:  # type: ignore[attr-defined]
            raise bad_value(
                "jax_enable_x64",
                False,
                "True where code of your own traces a stepper: in float32 no digit of an error "
                "or order would be right",
                "begin with jax.config.update('jax_enable_x64', True)",
            )
        problem = self.problem
        return on_stored_states(self.method.stepper, problem.rhs, problem.mechanics, sides(problem))


@in_float64
def jax_stepper(problem: Problem, stepper: Any) -> JaxStepper:
    """A stepper on a problem, for `jax.jit`, `jax.vmap` and `jax.grad` of your own.

    `simulate` returns NumPy arrays, which no transformation of JAX can see into; this can be
    differentiated by whatever the equations depend on: the initial state and `args`.

    Arguments:
        problem: what to solve.
        stepper: whatever `ropeode.as_stepper` takes and JAX can trace.

    Raises:
        InputError: there is no such stepper, it cannot run on the problem, or it runs in Python.
        UserCodeError: a user's step raised, or returned something that is no state.

    Examples:
        >>> import jax
        >>> from ropeode import Rope, jax_stepper
        >>> jax.config.update("jax_enable_x64", True)
        >>> rk4 = jax_stepper(Rope(num_nodes=4).problem(frames=3), "rk4")
        >>> rk4.states(16)[-1, 0, 1].round(2)
        Array([200.  , 195.55, 195.54, 195.54], dtype=float64)
    """
    require_problem(problem)
    problem.require_equations()
    method = method_of(stepper, problem)
    if not method.trial.compiled:
        raise bad_value(
            "stepper",
            method.stepper.label,
            "a stepper that JAX can trace; this one runs in Python",
            "write it with jax.numpy, and no Python `if` on values",
        )
    return JaxStepper(problem, method)
