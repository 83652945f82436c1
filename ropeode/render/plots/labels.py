"""The text of titles and axes."""

from __future__ import annotations

from typing import Any, cast

from ropeode.problems.problem import Problem
from ropeode.references.reference import Reference
from ropeode.render import table_words

_ROPES = ("rope", "inextensible-rope")
_ROPE_UNITS = {
    "time": "frames",
    "position": "length units",
    "velocity": "length units / frame",
    "energy": "mass · length² / frame²",
}


def problem_words(result: Any) -> str:
    """The problem in a few words.

    Arguments:
        result: a table, curves or paths; of these the words need the `problem` alone.
    """
    return table_words.problem_words(cast(Any, result))


def with_unit(text: str, problem: Problem, quantity: str) -> str:
    """A label with its unit; only ropes have units."""
    if problem.parameters.get("kind") not in _ROPES:
        return text
    return f"{text} [{_ROPE_UNITS[quantity]}]"


def horizon_words(reference: Reference) -> str:
    """Where the trust in a reference ends, and why; only for one that has a horizon."""
    return f"trusted before t = {reference.horizon:g}:\n{reference.certificate.horizon_reason}"
