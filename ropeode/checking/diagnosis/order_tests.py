"""Which orders a stepper keeps on ropes that differ by one thing."""

from __future__ import annotations

import dataclasses
from typing import Literal

from ropeode.checking.check_context import Examination
from ropeode.checking.convergence import convergence_finding
from ropeode.checking.report import Convergence
from ropeode.problems.problem import Problem

Outcome = Literal["kept", "low", "wrong", "unknown"]


def outcome(found: Convergence, expected: int) -> Outcome:
    """What came of the order: `kept`, `low`, `wrong` (another limit), or `unknown`.

    Positions and velocities both have to keep it.

    Arguments:
        found: on one rope.
        expected: the order.
    """
    orders = found.orders.values()
    if any(order.verdict == "does not converge" for order in orders):
        return "wrong"
    if any(off > allowed for off, allowed in found.limits.values()):
        return "wrong"
    if any(order.ci95 is None for order in orders):
        return "unknown"
    judged = convergence_finding("", dataclasses.replace(found, expected=expected))
    return "low" if judged.status == "fail" else "kept"


class Experiments:
    """Orders on ropes, each found once.

    Arguments:
        examination: of the stepper.
        expected: the order that it should have.
    """

    def __init__(self, examination: Examination, expected: int):
        self.examination, self.expected = examination, expected
        self.orders: dict[str, dict[str, float | None]] = {}

    def on(self, problem: Problem | str) -> Outcome:
        """What comes of the order on a rope, or on one of `convergence_problems`."""
        if isinstance(problem, str):
            found = self.examination.convergence(problem)
        else:
            found = self.examination.observed(problem)
        self.orders[found.problem] = {name: order.observed for name, order in found.orders.items()}
        return outcome(found, self.expected)
