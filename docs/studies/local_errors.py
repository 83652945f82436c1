"""How the error of one step shrinks with dt, and what becomes of it along a solution."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Sequence
from typing import Any

import numpy as np

from ropeode import reference
from ropeode.analysis import differences
from ropeode.precision import in_float64
from ropeode.problems import Problem
from ropeode.problems.rope import Rope
from ropeode.references import Reference
from ropeode.simulation import method_of, simulate
from ropeode.theory import Expansion, PredictedError, StepSamples, expanded, predicted_error
from ropeode.theory.flow import short_flow

DAMPING = 5e-5
# Steps from half a frame on, and random states near the first one, moving.
_DTS = 2.0 ** -np.arange(1.0, 17.0)
_STATES, _AWAY, _SPEED = 12, 3.0, 5.0


def assignment(acceleration: Any, t: Any, x: Any, v: Any, dt: Any, args: Any) -> Any:
    """The assignment's Verlet as a function of position and velocity."""
    x_new = x + (1.0 - DAMPING) * dt * v + dt**2 * acceleration(t, x, 0.0 * v, args)
    return x_new, (x_new - x) / dt


def heavier(acceleration: Any, t: Any, x: Any, v: Any, dt: Any, args: Any) -> Any:
    """Half a kick, a drift, half a kick, with gravity one percent too strong."""

    def pull(t: Any, x: Any, v: Any) -> Any:
        return acceleration(t, x, v, args) + 0.01 * (args.free * args.gravity).T

    a = pull(t, x, v)
    half = v + dt / 2 * a
    x = x + dt * half
    return x, half + dt / 2 * pull(t + dt, x, half + dt / 2 * a)


STEPS: dict[str, Any] = {
    "rk4": "rk4",
    "velocity-verlet": "velocity-verlet",
    "semi-implicit-euler": "semi-implicit-euler",
    "gravity 1% too strong": heavier,
    "damping per step": assignment,
}


@dataclasses.dataclass(frozen=True)
class LocalErrors:
    """The largest error of one step at random states of the default rope.

    Arguments:
        label: of the step.
        dts: step sizes.
        errors: of one step of each size, in positions and velocities alike.
        order: at which the step parts from the solution.
    """

    label: str
    dts: np.ndarray
    errors: np.ndarray
    order: int | None


@in_float64
def local_errors(steps: dict[str, Any] = STEPS) -> list[LocalErrors]:
    """The error of one step against its size, for each of several steps.

    Arguments:
        steps: by their labels.
    """
    problem, t, y = random_states()
    exact = short_flow(StepSamples(problem, method_of("rk4", problem)).rates, t, y, _DTS[0])
    found = []
    for label, step in steps.items():
        samples = StepSamples(problem, method_of(step, problem))
        dts = _DTS[np.min(exact.length) >= _DTS]
        after = samples.after(t, y, np.tile(dts, (len(t), 1)), 1)[:, :, 1]
        moved = np.stack(
            [exact.increments(dts / length)[i] for i, length in enumerate(exact.length)]
        )
        errors = np.max(np.abs(after - y[:, None] - moved).reshape(len(t), len(dts), -1), (0, 2))
        found.append(LocalErrors(label, dts, errors, expansion_of(step).order))
    return found


def random_states() -> tuple[Problem, np.ndarray, np.ndarray]:
    """The default rope, times, and random states near its first one."""
    problem, random = Rope().problem(frames=1), np.random.default_rng(0)
    size = np.array([_AWAY, _SPEED])[:, None, None]
    y = problem.y0 + size * random.normal(size=(_STATES, *problem.y0.shape))
    return problem, np.zeros(_STATES), y


@in_float64
def expansion_of(step: Any) -> Expansion:
    """The expansion of a step at the random states."""
    problem, t, y = random_states()
    return expanded(StepSamples(problem, method_of(step, problem)), t, y, longest=_DTS[0])


@dataclasses.dataclass(frozen=True, eq=False)
class Propagated:
    """The predicted and the measured error of a stepper on the default rope.

    Arguments:
        label: of the stepper.
        predicted: leading term.
        runs: steps per frame, and the signed error of each run over dt**order.
    """

    label: str
    predicted: PredictedError
    runs: dict[int, np.ndarray]


def propagated(label: str, steps_per_frame: Sequence[int]) -> Propagated:
    """Predicted and measured error of a stepper on the default rope.

    Arguments:
        label: the name of the stepper.
        steps_per_frame: of the runs.
    """
    known = default_rope()
    predicted = predicted_error(known, method_of(label, known.problem))
    assert isinstance(predicted, PredictedError), predicted
    runs = {
        n: differences(simulate(known.problem, label, n).states, known)
        * float(n) ** predicted.order
        for n in steps_per_frame
    }
    return Propagated(label, predicted, runs)


@functools.cache
def default_rope() -> Reference:
    """The reference of the default rope over 20 frames."""
    return reference(Rope().problem(frames=20))
