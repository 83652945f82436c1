"""The precision in which a step computes, and springs of length zero."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ropeode.checking.check_context import Examination, padded_states
from ropeode.checking.check_ropes import check_rope, convergence_problems, generic
from ropeode.checking.report import Finding
from ropeode.checking.written_precision import DIGITS_OF_FLOAT64, digits_of
from ropeode.errors import UserCodeError
from ropeode.problems import Problem
from ropeode.simulation import Method
from ropeode.steppers import Stepper, System

_STEPS = 12
# A change of the initial state, as a part of the rope's size: far above the rounding of float64,
# far below that of float32.
_CHANGE = 1e-10
# Twice the change moves the result twice as far, to within this. The velocities of a two-step
# method are differences over a step, whose rounding shows in the third digit; with float32 no
# digit is right.
_NONLINEARITY = 3e-2
# A step of this length moves with a change of positions of 16 roundings of 1, and with one of
# velocities of 256 (a velocity may be a difference of positions, over dt): no more than a few
# numbers may stay the same to the last bit.
_DT, _TINY, _SAME = 0.25, (2.0**-48, 2.0**-44), 0.2


def float32(examination: Examination) -> Finding:
    """Whether the step computes in float64, and what it would cost to store states in float32."""
    problem, run = generic(), examination.run
    direction = np.random.default_rng(11).normal(size=problem.y0.shape)
    direction *= problem.args.free[None, :, None]

    def response(size: float) -> np.ndarray:
        near = problem.changed(y0=problem.y0 + size * direction)
        return (run(near, _STEPS) - run(problem, _STEPS))[1:]

    if lost := _unmoved(examination, problem):
        return Finding("float32", "fail", lost)
    once, twice = response(_CHANGE), response(2.0 * _CHANGE)
    largest = float(np.max(np.abs(once)))
    # A response that is rounded away is off by all of it.
    off = float(np.max(np.abs(twice - 2.0 * once))) / largest if largest > 0.1 * _CHANGE else 1.0
    if not off <= _NONLINEARITY:
        return Finding(
            "float32",
            "fail",
            f"a change of {_CHANGE:.0e} of the initial state is lost (the response is off by "
            f"{off:.0e} of itself): the step rounds numbers, as to float32",
            {"nonlinearity": off},
        )
    cost = _cost_of_storing(examination, problem)
    line = f"computes in float64; float32 states would add errors of {cost:.0e} of the rope's size"
    return Finding("float32", "pass", line, {"nonlinearity": off, "cost": cost})


def _unmoved(examination: Examination, problem: Problem) -> str:
    """Which half of the state does not respond to a tiny change, in words; "" if both do."""
    free = problem.args.free > 0.0
    for half, name in enumerate(("positions", "velocities")):
        if half and not _is_function(examination.stepper):
            # A velocity may be a difference of positions that are carried, and have its rounding.
            continue
        nudge = np.zeros_like(problem.y0)
        nudge[half, free] = _TINY[half]
        near = problem.changed(y0=problem.y0 + nudge)
        own, moved = (examination.one_step(each, _DT)[half, free] for each in (problem, near))
        same = float(np.mean(own == moved))
        if same > _SAME:
            digits = digits_of(own)[1]
            kept = f", and has no more than {digits} decimals" if digits < DIGITS_OF_FLOAT64 else ""
            return (
                f"a change of {_TINY[half]:.0e} of the {name} leaves {100 * same:.0f}% of them the "
                f"same to the last bit after a step{kept}: the step rounds {name}, to fewer digits "
                "than float64 has"
            )
    return ""


def _is_function(stepper: Stepper) -> bool:
    return type(stepper).init is Stepper.init and type(stepper).state is Stepper.state


def _cost_of_storing(examination: Examination, problem: Problem) -> float:
    """The error, as a part of the rope's size, of rounding all that is stored after each step."""
    own = examination.method
    stored = Method(("float32", own.key), _StoredIn32(own.stepper), own.trial)
    states = padded_states(problem, stored, _STEPS)
    return float(np.max(np.abs(states - examination.run(problem, _STEPS)))) / problem.scale


class _StoredIn32(Stepper):
    """Another stepper, whose floating-point numbers pass through float32 after each step."""

    def __init__(self, stepper: Stepper):
        self._stepper = stepper
        self.init, self.state = stepper.init, stepper.state
        self.any_layout = stepper.any_layout  # type: ignore[misc]

    def step(self, system: System, t: Any, carried: Any, dt: Any) -> Any:
        """As the stepper does, rounded."""
        return jax.tree.map(_through_32, self._stepper.step(system, t, carried, dt))


def _through_32(leaf: Any) -> Any:
    if not jnp.issubdtype(jnp.result_type(leaf), jnp.floating):
        return leaf
    return leaf.astype(np.float32).astype(np.float64)


def zero_length(examination: Examination) -> Finding:
    """A spring of length zero has no direction, and exerts no force."""
    textbook = convergence_problems()["textbook"]
    x0 = textbook.y0[0].copy()
    x0[3] = x0[2]
    problem = check_rope("zero length", x0, textbook.ts, gravity=(0.0, -1.0, 0.0))
    try:
        finite = bool(np.all(np.isfinite(examination.run(problem, _STEPS))))
        what = "the result is not finite if two nodes coincide"
    except UserCodeError as error:
        finite, what = False, f"if two nodes coincide the step raises {error.__cause__!r}"
    if finite:
        return Finding("zero-length", "pass", "the result is finite if two nodes coincide")
    if not examination.own_forces:
        return Finding(
            "zero-length",
            "note",
            f"{what}: the force there is finite but discontinuous, so the equations of an implicit "
            "step may have no solution",
        )
    line = f"{what}: guard the division by a spring's length"
    return Finding("zero-length", "fail", line)
