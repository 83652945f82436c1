"""The numbers in a file of samples, and the states that they stand for."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ropeode.problems import Problem

_AXES = ("x", "y", "z")


class Written(NamedTuple):
    """The samples in a file.

    Fields:
        path: of the file.
        dt: its step size, if the file says it.
        times: of the samples, ``(samples,)``.
        values: of all nodes, ``(samples, nodes, columns)``: coordinates, followed by velocities
            if the file has them.
        where: names the file and the place of a value in it, from the indices of its sample, node
            and column; without the last two, all nodes are meant.
    """

    path: Path
    dt: str | None
    times: np.ndarray
    values: np.ndarray
    where: Callable[..., str]


@dataclasses.dataclass(frozen=True)
class Layout:
    """The numbers of a sample.

    Arguments:
        nodes: their number; each component of a problem without nodes counts as one.
        axes: names of a node's coordinates.
        mechanical: whether there are velocities.
    """

    nodes: int
    axes: tuple[str, ...]
    mechanical: bool

    @classmethod
    def of(cls, problem: Problem) -> Layout:
        """The layout of a problem's samples."""
        _, nodes, dim = problem.quantity(problem.quantities[0], problem.y0[None]).shape
        axes = _AXES[:dim] if dim <= len(_AXES) else tuple(f"x{i}" for i in range(dim))
        return cls(nodes, axes, problem.mechanics is not None)

    @property
    def dim(self) -> int:
        """The number of a node's coordinates."""
        return len(self.axes)

    def columns(self, velocities: bool) -> tuple[str, ...]:
        """Names of a node's numbers, in order."""
        return self.axes + (tuple(f"v{axis}" for axis in self.axes) if velocities else ())

    @property
    def headers(self) -> tuple[str, ...]:
        """The headers that a CSV file may have."""
        both = (False, True) if self.mechanical else (False,)
        return tuple(",".join(("t", "node", *self.columns(velocities))) for velocities in both)


def samples_of(problem: Problem, states: np.ndarray) -> np.ndarray:
    """States as the numbers of a file, ``(samples, nodes, columns)``.

    Arguments:
        problem: whose states they are.
        states: ``(samples, *state)``.
    """
    return np.concatenate([problem.quantity(each, states) for each in problem.quantities], axis=2)


def states_of(problem: Problem, values: np.ndarray) -> np.ndarray:
    """The states ``(samples, *state)`` that the numbers of a file stand for.

    Velocities that the file lacks are zero, and must not be used.

    Arguments:
        problem: whose states they are.
        values: ``(samples, nodes, columns)``.
    """
    states = np.zeros((len(values), *problem.y0.shape))
    if problem.mechanics is None:
        return values.reshape(states.shape)
    half, dim = problem.y0.shape[1:], Layout.of(problem).dim
    for i in range(values.shape[2] // dim):
        part = values[:, :, i * dim : (i + 1) * dim]
        if len(half) == 2:
            part = np.moveaxis(part, 1, 1 + problem.mechanics.node_axis)
        states[:, i] = part.reshape(len(values), *half)
    return states
