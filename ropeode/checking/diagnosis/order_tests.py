"""On which ropes a stepper keeps its order."""

from __future__ import annotations

import dataclasses
from typing import Literal

from ropeode.checking.check_context import Examination
from ropeode.checking.convergence import convergence_finding
from ropeode.checking.report import Convergence
from ropeode.problems.problem import Problem

Outcome = Literal["kept", "low", "wrong", "unknown"]


def outcome(convergence: Convergence, expected: int) -> Outcome:
    """Whether an order is `kept`, too `low`, `wrong` (a wrong limit) or `unknown`.

    It is kept only if positions and velocities both have it.
    """
    orders = convergence.orders.values()
    if any(order.verdict == "does not converge" for order in orders):
        return "wrong"
    if any(off > allowed for off, allowed in convergence.limits.values()):
        return "wrong"
    if any(order.ci95 is None for order in orders):
        return "unknown"
    finding = convergence_finding("", dataclasses.replace(convergence, expected=expected))
    return "low" if finding.status == "fail" else "kept"


class OrderTests:
    """Tests of a stepper's order on ropes that differ in one respect."""

    def __init__(self, examination: Examination, expected: int):
        self.examination, self.expected = examination, expected
        self.orders: dict[str, dict[str, float | None]] = {}

    def on(self, problem: Problem | str) -> Outcome:
        """The outcome on a rope, or on one of `convergence_problems` by its name."""
        if isinstance(problem, str):
            convergence = self.examination.convergence(problem)
        else:
            convergence = self.examination.observed(problem)
        self.orders[convergence.problem] = {
            name: order.observed for name, order in convergence.orders.items()
        }
        return outcome(convergence, self.expected)
