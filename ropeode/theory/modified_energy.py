"""What a symplectic step keeps better than the energy: the energy with its leading correction."""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import numpy as np

from ropeode.json_form import json_shows
from ropeode.precision import in_float64
from ropeode.problems import Problem
from ropeode.simulation import method_of, simulate, step_size
from ropeode.theory.expansion import expanded
from ropeode.theory.step_samples import StepSamples
from ropeode.theory.structure import Setting, with_leaves
from ropeode.validation import check_whole

# Gauss points on the straight line from each sample to the next, and the most samples.
_POINTS, _SAMPLES = 6, 25


class Swings(NamedTuple):
    """How far an energy swings along a run.

    Fields:
        predicted: by its leading correction.
        measured: of the energy H.
        modified: of the corrected energy H + dt^p H_p.
    """

    predicted: float
    measured: float
    modified: float


@json_shows(
    *("order", "steps_per_frame", "frames", "swings.predicted", "swings.measured", "ratio"),
    "swings.modified",
)
@dataclasses.dataclass(frozen=True, eq=False)
class ModifiedEnergy:
    """The energy H along a run, and ``H + dt**p H_p``, which is constant to a higher order.

    Arguments:
        order: p, of the method.
        steps_per_frame: of the run.
        dt: step size.
        times: of the samples, ``(times,)``.
        correction: ``H_p`` less its value at the start, ``(times,)``.
        energy: H less its value at the start, ``(times,)``.
    """

    order: int
    steps_per_frame: int
    dt: float
    times: np.ndarray
    correction: np.ndarray
    energy: np.ndarray

    @property
    def modified(self) -> np.ndarray:
        """``H + dt**p H_p`` less its value at the start, ``(times,)``."""
        return self.energy + self.dt**self.order * self.correction

    @property
    def frames(self) -> int:
        """Of the run."""
        return len(self.times) - 1

    @property
    def swings(self) -> Swings:
        """How far H and the modified energy swing along the run."""
        by_theory = self.dt**self.order * self.correction
        return Swings(*(float(np.ptp(each)) for each in (by_theory, self.energy, self.modified)))

    @property
    def ratio(self) -> float | None:
        """The measured swing over the predicted one; None where nothing is predicted to swing."""
        swings = self.swings
        return swings.measured / swings.predicted if swings.predicted else None


@in_float64
def modified_energy_of(
    problem: Problem, stepper: Any, steps_per_frame: int
) -> ModifiedEnergy | str:
    """The leading correction of the energy that a symplectic method keeps, along a run.

    A step with the local error ``dt**(p + 1) d(y)`` follows the vector field ``f + dt**p d``, up to
    higher terms. If the step is symplectic, d is Hamiltonian as f is: with the form w of the
    problem, ``w(d, .)`` is the differential of a function ``H_p``. It is integrated here along
    straight lines from sample to sample of a run, as along any way. (Where the step is not
    symplectic, there is no such function, and the integral depends on the way.) It is as
    exact as d is known, which is to 1e-6 or so.

    Damping is left out, as by `structure_of`.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, section IX.3.

    Arguments:
        problem: a mechanical one with an energy.
        stepper: whatever `ropeode.as_stepper` takes; a symplectic one.
        steps_per_frame: of the run.

    Returns:
        Why there is none, if so.

    Raises:
        InputError: there is no such stepper, it cannot run on the problem, or `steps_per_frame`
            is no whole number >= 1.
        UserCodeError: a user's step raised.
    """
    steps = check_whole("steps_per_frame", steps_per_frame, at_least=1, example="64")
    problem.require_mechanics("problem")
    method = method_of(stepper, problem)
    problem = with_leaves(problem, {"damping": 0.0})
    setting = Setting.of(problem)
    if setting is None or not setting.hamiltonian:
        return "the problem is not Hamiltonian, as far as its energy says"
    run = simulate(problem, method, steps)
    if run.status != "ok":
        return f"the run {run.lost}"
    samples, longest = StepSamples(problem, method), step_size(problem, 1)
    order = expanded(samples, problem.ts[:1], setting.states[:1], longest).order
    if order is None or order < 1:
        return "the order of the step is not known"
    nodes, weights = np.polynomial.legendre.leggauss(_POINTS)
    states = run.states[:_SAMPLES]
    way = np.diff(states, axis=0)
    on_lines = states[:-1] + np.multiply.outer(0.5 * (nodes + 1.0), way)
    flat = on_lines.reshape(-1, *problem.y0.shape)
    at = np.full(len(flat), problem.ts[0])
    errors = expanded(samples, at, flat, longest).rate(order).value
    free = setting.free
    slopes = [error.ravel()[free] @ setting.form(y) for y, error in zip(flat, errors, strict=True)]
    along = np.reshape(slopes, (_POINTS, len(way), -1)) * way.reshape(len(way), -1)[:, free]
    parts = 0.5 * np.tensordot(weights, np.sum(along, axis=2), 1)
    correction = np.concatenate([[0.0], np.cumsum(parts)])
    energy = problem.energies(states)
    return ModifiedEnergy(
        order=order,
        steps_per_frame=steps,
        dt=run.dt,
        times=run.times[:_SAMPLES],
        correction=correction,
        energy=energy - energy[0],
    )
