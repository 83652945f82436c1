"""Measurements of a moving rope, sample by sample and without units."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ropeode.errors import InputError
from ropeode.problems import Problem
from ropeode.simulation import Trajectory, step_size
from ropeode.validation import bad_value, complaint

# A rope whose centre of mass is this close to the vertical, in its lengths, is on no side.
_UPRIGHT = 1e-6


class RopeMeasures(NamedTuple):
    """A trajectory without units, sample by sample; not finite where its states are not.

    Fields:
        times: since the start, in T.
        speed: of the fastest node, in V.
        stretch: of each spring, in its rest lengths, ``(times, springs)``.
        aside: of the centre of mass from the vertical, in L.
        lost_at: the first frame that is missing, since its state was not finite; or None.
        sample_times: the sample times as they are.
    """

    times: np.ndarray
    speed: np.ndarray
    stretch: np.ndarray
    aside: np.ndarray
    lost_at: int | None
    sample_times: np.ndarray


def measured(trajectory: Trajectory) -> RopeMeasures:
    """Measure a rope.

    Arguments:
        trajectory: of a rope; it may have diverged.

    Raises:
        InputError: it is not that of a rope that can hang.
    """
    args = _rope_args(trajectory.problem)
    rest_length = np.asarray(args.rest_length)
    gravity = np.asarray(args.gravity)[:, 0]
    length, strength = np.sum(rest_length), np.linalg.norm(gravity)
    x, v = trajectory.positions, trajectory.velocities
    times = trajectory.times
    # A run that blows up may exceed what can be squared; it has diverged by then anyway.
    with np.errstate(over="ignore", invalid="ignore"):
        return RopeMeasures(
            times=(times - times[0]) * np.sqrt(strength / length),
            speed=np.max(_norm(v), axis=1) / np.sqrt(strength * length),
            stretch=_norm(np.diff(x, axis=1)) / rest_length - 1.0,
            aside=_aside(x, args, gravity / strength) / length,
            lost_at=trajectory.diverged_at,
            sample_times=times,
        )


def _rope_args(problem: Problem) -> Any:
    """The problem's args, if they are those of a rope that can hang.

    Raises:
        InputError: they are not.
    """
    problem.require_mechanics("trajectory")
    args = problem.args
    if not all(hasattr(args, name) for name in ("rest_length", "gravity", "free")):
        raise bad_value(
            "trajectory",
            problem.name,
            "a run of a rope (args with rest_length, gravity and free)",
            "build the problem with Rope(...).problem(frames)",
        )
    free, gravity = np.asarray(args.free) > 0, np.asarray(args.gravity)
    pins = np.flatnonzero(~free).tolist()
    needed = [
        (free.size > 1, "num_nodes", free.size, "a rope of 2 nodes or more", "add one"),
        (
            np.any(gravity),
            "gravity",
            gravity[:, 0].tolist(),
            "one that is not zero, since nothing hangs without it",
            "for example gravity = [0, -1]",
        ),
        (
            free.any() and not free.all(),
            "pinned",
            pins,
            "at least one node that is pinned and one that is not",
            "for example pinned = [0]",
        ),
    ]
    if faults := [complaint(*fault) for holds, *fault in needed if not holds]:
        raise InputError(faults)
    return args


def _norm(vectors: np.ndarray) -> np.ndarray:
    return np.sqrt(np.einsum("...i,...i->...", vectors, vectors))


def _aside(x: np.ndarray, args: Any, down: np.ndarray) -> np.ndarray:
    """The centre of mass of the free nodes, sideways from the vertical through the first pin."""
    free = np.asarray(args.free) > 0
    mass = np.asarray(getattr(args, "mass", np.ones(len(free))))[free]
    pin = x[:, np.flatnonzero(~free)[0]]
    across = np.einsum("tnd,n->td", x[:, free], mass / np.sum(mass)) - pin
    across = across - (across @ down)[:, None] * down
    size = _norm(across)
    off = np.flatnonzero((size > _UPRIGHT * np.sum(args.rest_length)) & np.isfinite(size))
    return across @ (across[off[0]] / size[off[0]]) if len(off) else np.zeros(len(x))


def lengthening(trajectory: Trajectory, samples: slice) -> np.ndarray:
    """The rate of change of each spring's length, in rest lengths per frame.

    Arguments:
        trajectory: of a rope.
        samples: at which; finite ones.
    """
    along = np.diff(trajectory.positions[samples], axis=1)
    apart = np.diff(trajectory.velocities[samples], axis=1)
    length = _norm(along)
    # A spring of length zero has no direction; all of its motion counts.
    rate = np.where(
        length > 0,
        np.einsum("...i,...i->...", along, apart) / np.where(length > 0, length, 1.0),
        _norm(apart),
    )
    frame = step_size(trajectory.problem, 1)
    return frame * rate / np.asarray(trajectory.problem.args.rest_length)
