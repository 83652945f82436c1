"""The error of a trajectory, as far as the reference can tell it."""

from __future__ import annotations

import dataclasses

import numpy as np

from ropeode.display import Displayed
from ropeode.errors import InputError
from ropeode.norms import Norm, distance, node_distances, norm_for
from ropeode.problems.ensemble import same_problem
from ropeode.problems.problem import Problem
from ropeode.references.reference import Reference
from ropeode.simulation import Trajectory

# An error is shown as a number only if it is this many times the reference's bound.
RESOLUTION_FACTOR = 10.0


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class ErrorSeries(Displayed):
    """The error of one run at the samples inside the trust horizon.

    Arguments:
        norm: in which it is measured.
        times: the sample times, without the first, where the error is zero by definition.
        values: the distance from the reference there; no digit of it below `resolution` is
            to be believed.
        resolution: ten times the reference's estimated bound there.
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
    trajectory: Trajectory, reference: Reference, norm: str | None = None
) -> ErrorSeries:
    """Hold a trajectory against a reference.

    Arguments:
        trajectory: a run that did not diverge.
        reference: of the same problem.
        norm: one of `ropeode.norms.NORMS`; by default the problem's first.

    Raises:
        InputError: the two are of different problems, the run diverged, or the norm does not
            fit.
    """
    if not same_problem(trajectory.problem, reference.problem):
        raise InputError(
            "reference: it was computed for another problem than the trajectory; allowed: one "
            "and the same problem. Fix: build the problem once and use it for both; where its "
            "right-hand side reads a variable that has changed since, compute both again."
        )
    if trajectory.status != "ok":
        raise InputError(
            f"trajectory: it diverged at frame {trajectory.diverged_at}; allowed: a run with "
            "status 'ok'. Fix: look at its status first, and take more steps per frame."
        )
    measure = norm_for(reference.problem, norm)
    return ErrorSeries(
        norm=measure,
        times=reference.times[1 : reference.trusted],
        values=distances(trajectory.states, reference, measure)[1:],
        resolution=resolution(reference, measure)[1:],
    )


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
    return distances_from(reference.states[:samples], states[:samples], reference.problem, norm)


def distances_from(
    truth: np.ndarray, states: np.ndarray, problem: Problem, norm: Norm
) -> np.ndarray:
    """How far states are from the true ones, both ``(times, *state)``, at each sample."""
    return distance(problem, norm, states, truth)


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
    return RESOLUTION_FACTOR * reference.bound(norm)[: reference.trusted]


def error_sizes(problem: Problem, errors: np.ndarray, norm: Norm) -> np.ndarray:
    """The size of errors that are known as vectors, ``(times,)``.

    Arguments:
        problem: whose states they belong to.
        errors: ``(times, *state)``.
        norm: in which they are measured.
    """
    return distance(problem, norm, errors, np.zeros_like(errors))
