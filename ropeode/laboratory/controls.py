"""The parameters of problems as their controls show them."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from typing import Any

from ropeode.laboratory.limits import MOST_NODES
from ropeode.laboratory.messages import ParameterFacts
from ropeode.problems import PROBLEMS, ROPES, Problem
from ropeode.render import argument_words

# How far a slider goes to both sides of a default above zero, and of zero.
_FACTOR, _AROUND_ZERO = 100.0, 1.0
_UNITS = {
    "node_mass": "mass",
    "stiffness": "mass/frame²",
    "damping": "mass/frame",
    "gravity": "length/frame²",
    "start": "length",
    "end": "length",
    "initial_velocity": "length/frame",
    "angle": "rad",
    "angles": "rad",
    "velocities": "rad/frame",
    "periods": "periods",
}
# Ends of sliders that the rule of `_slider` would set where nothing is to be seen.
_ENDS = {
    "num_nodes": (2, 64),
    "num_masses": (1, 64),
    "damping": (0.0, 0.2),
    "eccentricity": (0.0, 0.9),
    "angle": (-3.14, 3.14),
}


def parameters_of(problem: Problem) -> tuple[ParameterFacts, ...]:
    """The parameters of a problem of the library but its number of frames, with its own values.

    Arguments:
        problem: made with all its defaults.
    """
    return tuple(_facts(problem))


def _facts(problem: Problem) -> Iterator[ParameterFacts]:
    kind = problem.parameters["kind"]
    words, allowed = argument_words(ROPES.get(kind, PROBLEMS[kind])), _allowed(kind)
    for name, value in problem.parameters.items():
        if name in ("kind", "frames"):
            continue
        whole = isinstance(value, int)
        low, high, logarithmic = _slider(name, value, "> 0" in allowed[name])
        yield ParameterFacts(
            name=name,
            default=value,
            allowed=allowed[name],
            whole=whole,
            low=low,
            high=high,
            logarithmic=logarithmic,
            unit=_UNITS.get(name, ""),
            words=words.get(name, name.replace("_", " ")),
        )


def _slider(name: str, value: Any, positive: bool) -> tuple[float | None, float | None, bool]:
    """Its ends, and whether it moves in powers of ten; without ends for what is no number."""
    if name in _ENDS:
        return *_ENDS[name], False
    if not isinstance(value, (int, float)):
        return None, None, False
    if isinstance(value, int):
        return 1, min(MOST_NODES, 4 * value), False
    if positive:
        return value / _FACTOR, value * _FACTOR, True
    if value == 0:
        return -_AROUND_ZERO, _AROUND_ZERO, False
    return min(0.0, 2.0 * value), max(0.0, 2.0 * value), False


def _allowed(kind: str) -> dict[str, str]:
    """What is allowed for each parameter, in words."""
    if kind in ROPES:
        fields = ROPES[kind].model_fields
        extra = {name: each.json_schema_extra for name, each in fields.items()}
        return {n: str(e["allowed"]) for n, e in extra.items() if isinstance(e, dict)}
    hints = inspect.get_annotations(inspect.unwrap(PROBLEMS[kind]), eval_str=True)
    return {n: each.__metadata__[-1] for n, each in hints.items() if hasattr(each, "__metadata__")}
