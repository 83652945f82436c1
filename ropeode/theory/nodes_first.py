"""The expansion of a rope's step with the nodes before their coordinates."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from ropeode.theory.expansion import Expansion, Term


def nodes_first(expansion: Expansion) -> Expansion:
    """An expansion whose states are ``(2, nodes, dim)``, however the problem stores them.

    It has what the diagnosis of a step looks at: states, rates, and steps from other such states.

    Arguments:
        expansion: of a step of one rope.
    """
    return cast(Expansion, _NodesFirst(expansion))


class _NodesFirst:
    def __init__(self, own: Expansion):
        self._own, mechanics = own, own.problem.mechanics
        assert mechanics is not None
        self._axis = mechanics.node_axis - 2
        self.problem, self.t, self.ladder = own.problem, own.t, own.ladder
        self.y, self.slopes = self._turned(own.y), self._turned(own.slopes)
        self.samples = SimpleNamespace(after=self._after)

    def rate(self, order: int) -> Term:
        term = self._own.rate(order)
        return term._replace(value=self._turned(term.value))

    def at_zero(self) -> tuple[np.ndarray, Term]:
        base, change = self._own.at_zero()
        return self._turned(base), change._replace(value=self._turned(change.value))

    def _after(self, t: np.ndarray, y: np.ndarray, dt: np.ndarray, steps: int) -> Any:
        stored = np.moveaxis(y, -2, self._axis)
        return self._turned(self._own.samples.after(t, stored, dt, steps))

    def _turned(self, states: np.ndarray) -> np.ndarray:
        return np.moveaxis(states, self._axis, -2)
