"""How a problem of the library is drawn in a plane."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any, Literal

import numpy as np

PictureKind = Literal["rope", "pendulum", "orbit", "phase"]


@dataclasses.dataclass(frozen=True)
class Picture:
    """What is drawn of a problem that is not a rope.

    Arguments:
        kind: `rope`: masses on springs or links; `pendulum`: masses on rods; `orbit`: bodies that
            leave a trail; `phase`: one point, in a plane of two numbers of the state.
        points: ``points(times, states, args)`` gives ``(times, points, 2)`` of states
            ``(times, *state)``. Those that are not `fixed` are the nodes, in their order; of a
            phase plane there is one point.
        axes: names of the two axes.
        fixed: indices of the points that stand for what does not move: a pivot, a wall, a sun.
        chained: whether each point is joined to the next.
    """

    kind: PictureKind
    points: Callable[[np.ndarray, np.ndarray, Any], np.ndarray]
    axes: tuple[str, str] = ("x", "y")
    fixed: tuple[int, ...] = ()
    chained: bool = False


# By the problem's kind. Each file of a problem declares its own, where the general rule of
# `ropeode.laboratory.drawings` would not show what the problem is.
PICTURES: dict[str, Picture] = {}


def around(*centres: tuple[float, float]) -> Picture:
    """Bodies in a plane, around others that do not move.

    Arguments:
        centres: where these are.
    """

    def points(times: np.ndarray, states: np.ndarray, args: Any) -> np.ndarray:
        del times, args
        still = np.broadcast_to(np.array(centres), (len(states), len(centres), 2))
        return np.concatenate([still, states[:, 0]], axis=1)

    return Picture("orbit", points, fixed=tuple(range(len(centres))))


def plane(x: int, y: int, axes: tuple[str, str]) -> Picture:
    """The phase plane of two components of the state, counted from 0."""

    def points(times: np.ndarray, states: np.ndarray, args: Any) -> np.ndarray:
        del times, args
        return states.reshape(len(states), -1)[:, None, [x, y]]

    return Picture("phase", points, axes)


def logarithmic_plane(x: int, y: int, axes: tuple[str, str], least: float) -> Picture:
    """The same of the logarithms to the base of 10.

    Arguments:
        x: component on the horizontal axis.
        y: component on the vertical axis.
        axes: their names.
        least: what is smaller, as the negative concentrations of a bad run, is drawn there.
    """
    linear = plane(x, y, axes)

    def points(times: np.ndarray, states: np.ndarray, args: Any) -> np.ndarray:
        return np.log10(np.maximum(linear.points(times, states, args), least))

    return dataclasses.replace(linear, points=points)
