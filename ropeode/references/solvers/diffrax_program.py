"""A run of diffrax as a function that JAX can trace.

Not imported where the program comes from a file: importing diffrax and tracing it take longer
than all runs of a reference.
"""

# Equinox modules declare fields that a wrapper gives as properties; pyright cannot see that.
# pyright: reportAssignmentType=false, reportCallIssue=false
from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import diffrax
import jax
import jax.numpy as jnp
import optimistix

from ropeode.references.solvers.family import Family
from ropeode.references.solvers.solver import DOPRI8, KVAERNO5, Solver

_ROOT_RTOL = 1e-9
# In units in the last place of t: the least length of the first step, and of what the controller
# asks for later. It asks for ten times a step that a sample time has cut to one unit. Rounding
# leaves a step of five units as it is when nine tenths of it are tried.
_FIRST_STEP, _SHORTEST_STEP = 10.0, 8.0


def _kvaerno5(rtol: Any, atol: Any) -> diffrax.AbstractSolver:
    """Kvaerno5 with Newton's method, and a new Jacobian in each iteration.

    Its own root finder keeps one Jacobian for a whole step, and rejects step after step where a
    solution enters a boundary layer: Van der Pol's equation with epsilon = 1e-6 took 4810 steps
    instead of 290, or did not start at all. Newton's method squares its error, so that rounding
    never lets it meet a tolerance below `_ROOT_RTOL`; the steps would shrink to nothing.
    """
    root_rtol: Any = jnp.maximum(rtol, _ROOT_RTOL)
    newton = optimistix.Newton(rtol=root_rtol, atol=root_rtol / rtol * atol)
    return diffrax.Kvaerno5(root_finder=newton)


SOLVERS: dict[Solver, Callable[[Any, Any], diffrax.AbstractSolver]] = {
    DOPRI8: lambda rtol, atol: diffrax.Dopri8(),
    KVAERNO5: _kvaerno5,
}


class _Wrapper(diffrax.AbstractAdaptiveStepSizeController):
    """A controller that lets another one choose, and changes its choice."""

    controller: diffrax.AbstractAdaptiveStepSizeController

    rtol = property(lambda self: self.controller.rtol)
    atol = property(lambda self: self.controller.atol)
    norm = property(lambda self: self.controller.norm)

    def wrap(self, direction: Any) -> _Wrapper:
        """Pass the direction of time on."""
        return dataclasses.replace(self, controller=self.controller.wrap(direction))


class _StepLimit(_Wrapper):
    """A controller that gives up after a number of steps that is an input of the program.

    `diffeqsolve(max_steps=...)` is a constant of the program, and would cost a compilation for
    each rung of a tolerance ladder.
    """

    limit: Any

    def init(self, *inputs: Any) -> tuple:
        """Start the count beside the inner controller's state."""
        t1, inner = self.controller.init(*inputs)
        return t1, (jnp.asarray(0), inner)

    def adapt_step_size(self, *inputs: Any) -> tuple:
        """Let the inner controller choose, and count."""
        *inputs, (count, inner) = inputs
        *choice, inner, result = self.controller.adapt_step_size(*inputs, inner)
        count = count + 1
        spent = (count >= self.limit) & diffrax.is_okay(result)
        result = diffrax.RESULTS.where(spent, diffrax.RESULTS.max_steps_reached, result)
        return *choice, (count, inner), result


class _Frames(_Wrapper):
    """A controller whose steps end on the sample times, and are no longer than their frame allows.

    `ClipStepSizeController(step_ts=...)` compares each step with all sample times, which takes
    much longer than the step itself where they are thousands. `PIDController(dtmax=...)` knows
    one length for all frames, and `dtmin` one for all times: here a run ends where the inner
    controller asks for a step that hardly changes `t` in floating-point numbers.
    """

    ts: Any
    longest: Any

    def init(self, *inputs: Any) -> tuple:
        """Shorten the first step, and count the frames from there."""
        t0 = inputs[1]
        t1, inner = self.controller.init(*inputs)
        t1 = jnp.maximum(t1, t0 + _FIRST_STEP * _spacing(t0))
        return self._shortened(t0, t1, 0), (jnp.asarray(0), inner)

    def adapt_step_size(self, *inputs: Any) -> tuple:
        """Let the inner controller choose, and shorten the step."""
        *inputs, (frame, inner) = inputs
        keep, t0, t1, made_jump, inner, result = self.controller.adapt_step_size(*inputs, inner)
        # Also where it is NaN.
        too_short = ~(t1 - t0 >= _SHORTEST_STEP * _spacing(t0)) & diffrax.is_okay(result)
        result = diffrax.RESULTS.where(too_short, diffrax.RESULTS.dt_min_reached, result)
        # No step passes a sample time. One that ends at a jump there ends just before it.
        frame = frame + (self.ts[frame + 1] <= jnp.nextafter(t0, jnp.inf))
        return keep, t0, self._shortened(t0, t1, frame), made_jump, (frame, inner), result

    def _shortened(self, t0: Any, t1: Any, frame: Any) -> Any:
        longest = jnp.maximum(t0 + self.longest[frame], jnp.nextafter(t0, jnp.inf))
        return jnp.minimum(jnp.minimum(t1, longest), self.ts[frame + 1])


def _spacing(t: Any) -> Any:
    """The distance of a time from the next floating-point number."""
    return jnp.nextafter(t, jnp.inf) - t


def solution_of(family: Family) -> Callable:
    """The function that solves a problem of a family.

    Steps are clipped onto the sample times, because the dense output of Dopri8 is of order 5
    only, and end just before declared jump times.

    Arguments:
        family: the problem's functions and shapes, and the solver.

    Returns:
        A function of the initial state, the problem's numbers, the sample times, the jump
        times, the tolerances, the most steps, and the longest steps. It returns a number for
        `failure`, the steps, the states at the sample times, flat, and the time reached.
    """

    def run(
        y0: Any, leaves: Any, ts: Any, jump_ts: Any, rtol: Any, atol: Any, limit: Any, longest: Any
    ) -> Any:
        controller = _Frames(diffrax.PIDController(rtol=rtol, atol=atol), ts, longest)
        if family.jumps:
            controller = diffrax.ClipStepSizeController(controller, jump_ts=jump_ts)
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(family.field),
            SOLVERS[family.solver](rtol, atol),
            ts[0],
            ts[-1],
            None,
            y0,
            leaves,
            saveat=diffrax.SaveAt(
                subs=(
                    diffrax.SubSaveAt(ts=ts),
                    diffrax.SubSaveAt(t1=True, fn=lambda t, y, leaves: t),
                )
            ),
            stepsize_controller=_StepLimit(controller, limit),
            max_steps=None,
            adjoint=diffrax.ForwardMode(),
            throw=False,
        )
        (result,) = jax.tree.leaves(solution.result)
        ys: Any = solution.ys
        states, (reached,) = ys
        return result, solution.stats["num_steps"], states, reached

    return run


def failure(result: Any) -> str:
    """Why a run ended early, though it had steps left, without naming diffrax's own arguments.

    Arguments:
        result: the number that the run returned.
    """
    reason = jax.tree.unflatten(jax.tree.structure(diffrax.RESULTS.successful), [result])
    if reason == diffrax.RESULTS.dt_min_reached:
        return "the step size has become too small"
    if diffrax.is_successful(reason):
        return "the state is not finite"
    return str(diffrax.RESULTS[reason]).strip().split(". ")[0]
