"""A run of diffrax as a function that JAX can trace.

Not imported where the program comes from a file: importing diffrax and tracing it take longer
than all runs of a reference.
"""

# Equinox modules declare fields that a wrapper gives as properties; pyright cannot see that.
# pyright: reportAssignmentType=false, reportCallIssue=false
from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from typing import Any

import diffrax
import jax
import jax.numpy as jnp
from jax import lax

from ropeode.references.solvers import radau
from ropeode.references.solvers.family import Family
from ropeode.references.solvers.rounding import change_if_asked
from ropeode.references.solvers.solver import DOPRI8, RADAU9, Solver

# In units in the last place of t: the least length of the first step, and of what the controller
# asks for later. It asks for ten times a step that a sample time has cut to one unit. Rounding
# leaves a step of five units as it is when nine tenths of it are tried.
_FIRST_STEP, _SHORTEST_STEP = 10.0, 8.0
# A step is as much longer, in parts of itself, where it then reaches a sample.
_REST = 1e-6
# Plain loops of JAX. diffrax chooses them itself where `ForwardMode` meets a solver of its own.
_LOOPS = "lax"


class _Increment(diffrax.AbstractTerm):
    """The term of ``z = y - base - carry``; its `args` are these two and those of the term.

    Arguments:
        term: that of y.
        change: ``change(t, y, args)``, what is added to its vector field.
    """

    term: diffrax.AbstractTerm
    change: Callable

    def vf(self, t: Any, y: Any, args: Any) -> Any:
        """The vector field at ``base + (carry + z)``."""
        base, carry, args = args
        here = base + (carry + y)
        return self.term.vf(t, here, args) + self.change(t, here, args)

    def contr(self, t0: Any, t1: Any, **more: Any) -> Any:
        """The term's own control."""
        return self.term.contr(t0, t1, **more)

    def prod(self, vf: Any, control: Any) -> Any:
        """The term's own product."""
        return self.term.prod(vf, control)


class _Ends(diffrax.AbstractLocalInterpolation):
    """The states at the ends of a step. Sample times are nowhere else."""

    t0: Any
    t1: Any
    y0: Any
    y1: Any

    def evaluate(self, t0: Any, t1: Any = None, left: bool = True) -> Any:
        """The state at the end that `t0` is."""
        del t1, left
        return jnp.where(t0 > self.t0, self.y1, self.y0)


class _Compensated(diffrax.AbstractAdaptiveSolver):
    """A solver that keeps what rounding takes from the state, and adds it in the next step.

    Each step starts from zero and computes the increment of the state, which is then added by
    an exact sum of two numbers. So motion far below a unit in the last place of the state is
    not lost, however many steps it takes. See Hairer, Lubich, Wanner, Geometric Numerical
    Integration, section VIII.5.

    Arguments:
        solver: that of the steps.
        change: what is added to the vector field in each step, as for `_Increment`.
    """

    solver: diffrax.AbstractSolver
    change: Callable

    interpolation_cls = _Ends
    term_structure = property(lambda self: self.solver.term_structure)

    def order(self, terms: Any) -> Any:
        """That of the solver."""
        return self.solver.order(terms)

    def init(self, terms: Any, t0: Any, t1: Any, y0: Any, args: Any) -> tuple:
        """Start with nothing lost."""
        return jnp.zeros_like(y0), self.solver.init(terms, t0, t1, y0, args)

    def step(
        self, terms: Any, t0: Any, t1: Any, y0: Any, args: Any, solver_state: Any, made_jump: Any
    ) -> tuple:
        """One step of the solver from zero, added to the state."""
        carry, inner = solver_state
        increment, error, _, inner, result = self.solver.step(
            _Increment(terms, self.change),
            t0,
            t1,
            jnp.zeros_like(y0),
            (y0, carry, args),
            inner,
            made_jump,
        )
        y1, carry = _two_sum(y0, carry + increment)
        return y1, error, {"y0": y0, "y1": y1}, (carry, inner), result

    def func(self, terms: Any, t0: Any, y0: Any, args: Any) -> Any:
        """The vector field."""
        return self.solver.func(terms, t0, y0, args)


class _Radau(diffrax.AbstractAdaptiveSolver):
    """Radau IIA; its stages are increments, and it keeps what rounding takes as `_Compensated`.

    Arguments:
        change: as for `_Compensated`.
        scale: the absolute tolerance divided by the relative one.
    """

    change: Callable
    scale: Any

    interpolation_cls = _Ends
    term_structure = diffrax.AbstractTerm

    def order(self, terms: Any) -> int:
        """That of the local error which the estimate measures."""
        return radau.STAGES + 1

    def init(self, terms: Any, t0: Any, t1: Any, y0: Any, args: Any) -> Any:
        """Start with nothing lost."""
        return jnp.zeros_like(y0)

    def step(
        self, terms: Any, t0: Any, t1: Any, y0: Any, args: Any, solver_state: Any, made_jump: Any
    ) -> tuple:
        """One step."""
        carry = solver_state

        def field(t: Any, z: Any) -> Any:
            here = y0 + (carry + z)
            return terms.vf(t, here, args) + self.change(t, here, args)

        jacobian = jax.jacfwd(lambda y: terms.vf(t0, y, args))(y0)
        increment, error = radau.step(field, jacobian, t0, t1, self.scale + jnp.abs(y0))
        y1, lost = _two_sum(y0, carry + increment)
        return y1, error, {"y0": y0, "y1": y1}, lost, diffrax.RESULTS.successful

    def func(self, terms: Any, t0: Any, y0: Any, args: Any) -> Any:
        """The vector field."""
        return terms.vf(t0, y0, args)


def _two_sum(a: Any, b: Any) -> tuple[Any, Any]:
    """A sum, and what rounding takes from it; see Knuth, The Art of Computer Programming, 4.2.2."""
    total = a + b
    from_b = total - a
    return total, (a - (total - from_b)) + (b - from_b)


def as_its_library_has_it(name: str) -> Any:
    """A solver of diffrax by its name, whose states at the ends of steps are not interpolated."""
    original = getattr(diffrax, name)

    class OnSamples(original):
        interpolation_cls = _Ends

        def step(self, *inputs: Any) -> tuple:
            y1, error, _, state, result = super().step(*inputs)
            return y1, error, {"y0": inputs[3], "y1": y1}, state, result

    return OnSamples()


SOLVERS: dict[Solver, Callable[[Any, Any, Callable], diffrax.AbstractSolver]] = {
    DOPRI8: lambda rtol, atol, change: _Compensated(diffrax.Dopri8(scan_kind=_LOOPS), change),
    RADAU9: lambda rtol, atol, change: _Radau(change, atol / rtol),
}


class _Frames(diffrax.AbstractAdaptiveStepSizeController):
    """A controller whose steps end on the sample times, and are no longer than their frame allows.

    `ClipStepSizeController(step_ts=...)` compares each step with all sample times, which takes
    much longer than the step itself where they are thousands. `PIDController(dtmax=...)` knows
    one length for all frames, and `dtmin` one for all times: here a run ends where the inner
    controller asks for a step that hardly changes `t` in floating-point numbers. At the last
    sample time it ends by an event, as diffrax calls that. `diffeqsolve(max_steps=...)` is a
    constant of the program, and would cost a compilation for each rung of a tolerance ladder.

    Arguments:
        controller: the inner one.
        ts: the sample times.
        ends: where the last step before each of them ends: there, or just before a jump there.
        longest: the longest step for each frame.
        limit: the number of steps after which the run gives up.
    """

    controller: diffrax.AbstractAdaptiveStepSizeController
    ts: Any
    ends: Any
    longest: Any
    limit: Any

    rtol = property(lambda self: self.controller.rtol)
    atol = property(lambda self: self.controller.atol)
    norm = property(lambda self: self.controller.norm)

    def wrap(self, direction: Any) -> _Frames:
        """Pass the direction of time on."""
        return dataclasses.replace(self, controller=self.controller.wrap(direction))

    def init(self, *inputs: Any) -> tuple:
        """Shorten the first step, and count the frames and the steps from there."""
        t0 = inputs[1]
        t1, inner = self.controller.init(*inputs)
        t1 = jnp.maximum(t1, t0 + _FIRST_STEP * _spacing(t0))
        return self._shortened(t0, t1, 0), (jnp.asarray(0), jnp.asarray(0), inner)

    def adapt_step_size(self, *inputs: Any) -> tuple:
        """Let the inner controller choose, shorten the step, and count."""
        *inputs, (frame, count, inner) = inputs
        keep, t0, t1, made_jump, inner, result = self.controller.adapt_step_size(*inputs, inner)
        # Also where it is NaN.
        too_short = ~(t1 - t0 >= _SHORTEST_STEP * _spacing(t0)) & diffrax.is_successful(result)
        result = diffrax.RESULTS.where(too_short, diffrax.RESULTS.dt_min_reached, result)
        arrived = (t0 >= self.ts[-1]) & diffrax.is_okay(result)
        result = diffrax.RESULTS.where(arrived, diffrax.RESULTS.event_occurred, result)
        count = count + 1
        spent = (count >= self.limit) & diffrax.is_successful(result)
        result = diffrax.RESULTS.where(spent, diffrax.RESULTS.max_steps_reached, result)
        frame = frame + (self.ends[frame + 1] <= t0)
        state = frame, count, inner
        return keep, t0, self._shortened(t0, t1, frame), made_jump, state, result

    def _shortened(self, t0: Any, t1: Any, frame: Any) -> Any:
        longest = jnp.maximum(t0 + self.longest[frame], jnp.nextafter(t0, jnp.inf))
        t1, end = jnp.minimum(t1, longest), self.ts[frame + 1]
        # What rounding leaves before a sample would be a step of its own, too short to go on from.
        rest = jnp.maximum(_REST * (t1 - t0), _SHORTEST_STEP * _spacing(t0))
        return jnp.where(end - t1 <= rest, end, t1)


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

    def field(t: Any, y: Any, inputs: Any) -> Any:
        leaves, _ = inputs
        return family.field(t, y, leaves)

    # diffrax traces a step three times, and its vector field with it; this part of it once.
    @functools.partial(jax.jit, inline=True)
    def change(t: Any, y: Any, inputs: Any) -> Any:
        leaves, seed = inputs
        # No derivative: that of the vector field is the one of the right-hand side as it is.
        t, y = lax.stop_gradient((t, y))
        return change_if_asked(lambda y: family.field(t, y, leaves), y, seed)

    def run(
        y0: Any,
        leaves: Any,
        ts: Any,
        jump_ts: Any,
        rtol: Any,
        atol: Any,
        limit: Any,
        longest: Any,
        seed: Any,
    ) -> Any:
        ends = jnp.where(jnp.isin(ts, jump_ts), jnp.nextafter(ts, -jnp.inf), ts)
        pid = diffrax.PIDController(rtol=rtol, atol=atol)
        controller = _Frames(pid, ts, ends, longest, limit)
        if family.jumps:
            controller = diffrax.ClipStepSizeController(controller, jump_ts=jump_ts)
        if family.compensated:
            solver: Any = SOLVERS[family.solver](rtol, atol, change)
        else:
            solver = as_its_library_has_it(family.solver.method)
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(field),
            solver,
            ts[0],
            # Beyond the end, where diffrax would lengthen a step that ends shortly before it.
            2 * ts[-1] - ts[0] + 1e3 * _spacing(jnp.abs(ts[-1])),
            None,
            y0,
            (leaves, seed),
            saveat=diffrax.SaveAt(
                subs=(
                    diffrax.SubSaveAt(ts=ts),
                    diffrax.SubSaveAt(t1=True, fn=lambda t, y, inputs: t),
                )
            ),
            stepsize_controller=controller,
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
    if diffrax.is_okay(reason):
        return "the state is not finite"
    return str(diffrax.RESULTS[reason]).strip().split(". ")[0]
