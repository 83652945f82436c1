"""The labels of axes."""

from __future__ import annotations

from typing import Any

from ropeode.norms import NORMS
from ropeode.problems import ROPES, Problem, rope_of

_ROPE_UNITS = {
    "time": "frames",
    "position": "length units",
    "velocity": "length units / frame",
    "energy": "mass · length² / frame²",
}


def with_unit(text: str, problem: Problem, quantity: str) -> str:
    """A label with its unit; only ropes have units."""
    unit = unit_of(problem, quantity)
    return f"{text} [{unit}]" if unit else text


def unit_of(problem: Problem, quantity: str) -> str:
    """The unit of a quantity; empty where it has none."""
    return _ROPE_UNITS[quantity] if rope_of(problem) else ""


# By column of a sweep; its errors have the unit of their norm.
_COLUMN_UNITS = {
    "dt": "frames",
    "horizon": "frames",
    "largest_stable_dt": "frames",
    "settled_at": "frames",
    "diverged_at": "frames",
    "stiffness": "mass / frame²",
    "damping": "mass / frame",
    "node_mass": "mass",
}


def sweep_label(column: str, text: str, frame: Any) -> str:
    """The label of a column of a sweep, with its unit where all rows are ropes.

    Arguments:
        column: its name.
        text: the name in words.
        frame: the rows, a DataFrame.
    """
    if not set(frame["problem"]) <= set(ROPES):
        return text
    unit = _COLUMN_UNITS.get(column)
    norms = set(frame["norm"].dropna())
    if column.startswith("error_") and len(norms) == 1:
        unit = _ROPE_UNITS[NORMS[norms.pop()].quantity]
    return f"{text} [{unit}]" if unit else text
