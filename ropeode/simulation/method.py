"""A stepper that is ready to run, known by what it computes; and which runs share a program."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Hashable
from typing import Any, NamedTuple

import jax

from ropeode.errors import UserCodeError
from ropeode.precision import in_float64
from ropeode.problems import Mechanics, Problem
from ropeode.simulation.jumps import Sides
from ropeode.simulation.layout import Layout
from ropeode.simulation.system import on_stored_states
from ropeode.simulation.trial import Trial, trial_of
from ropeode.steppers import Stepper, as_stepper, template


@dataclasses.dataclass(frozen=True)
class Method:
    """A stepper that is ready to run; equal to others that compute the same.

    Arguments:
        key: what decides what it computes. For a user's stepper that is what JAX sees of it at
            the time: a variable that its code reads may change later.
        stepper: that computes it.
        trial: how it behaves.
    """

    key: Hashable
    stepper: Stepper = dataclasses.field(compare=False)
    trial: Trial = dataclasses.field(compare=False)


class Family(NamedTuple):
    """What runs have in common that one program can make; hashable.

    Fields:
        method: the stepper, ready to run.
        rhs, mechanics: of the problem.
        layout: of the runs in a block.
        y0: the initial state of a block.
        args_tree, args_leaves: the problem's arguments, for a block.
        sides: of the problem.
    """

    method: Method
    rhs: Callable
    mechanics: Mechanics | None
    layout: Layout
    y0: jax.ShapeDtypeStruct
    args_tree: Any
    args_leaves: tuple[jax.ShapeDtypeStruct, ...]
    sides: Sides


@in_float64
def method_of(stepper: Any, problem: Problem) -> Method:
    """A stepper, ready to run on a problem and on others with the same kind of state.

    Arguments:
        stepper: whatever `ropeode.as_stepper` takes; a `Method` is returned as it is.
        problem: that it is tried on.

    Raises:
        InputError: there is no such stepper, or it cannot run on the problem.
        UserCodeError: a user's step raised, returned something that is no state, or keeps hidden
            state.
    """
    if isinstance(stepper, Method):
        return stepper
    stepper = as_stepper(stepper)
    stepper.require(problem)
    stepper = stepper.on(problem.structure)
    trial = trial_of(stepper, problem)
    if trial.hidden_state:
        raise UserCodeError(
            f"stepper: {stepper.label!r} is {trial.hidden_state}; allowed: a step whose output "
            "depends on its input alone. Fix: carry what it remembers in a class, as this file "
            f"does (ropeode check --template two-step):\n\n{template('two-step')}"
        )
    traced = trial.compiled and stepper.compiled is None
    return Method(_digest(stepper, problem) if traced else stepper, stepper, trial)


def _digest(stepper: Stepper, problem: Problem) -> Hashable:
    # Not above: steppers of ropeode need none.
    from ropeode.problems import jaxpr_digest

    init, step, state = on_stored_states(stepper, problem.rhs, problem.mechanics)

    # A new function at each call: JAX finds the traces of functions again.
    def steps(args: Any, y: Any, t: Any, dt: Any) -> Any:
        return state(args, t, step(args, t, init(args, t, y, dt), dt), dt)

    traced = jax.make_jaxpr(steps)(problem.args, problem.y0, 0.0, 1.0)
    return type(stepper), jaxpr_digest(traced)
