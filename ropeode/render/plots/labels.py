"""The labels of axes."""

from __future__ import annotations

from ropeode.problems.library import ROPES
from ropeode.problems.problem import Problem

_ROPE_UNITS = {
    "time": "frames",
    "position": "length units",
    "velocity": "length units / frame",
    "energy": "mass · length² / frame²",
}


def with_unit(text: str, problem: Problem, quantity: str) -> str:
    """A label with its unit; only ropes have units."""
    if problem.parameters.get("kind") not in ROPES:
        return text
    return f"{text} [{_ROPE_UNITS[quantity]}]"
