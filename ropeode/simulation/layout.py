"""How the members of an ensemble lie in memory while they are run.

The processor's vector units want long rows of numbers that are treated alike. So some members,
the lanes of a block, lie side by side: the first number of each, then the second of each, and so
on. A block is small enough to stay in the fastest cache while it is stepped. All blocks have as
many lanes, whoever is in them, so that a member's result does not depend on its neighbours.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import numpy as np

from ropeode.problems import Numbers, Problem
from ropeode.steppers import Stepper

# Numbers in the state of a block: 4 ropes of 16 nodes.
_BLOCK = 256
_MOST_LANES = 64
# A graphics processor runs all members of a chunk at once.
_LANES_OF_A_GPU = 16384


@dataclasses.dataclass(frozen=True)
class Layout:
    """Where the members of a family's blocks lie.

    Arguments:
        lanes: members of a block.
        nodes: how many nodes stand in turn, each with those of all lanes side by side (see
            `Links`); None where the lanes are the last axis.
    """

    lanes: int
    nodes: int | None

    @classmethod
    def of(cls, problem: Problem, stepper: Stepper) -> Layout:
        """The layout for problems like this one, on this machine's processor."""
        mechanics = problem.mechanics
        in_turn = mechanics is not None and mechanics.in_turn and stepper.any_layout
        nodes = problem.y0.shape[-1] if in_turn else None
        if jax.default_backend() != "cpu":
            return cls(_LANES_OF_A_GPU, nodes)
        lanes = 1 << (max(_BLOCK // problem.y0.size, 1).bit_length() - 1)
        return cls(min(lanes, _MOST_LANES), nodes)

    def blocks(self, members: int) -> int:
        """How many blocks so many members fill."""
        return -(-members // self.lanes)

    def fold(self, numbers: Numbers, blocks: int) -> tuple[np.ndarray, Any]:
        """Initial states and arguments of the members in blocks, which are the first axis.

        Lanes that nobody needs hold the last member once more.
        """
        return self._fold(numbers.y0, blocks), jax.tree.map(
            lambda leaf: self._fold(leaf, blocks), numbers.args
        )

    def _fold(self, leaf: np.ndarray, blocks: int) -> np.ndarray:
        if self.nodes is not None and leaf.ndim > 2 and leaf.shape[-2] == 1:
            # A vector that is the same for all nodes.
            leaf = np.repeat(leaf, self.nodes, axis=-2)
        spare = blocks * self.lanes - leaf.shape[-1]
        if spare:
            leaf = np.pad(leaf, [(0, 0)] * (leaf.ndim - 1) + [(0, spare)], mode="edge")
        leaf = np.moveaxis(leaf.reshape(*leaf.shape[:-1], blocks, self.lanes), -2, 0)
        if self.lanes == 1:
            return leaf[..., 0]
        if self.nodes is None:
            return leaf
        return leaf.reshape(*leaf.shape[:-2], -1)

    def unfold(self, states: np.ndarray, state: tuple[int, ...], members: int) -> np.ndarray:
        """States of the members, ``(frames, *state, members)``.

        Arguments:
            states: of the blocks, ``(blocks, frames, *state of a block)``.
            state: the shape of a member's state.
            members: how many there are.
        """
        blocks, frames = states.shape[:2]
        lanes = states.reshape(blocks, frames, *state, self.lanes)
        return np.moveaxis(lanes, 0, -2).reshape(frames, *state, blocks * self.lanes)[..., :members]
