"""The eigenvalues of a problem along its solution, and the steps that they ask for."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import jax
import numpy as np

from ropeode.precision import in_float64
from ropeode.problems import Problem, Rhs, compiled, free_coordinates
from ropeode.simulation import step_size
from ropeode.theory.growth import StableSteps, stable_steps
from ropeode.theory.stability_function import StabilityFunction

# Of the largest eigenvalue: a real part, or an imaginary one, that rounding may have made of zero.
# A differenced right-hand side rounds far more.
_ROUNDING, _DIFFERENCE = 1e-12, 1e-7
# Growth in a step that rounding can make of none; more where two modes are hard to tell apart.
_GROWTH, _EPS = 1e-13, 64 * float(np.finfo(np.float64).eps)

# How far past a limit the mode that decides shows.
_BEYOND = 1e-4
_MOST_IN_PYTHON = 50


@dataclasses.dataclass(frozen=True, eq=False)
class Spectrum:
    """The eigenvalues of the derivative of the right-hand side at several states.

    Arguments:
        times: of the states, ``(times,)``.
        eigenvalues: per time unit, over the coordinates that can move, ``(times, modes)``.
        rounding: how far they may be off, ``(times,)``.
    """

    times: np.ndarray
    eigenvalues: np.ndarray
    rounding: np.ndarray

    @property
    def growing(self) -> np.ndarray:
        """Which of them belong to modes that grow in the solution itself, ``(times, modes)``."""
        return np.real(self.eigenvalues) > self.rounding[:, None]


@dataclasses.dataclass(frozen=True)
class SpectralLimit:
    """How many steps the eigenvalues along a solution ask for.

    Of the modes that do not grow in the solution none must grow in the stepper. For those that do
    grow, no step size is asked for.

    A frozen spectrum is no proof. Eigenvalues at each time say what happens if the equation stays
    as it is at that time. While it changes, disturbances can grow although each frozen equation
    lets them decay (parametric resonance), or decay where each lets them grow; modes that are not
    at right angles can grow for a while; and nonlinear forces can hold growth, or set it off
    elsewhere (Hairer, Wanner, Solving Ordinary Differential Equations II, section IV.2; Coppel,
    Dichotomies in Stability Theory, lecture 1).

    Arguments:
        steps: how short they have to be.
        time: when the mode that decides is at its worst: the first that grows with longer steps.
        eigenvalue: of this mode, per time unit.
        times: how many states were looked at.
    """

    steps: StableSteps
    time: float
    eigenvalue: complex
    times: int


@in_float64
def spectrum_of(problem: Problem, times: np.ndarray, states: np.ndarray) -> Spectrum:
    """The eigenvalues of the derivative of the right-hand side, at states of a solution.

    Coordinates that are held are left out.

    Arguments:
        problem: whose right-hand side it is.
        times: of the states, ``(times,)``.
        states: ``(times, *state)``.
    """
    along, shape = derivative_of_rhs(problem), states.shape
    units = np.eye(problem.y0.size).reshape(-1, *shape[1:])
    columns = [along(times, states, np.broadcast_to(unit, shape)) for unit in units]
    matrices = np.stack(columns, axis=-1).reshape(len(states), len(units), len(units))
    if problem.mechanics is not None:
        free = np.tile(free_coordinates(problem).ravel(), 2)
        matrices = matrices[:, free][:, :, free]
    eigenvalues = np.linalg.eigvals(matrices)
    share = _DIFFERENCE if problem.in_python else _ROUNDING
    rounding = share * np.max(np.abs(eigenvalues), axis=1, initial=0.0)
    # What is kept forever, as the sum of all concentrations, has the eigenvalue 0. Long steps would
    # make much of what rounding makes of it.
    still = np.abs(eigenvalues) <= rounding[:, None]
    return Spectrum(np.asarray(times), np.where(still, 0.0, eigenvalues), rounding)


def derivative_of_rhs(
    problem: Problem,
) -> Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]:
    """The derivative of the right-hand side along tangents, for many times and states."""
    along, args = compiled(_along, problem.rhs), problem.args
    return lambda t, y, tangent: np.asarray(along(t, y, tangent, args))


def _along(rhs: Rhs) -> Callable:
    def along(t: Any, y: Any, tangent: Any, args: Any) -> Any:
        return jax.jvp(lambda y: rhs(t, y, args), (y,), (tangent,))[1]

    return jax.vmap(along, in_axes=(0, 0, 0, None))


@in_float64
def spectral_limit(
    problem: Problem, function: StabilityFunction, along: Spectrum
) -> SpectralLimit | None:
    """How many steps per frame the eigenvalues along a solution ask for.

    Where the stepper is one for mechanical problems, modes are taken in pairs: an oscillation with
    its conjugate, and of those that do not oscillate the fastest with the slowest, which are the
    two of one oscillator where all nodes have the same damping per mass. Of a step in Python whose
    values cost much, only the fastest modes are looked at.

    Arguments:
        problem: whose frames are divided; the longest of them counts.
        function: of the stepper.
        along: eigenvalues of the problem.

    Returns:
        None where the stepper takes no damping and the problem is damped, or where all modes
        grow in the solution itself.
    """
    paired = function.equation != "y' = lambda y"
    modes = [
        (float(t), *pair)
        for t, values, rounding in zip(along.times, along.eigenvalues, along.rounding, strict=True)
        for pair in (_pairs(values, rounding) if paired else ((z, np.conj(z)) for z in values))
        if max(pair[0].real, pair[1].real if paired else -np.inf) <= rounding
    ]
    if not modes:
        return None
    if not function.is_quick:
        modes = sorted(modes, key=lambda mode: -abs(mode[1]))[:_MOST_IN_PYTHON]
    times, z, other = (np.array(column) for column in zip(*modes, strict=True))
    tiny = np.max(along.rounding)
    if not function.damped:
        if np.any(np.real(z) < -tiny):
            return None
        z, other = 1j * np.imag(z), -1j * np.imag(z)
    frame = step_size(problem, 1)

    def growth(dt: float) -> np.ndarray:
        apart = np.maximum(dt * np.abs(z - other), _EPS) if paired else 1.0
        return function.radius(dt * z, dt * other) - 1.0 - _GROWTH - _EPS / apart

    weak = function.amplification is not None and function.amplification.coefficient > 0
    if weak and np.any((np.abs(np.real(z)) <= tiny) & (np.abs(z) > tiny)):
        # It grows with each number of steps, if only by less than rounding shows.
        steps, unstable = StableSteps(None, 0.0), frame
    else:
        steps = stable_steps(lambda n: bool(np.all(growth(frame / n) <= 0.0)), frame)
        unstable = (1.0 + _BEYOND) * steps.dt if 0.0 < steps.dt < np.inf else frame
    worst = int(np.argmax(growth(unstable)))
    return SpectralLimit(steps, float(times[worst]), complex(z[worst]), len(along.times))


def _pairs(values: np.ndarray, rounding: float) -> list[tuple[complex, complex]]:
    """The two modes of each oscillator."""
    oscillating = values[np.imag(values) > rounding]
    slow = np.sort(np.real(values[np.abs(np.imag(values)) <= rounding]))
    half = len(slow) // 2
    return [(complex(z), complex(z.conjugate())) for z in oscillating] + [
        (complex(a), complex(b)) for a, b in zip(slow[:half], slow[: -half - 1 : -1], strict=True)
    ]
