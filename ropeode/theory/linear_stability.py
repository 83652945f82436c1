"""How long a stepper's steps may be on a problem: predicted, and measured."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from ropeode.analysis import hanging_equilibrium
from ropeode.errors import InputError
from ropeode.json_form import json_shows
from ropeode.precision import in_float64
from ropeode.problems import Problem
from ropeode.references import Reference
from ropeode.simulation import Method, method_of, simulate, step_size
from ropeode.theory.growth import StableSteps, fewest_steps, stable_steps_at_rest
from ropeode.theory.spectrum import SpectralLimit, Spectrum, spectral_limit, spectrum_of
from ropeode.theory.stability_function import StabilityFunction, stability_function_of
from ropeode.theory.stability_limits import StabilityLimits, stability_limits_of

# A run has blown up where it is so many times larger than anything on the reference.
_BLOWN_UP = 100.0
# Steps per frame that runs are tried with; those in Python take long.
_MOST_COMPILED, _MOST_IN_PYTHON = 2**12, 2**6


@json_shows(
    "predicted=predicted.steps.steps_per_frame",
    "measured=bounded_from",
    "predicted_dt=predicted.steps.dt",
    "predicted_at_rest=predicted_at_rest.steps.steps_per_frame",
    "measured_at_rest=measured_at_rest.steps_per_frame",
    "imaginary_axis=limits.imaginary.limit",
    "real_axis=limits.real.limit",
    "notes",
)
@dataclasses.dataclass(frozen=True, eq=False)
class LinearStability:
    """What linear theory says of a stepper on a problem, beside what its own steps do.

    Arguments:
        problem: that it is judged on.
        function: its stability function, or why it has none.
        limits: of that function on the axes.
        along: the eigenvalues of the problem along its solution.
        predicted: how short steps have to be, from the function and these eigenvalues.
        predicted_at_rest: the same from those at the equilibrium; None where there is none.
        measured_at_rest: how short they have to be for a small disturbance of the equilibrium not
            to grow, from the derivative of the stepper's own step.
        bounded_from: the smallest number of steps per frame from which on runs over the span of
            the problem do not blow up. Slow growth does not show in a short span, so that this
            can be far below what is predicted.
        notes: why something is missing, a sentence for each.
    """

    problem: Problem
    function: StabilityFunction | str
    limits: StabilityLimits | None
    along: Spectrum
    predicted: SpectralLimit | None
    predicted_at_rest: SpectralLimit | None
    measured_at_rest: StableSteps | None
    bounded_from: int | None
    notes: tuple[str, ...]

    def dt(self, steps_per_frame: int) -> float:
        """The (largest) step size of a number of steps per frame."""
        return step_size(self.problem, steps_per_frame)


@in_float64
def linear_stability_of(reference: Reference, stepper: Any) -> LinearStability:
    """How long a stepper's steps may be on a problem.

    Arguments:
        reference: of the problem. The eigenvalues are taken at its trusted samples.
        stepper: whatever `ropeode.as_stepper` takes.

    Raises:
        InputError: there is no such stepper, or it cannot run on the problem.
        UserCodeError: a user's step raised.
    """
    problem = reference.problem
    method = method_of(stepper, problem)
    notes: list[str] = []
    times = reference.times[: reference.trusted]
    along = spectrum_of(problem, times, reference.states[: reference.trusted])
    function = stability_function_of(problem, method)
    limits = predicted = None
    if isinstance(function, str):
        notes.append(function)
    else:
        limits = stability_limits_of(function)
        predicted = spectral_limit(problem, function, along)
        if predicted is None:
            notes.append(
                "No mode along the solution can be judged: all of them grow in the solution "
                "itself, or the stepper takes no damping and they are damped."
            )
    at_rest, measured = _at_rest(problem, method, function, notes)
    return LinearStability(
        problem,
        function,
        limits,
        along,
        predicted,
        at_rest,
        measured,
        _bounded_from(reference, method, notes),
        tuple(notes),
    )


def _at_rest(
    problem: Problem,
    method: Method,
    function: StabilityFunction | str,
    notes: list[str],
) -> tuple[SpectralLimit | None, StableSteps | None]:
    """How short steps have to be about the equilibrium: predicted, and measured."""
    if problem.mechanics is None:
        notes.append("No equilibrium was looked for: the problem is not mechanical.")
        return None, None
    try:
        still = hanging_equilibrium(problem)
    except InputError:
        notes.append("The initial positions sink to no stable equilibrium to look at.")
        return None, None
    predicted = None
    try:
        modes = spectrum_of(problem, problem.ts[:1], still[None])
        if np.any(modes.growing):
            notes.append("The equilibrium is unstable in the problem itself.")
            return None, None
        if isinstance(function, StabilityFunction):
            predicted = spectral_limit(problem, function, modes)
        measured = stable_steps_at_rest(problem, method)
    except InputError as error:
        notes.append(f"No growth about an equilibrium was measured: {error}")
        return predicted, None
    if predicted and predicted.steps.steps_per_frame is None and measured.steps_per_frame:
        notes.append(
            "By its stability function the stepper grows at every step size; from "
            f"{measured.steps_per_frame} steps per frame on, rounding hides that in its own step."
        )
    return predicted, measured


def _bounded_from(reference: Reference, method: Method, notes: list[str]) -> int | None:
    problem = reference.problem
    largest = _BLOWN_UP * float(np.max(np.abs(reference.states)))
    most = _MOST_COMPILED if method.trial.compiled else _MOST_IN_PYTHON

    def bounded(steps: int) -> bool:
        run = simulate(problem, method, steps)
        return run.status == "ok" and bool(np.max(np.abs(run.states)) <= largest)

    found = fewest_steps(bounded, most)
    if found is None:
        notes.append(f"Runs blow up with as many as {most} steps per frame.")
    return found
