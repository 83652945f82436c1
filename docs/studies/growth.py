"""How fast disturbances of a hanging rope grow: by linear theory, and by measurement."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ropeode.analysis import hanging_equilibrium
from ropeode.precision import in_float64
from ropeode.problems import Problem
from ropeode.problems.rope import Rope
from ropeode.simulation import simulate
from ropeode.steppers import as_stepper
from ropeode.theory import growth_per_frame

STEPPERS = ("explicit-euler", "semi-implicit-euler")
STEPS_PER_FRAME = tuple(2**k for k in range(2, 17))
# In length units: far above rounding, and far below where springs are nonlinear even when it
# has grown.
_DISTURBANCE = 1e-7
_SAMPLES = 24
_MOST_STEPS = 2**20


@dataclasses.dataclass(frozen=True)
class MeasuredGrowth:
    """Growth of a disturbance at one step size.

    Arguments:
        stepper: its name with options.
        steps_per_frame: steps in each frame.
        predicted: rate per frame by linear theory.
        measured: rate per frame of a small disturbance along the fastest mode, in a run.
    """

    stepper: str
    steps_per_frame: int
    predicted: float
    measured: float


def growth_scan(
    rope: Rope | None = None,
    steppers: Sequence[str] = STEPPERS,
    steps_per_frame: Sequence[int] = STEPS_PER_FRAME,
) -> list[MeasuredGrowth]:
    """Predicted and measured growth of a small disturbance of the hanging rope.

    Arguments:
        rope: by default the default one. Its damping has to be so weak that all modes
            oscillate; or else theory and measurement are of different modes.
        steppers: names with options.
        steps_per_frame: numbers of steps per frame.
    """
    problem = (rope or Rope()).problem(1)
    still = hanging_equilibrium(problem)
    mode = _fastest_mode(problem, still)
    rates = []
    for name in steppers:
        for steps in steps_per_frame:
            growth = growth_per_frame(problem, name, steps, still)
            measured = _measured(problem, still, mode, name, steps, growth.rate)
            rates.append(MeasuredGrowth(as_stepper(name).label, steps, growth.rate, measured))
    return rates


@in_float64
def _fastest_mode(problem: Problem, still: np.ndarray) -> tuple[np.ndarray, float]:
    """The shape and the frequency of the fastest oscillation about a state of rest."""
    mechanics = problem.require_mechanics("rope")

    def pull(x: Any) -> Any:
        return mechanics.acceleration(0.0, x, jnp.zeros_like(x), problem.args)

    size = still[0].size
    slope = np.asarray(jax.jacfwd(pull)(still[0])).reshape(size, size)
    squares, shapes = (np.real(part) for part in np.linalg.eig(-slope))
    fastest = int(np.argmax(squares))
    shape = shapes[:, fastest].reshape(still[0].shape)
    return shape / np.max(np.abs(shape)), float(np.sqrt(squares[fastest]))


def _measured(
    problem: Problem,
    still: np.ndarray,
    mode: tuple[np.ndarray, float],
    stepper: str,
    steps: int,
    about: float,
) -> float:
    """The rate at which a disturbance along the fastest mode changes in a run.

    Samples are so close that it changes by a quarter of an e-fold in between, or at each step.
    The run covers six e-folds or so, or fewer where those would take very many steps. Its
    first half is left out: displacement and velocity are not in step yet.
    """
    shape, frequency = mode
    each = max(1, round(0.25 * steps / abs(about)))
    samples = max(6, min(_SAMPLES, _MOST_STEPS // each, round(8 * steps / (each * abs(about)))))
    each = min(each, _MOST_STEPS // samples)
    run = simulate(
        dataclasses.replace(
            problem,
            y0=np.stack([still[0] + _DISTURBANCE * shape, still[1]]),
            ts=np.arange(samples + 1) * each / steps,
        ),
        stepper,
        each,
    )
    away = (run.states - still).reshape(len(run.states), 2, -1)
    size = np.hypot(
        frequency * np.linalg.norm(away[:, 0], axis=1), np.linalg.norm(away[:, 1], axis=1)
    )
    half = samples // 2
    return float(np.polyfit(run.times[half:], np.log(size[half:]), 1)[0])
