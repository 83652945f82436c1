"""How the distance between two trajectories is measured at each sample time."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ropeode.errors import InputError
from ropeode.json_form import json_as
from ropeode.problems import Problem
from ropeode.validation import bad_value, unknown

_BLOCK_BYTES = 2**24


@json_as(str, lambda norm: norm.name)
class Norm(NamedTuple):
    """A distance between two states.

    Fields:
        name: as it is typed on the command line.
        quantity: what it compares: position, velocity, or state.
        over_nodes: reduces the distances of the nodes, ``(times, nodes)``, to ``(times,)``; never
            to more than the largest of them, so that a bound on that one holds.
        words: a description, for the head of a table.
    """

    name: str
    quantity: str
    over_nodes: Callable[[np.ndarray], np.ndarray]
    words: str


def _largest(distances: np.ndarray) -> np.ndarray:
    return np.max(distances, axis=1)


def _root_mean_square(distances: np.ndarray) -> np.ndarray:
    largest = np.max(distances, axis=1, keepdims=True)
    scaled = distances / np.where(largest > 0, largest, 1.0)
    return largest[:, 0] * np.sqrt(np.mean(scaled**2, axis=1))


NORMS: dict[str, Norm] = {
    norm.name: norm
    for norm in (
        Norm("position-max", "position", _largest, "largest distance of a node"),
        Norm("position-rms", "position", _root_mean_square, "rms distance of the nodes"),
        Norm("velocity-max", "velocity", _largest, "largest velocity error of a node"),
        Norm("velocity-rms", "velocity", _root_mean_square, "rms velocity error of the nodes"),
        Norm("state-max", "state", _largest, "largest error of a component"),
        Norm("state-rms", "state", _root_mean_square, "rms error of the components"),
    )
}


def norm_for(problem: Problem, given: Norm | str | None = None) -> Norm:
    """The norm of this name, or the default of the problem: its first ``-max`` norm.

    Arguments:
        problem: in which it measures.
        given: a name of `NORMS`, or the norm itself.

    Raises:
        InputError: there is no such norm, or the problem has no such quantity.
    """
    fitting = [norm for norm in NORMS.values() if norm.quantity in problem.quantities]
    if given is None:
        return fitting[0]
    if not isinstance(given, Norm) and (not isinstance(given, str) or given not in NORMS):
        raise InputError(unknown("norm", str(given), NORMS))
    norm = given if isinstance(given, Norm) else NORMS[given]
    if norm.quantity not in problem.quantities:
        allowed = ", ".join(norm.name for norm in fitting)
        raise bad_value(
            "norm", norm.name, f"those that {problem.name!r} has: {allowed}", "use one of them"
        )
    return norm


def distance(problem: Problem, norm: Norm, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The distance between two trajectories at each sample that both have, ``(times,)``.

    Works on blocks of samples, so that no third trajectory is held in memory, and on scaled
    differences, so that large numbers do not overflow.

    Arguments:
        problem: of the two trajectories.
        norm: the measure.
        a: states, ``(times, *state)``.
        b: states, ``(times, *state)``; the longer of the two is cut.
    """
    times = min(len(a), len(b))
    block = max(1, _BLOCK_BYTES // max(1, problem.y0.nbytes))
    parts = [
        norm.over_nodes(
            node_distances(
                problem.quantity(norm.quantity, a[first : min(first + block, times)]),
                problem.quantity(norm.quantity, b[first : min(first + block, times)]),
            )
        )
        for first in range(0, times, block)
    ]
    return np.concatenate(parts) if parts else np.zeros(0)


def motion(problem: Problem, states: np.ndarray, norm: Norm | None = None) -> np.ndarray:
    """How far any node (or component) has got from where it started, up to each sample.

    This is the size against which an error is large or small; unlike the size of the state
    it does not change when the whole problem is moved. At least 1e-8 of the state's scale.

    Arguments:
        problem: whose motion it is.
        states: ``(times, *state)``.
        norm: by default the problem's first.
    """
    start = np.broadcast_to(problem.y0, states.shape)
    farthest = np.maximum.accumulate(distance(problem, norm or norm_for(problem), states, start))
    return np.maximum(farthest, 1e-8 * problem.scale)


def node_distances(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Euclidean distance of each node, ``(times, nodes)``.

    Arguments:
        a: one quantity, ``(times, nodes, dim)``.
        b: the same quantity of another trajectory.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        difference = np.abs(a - b)
        largest = np.max(difference, axis=2, keepdims=True)
        scaled = difference / np.where((largest > 0) & np.isfinite(largest), largest, 1.0)
        result = largest[..., 0] * np.sqrt(np.sum(scaled**2, axis=2))
    # What overflows becomes the largest float64, so that no sum or table breaks on it.
    return np.where(np.isfinite(result), result, np.finfo(np.float64).max)
