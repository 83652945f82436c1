"""What precision the stepper works in, and what it makes of the places where forces are odd."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ropeode.checking.candidate import Candidate
from ropeode.checking.check_context import Examination
from ropeode.checking.problems import check_rope, convergence_problems, generic
from ropeode.checking.report import Finding
from ropeode.problems.problem import Problem
from ropeode.simulation.method import Method
from ropeode.steppers.base import Stepper, System

_STEPS = 12
# Of the rope's size: far above the rounding of float64, far below that of float32.
_NUDGE = 1e-10
# Twice the nudge moves the result twice as far, to this. The velocities of a two-step method are
# differences over a step, whose rounding shows in the third digit; float32 leaves none.
_LINEAR = 3e-2


def float32(examination: Examination) -> Finding:
    """Whether single precision is hidden inside, and what it would cost to store states in it."""
    problem, run = generic(), examination.candidate.run
    direction = np.random.default_rng(11).normal(size=problem.y0.shape)
    direction *= problem.args.free[None, :, None]

    def moved(size: float) -> np.ndarray:
        near = problem.changed(y0=problem.y0 + size * direction)
        return (run(near, _STEPS) - run(problem, _STEPS))[1:]

    once, twice = moved(_NUDGE), moved(2.0 * _NUDGE)
    answer = float(np.max(np.abs(once)))
    # What is rounded away altogether is off by all of it.
    off = float(np.max(np.abs(twice - 2.0 * once))) / answer if answer > 0.1 * _NUDGE else 1.0
    if not off <= _LINEAR:
        return Finding(
            "float32",
            "fail",
            f"does not resolve a change of {_NUDGE:.0e} (off by {off:.0e} of the answer): numbers "
            "are rounded to float32 somewhere",
            {"nonlinearity": off},
        )
    cost = _cost_of_storing(examination, problem)
    line = f"works in float64; states stored in float32 would cost {cost:.0e} of the rope's size"
    return Finding("float32", "pass", line, {"nonlinearity": off, "cost": cost})


def _cost_of_storing(examination: Examination, problem: Problem) -> float:
    """How far a run ends from where it should, if what is carried is float32 after each step."""
    own = examination.candidate
    method = own.method
    stored = Candidate(Method(("float32", method.key), _StoredIn32(own.stepper), method.trial))
    apart = stored.run(problem, _STEPS) - own.run(problem, _STEPS)
    return float(np.max(np.abs(apart))) / problem.scale


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
    """Where two nodes meet, their spring has no direction, and no force."""
    given = convergence_problems()["textbook"]
    x0 = given.y0[0].copy()
    x0[3] = x0[2]
    problem = check_rope("zero length", x0, given.ts, gravity=(0.0, -1.0, 0.0))
    states = examination.candidate.run(problem, _STEPS)
    if np.all(np.isfinite(states)):
        return Finding("zero-length", "pass", "finite where two nodes are in one place")
    if not examination.candidate.own_forces:
        return Finding(
            "zero-length",
            "note",
            "not finite where two nodes are in one place: the force that it is given is, but "
            "has no limit there, so that the equations of an implicit step may have no solution",
        )
    return Finding(
        "zero-length",
        "fail",
        "not finite where two nodes are in one place: guard the division by a spring's length",
    )
