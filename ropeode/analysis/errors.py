"""The error of a trajectory, as far as the reference can tell it."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ropeode.arrays import real_array
from ropeode.display import Tabular
from ropeode.errors import InputError
from ropeode.norms import Norm, distance, motion, node_distances, norm_for
from ropeode.precision import in_float64
from ropeode.problems import NoEquations, same_problem
from ropeode.references import Reference
from ropeode.simulation import Trajectory
from ropeode.validation import bad_value, check_kind, not_traced

# An error is shown as a number only if it is this many times the reference's bound.
RESOLUTION_FACTOR = 10.0
# What is so much less, at the samples, than it may be between them comes back at each sample.
_COMES_BACK = 1e-3


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class ErrorSeries(Tabular):
    """The error of one run at the samples inside the trust horizon.

    Arguments:
        norm: in which it is measured.
        times: the sample times, without the first, where the error is zero by definition.
        values: the distance from the reference there; no digit of it below `resolution` is
            to be believed.
        resolution: ten times the reference's estimated bound there.

    Examples:
        >>> from ropeode import Rope, error_series, reference, simulate
        >>> truth = reference(Rope(num_nodes=4).problem(frames=3))
        >>> errors = error_series(simulate(truth.problem, "rk4", steps_per_frame=16), truth)
        >>> errors.norm.name, errors.times
        ('position-max', array([1., 2., 3.]))
        >>> (1e7 * errors.values).round()
        array([1., 4., 9.])
    """

    norm: Norm
    times: np.ndarray
    values: np.ndarray
    resolution: np.ndarray

    @property
    def final(self) -> float | None:
        """The error at the last of `times`; None if it is unresolved."""
        return self._if_resolved(self.values[-1])

    @property
    def max(self) -> float | None:
        """The largest error; None if it is unresolved."""
        return self._if_resolved(np.max(self.values))

    @property
    def rms(self) -> float | None:
        """The root mean square over the samples; None if it is unresolved."""
        largest = float(np.max(self.values)) or 1.0
        if not np.isfinite(largest):
            return None
        return self._if_resolved(largest * np.sqrt(np.mean((self.values / largest) ** 2)))

    @property
    def finest(self) -> float:
        """The number below which an error of this run is unresolved."""
        return float(self.resolution[-1])

    def _if_resolved(self, error: float) -> float | None:
        return float(error) if error >= self.finest else None


def error_series(
    trajectory: Any,
    reference: Reference,
    norm: str | None = None,
    *,
    times: ArrayLike | None = None,
) -> ErrorSeries:
    """Hold a trajectory against a reference.

    Arguments:
        trajectory: a run of status `ok`; states ``(times, *state)`` from anywhere, or what
            SciPy's `solve_ivp` returns.
        reference: of the same problem.
        norm: one of `ropeode.norms.NORMS`; by default the problem's first.
        times: of bare states, ``(times,)``; by default the first sample times of the reference,
            or those that SciPy returns. At others than these the problem is solved again.

    Raises:
        InputError: the two are of different problems, the run ended early, the norm does not fit,
            or states have another shape than the problem's, or are not finite.

    Examples:
        >>> from ropeode import Rope, error_series, reference, simulate
        >>> truth = reference(Rope(num_nodes=4).problem(frames=3))
        >>> errors = error_series(simulate(truth.problem, "rk4", steps_per_frame=16), truth)
        >>> f"{errors.max:.1e}"
        '9.0e-07'
    """
    check_kind("reference", reference, Reference, "reference")
    if not isinstance(trajectory, Trajectory):
        return _series_of_states(trajectory, reference, norm_for(reference.problem, norm), times)
    if times is not None:
        raise bad_value("times", times, "times of bare states", "leave it out: a run has its own")
    if not same_problem(trajectory.problem, reference.problem):
        raise InputError(
            "reference: it was computed for another problem than the trajectory; allowed: one "
            "and the same problem. Fix: build the problem once and use it for both; one that is "
            "built when a variable of its right-hand side has changed is another problem."
        )
    if trajectory.status != "ok":
        raise InputError(
            f"trajectory: it {trajectory.lost}; allowed: a run with "
            "status 'ok'. Fix: look at its status first, and take more steps per frame."
        )
    measure = norm_for(reference.problem, norm)
    return ErrorSeries(
        norm=measure,
        times=reference.times[1 : reference.trusted],
        values=distances(trajectory.states, reference, measure)[1:],
        resolution=resolution(reference, measure)[1:],
    )


def _series_of_states(
    states: Any, reference: Reference, norm: Norm, times: ArrayLike | None
) -> ErrorSeries:
    """The error of states from anywhere."""
    if hasattr(states, "t") and hasattr(states, "y"):
        # What SciPy returns, whose states are columns.
        times = states.t if times is None else times
        states = np.moveaxis(states.y, -1, 0)
    problem = reference.problem
    not_traced("trajectory", states)
    try:
        states = np.atleast_1d(np.asarray(states))
    except ValueError:
        # Rows of different lengths.
        allowed = "states of one shape, (times, *state)"
        raise bad_value("trajectory", states, allowed, "give an array of numbers") from None
    at = problem.ts[: len(states)] if times is None else real_array("times", times)
    wanted = (len(at), *problem.y0.shape)
    if states.size != math.prod(wanted) or states.shape[:1] != at.shape:
        raise bad_value(
            "trajectory",
            f"shape {states.shape}",
            f"states of shape {wanted}, one for each of {len(at)} times",
            "give the times of the states as times=..." if times is None else "mend the shape",
        )
    states = real_array("trajectory", states.reshape(wanted))
    if np.any(np.diff(at) <= 0.0):
        raise bad_value("times", at, "increasing times", "sort states and times")
    end = problem.ts[reference.trusted - 1]
    inside = (at > problem.ts[0]) & (at <= end)
    if not np.any(inside):
        raise bad_value(
            "times",
            at,
            f"times after {problem.ts[0]:g} and up to {end:g}, where the reference is trusted",
            "take others",
        )
    at, states = at[inside], states[inside]
    index = np.searchsorted(problem.ts, at)
    if np.array_equal(problem.ts[np.minimum(index, problem.frames)], at):
        exact, bound = reference.states[index], reference.bound(norm)[index]
    else:
        exact, bound = reference.at(at), reference.bound_at(at, norm)
    values = distance(problem, norm, states, exact)
    with np.errstate(over="ignore"):  # A bound near the largest number tells nothing.
        return ErrorSeries(norm, at, values, RESOLUTION_FACTOR * bound)


def distances(states: np.ndarray, reference: Reference, norm: Norm) -> np.ndarray:
    """How far states are from the reference at each sample that it is trusted at.

    Arguments:
        states: at the first sample times of the reference's problem, ``(times, *state)``; not
            a number where a run diverged.
        reference: of the problem.
        norm: in which the distance is measured.

    Returns:
        Distances, ``(samples,)``: as many as there are states, up to the trust horizon.
    """
    samples = min(len(states), reference.trusted)
    return distance(reference.problem, norm, states[:samples], reference.states[:samples])


def quantity_distances(values: np.ndarray, reference: Reference, norm: Norm) -> np.ndarray:
    """As `distances`, from the quantity that the norm measures, ``(times, nodes, dim)``."""
    samples = min(len(values), reference.trusted)
    right = reference.problem.quantity(norm.quantity, reference.states[:samples])
    return norm.over_nodes(node_distances(values[:samples], right))


def differences(states: np.ndarray, reference: Reference) -> np.ndarray:
    """States minus the reference, component by component, at each trusted sample.

    Arguments:
        states: at the first sample times of the reference's problem, ``(times, *state)``.
        reference: of the problem, or of another with the same sample times.
    """
    samples = min(len(states), reference.trusted)
    return states[:samples] - reference.states[:samples]


def resolution(reference: Reference, norm: Norm) -> np.ndarray:
    """The smallest error that the reference can tell at each trusted sample, ``(samples,)``."""
    with np.errstate(over="ignore"):
        return RESOLUTION_FACTOR * reference.bound(norm)[: reference.trusted]


def energy_errors(energies: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Energies of a run minus the true ones, at the first samples that both have, ``(times,)``."""
    samples = min(len(energies), len(truth))
    return energies[:samples] - truth[:samples]


@in_float64
def moved(reference: Reference, norm: Norm, frames: int | None = None) -> float:
    """How far the solution gets from its start inside the horizon.

    An orbit that is sampled once in each period comes back, and has moved between the samples: as
    far as its first slope (and acceleration) leads in a frame, but no farther than the size of the
    initial state.

    Arguments:
        reference: of the solution.
        norm: the measure.
        frames: up to this one; by default the last of the horizon.
    """
    problem = reference.problem
    last = reference.trusted - 1 if frames is None else frames
    seen = float(motion(problem, reference.states[: last + 1], norm)[-1])
    if seen >= _COMES_BACK * problem.scale or isinstance(problem.rhs, NoEquations):
        return seen
    frame = float(np.max(np.diff(problem.ts)))
    way = frame * np.array(problem.rhs(problem.ts[0], problem.y0, problem.args))
    if problem.mechanics is not None:
        way[0] += frame / 2 * way[1]
    ahead = float(distance(problem, norm, (problem.y0 + way)[None], problem.y0[None])[0])
    between = min(ahead, problem.scale)
    return between if seen < _COMES_BACK * between else seen
