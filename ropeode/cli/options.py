"""The options of `ropeode table`, which carry the names of the fields that they set."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import click


def _text(value: str) -> Any:
    return value


def _list(value: str) -> list[str]:
    return [part.strip() for part in value.split(",") if part.strip()]


def _one_or_list(value: str) -> Any:
    return _list(value) if "," in value else value


def _rows(value: str) -> Any:
    return [_list(row) for row in value.split(";")] if ";" in value else _list(value)


def _steppers(value: str) -> list[str]:
    """Split at commas, except at those between the options of one stepper."""
    found: list[str] = []
    for part in _list(value):
        if found and "=" in part and ":" not in part:
            found[-1] += f",{part}"
        else:
            found.append(part)
    return found


# Field of Rope: how its text is read, how it is written, what it means.
ROPE: dict[str, tuple[Callable[[str], Any], str, str]] = {
    "start": (_list, "X,Y[,Z]", "Position of the first node. [0,200]"),
    "end": (_list, "X,Y[,Z]", "Position of the last node. [-400,200]"),
    "num_nodes": (_text, "N", "Number of nodes. [16]"),
    "node_mass": (_one_or_list, "M[,M...]", "Mass: one number, or one per node. [1]"),
    "stiffness": (_one_or_list, "K[,K...]", "Stiffness: one number, or one per spring. [100]"),
    "pinned": (_list, "I[,I...]", "Nodes that do not move; '' for none. [0]"),
    "gravity": (_list, "X,Y[,Z]", "Acceleration of gravity. [0,-1]"),
    "damping": (_one_or_list, "D[,D...]", "Damping: one number, or one per node. [0.01]"),
    "initial_velocity": (
        _rows,
        "X,Y[;X,Y...]",
        "Velocity of all free nodes, or per node. [0,0]",
    ),
}

# Field of TableSpec: option name, how its text is read, how it is written, what it means.
TABLE: dict[str, tuple[str, Callable[[str], Any], str, str]] = {
    "problem": ("problem", _text, "NAME", "rope, another library problem, or FILE.py:NAME. [rope]"),
    "kind": ("kind", _text, "KIND", "rope (springs) or inextensible-rope (rigid links). [rope]"),
    "reference": (
        "reference",
        _text,
        "FILE",
        "A reference file, or a name in the stored library. It sets the problem too.",
    ),
    "frames": ("frames", _text, "N", "Number of frames to solve. [20]"),
    "steppers": (
        "steppers",
        _steppers,
        "S[,S...]",
        "Names (`ropeode steppers` lists them), FILE.py:NAME, diffrax:NAME, scipy:NAME.",
    ),
    "steps_per_frame": ("steps", _list, "N[,N...]", "Steps per frame. [16,32,...,16384]"),
    "norm": ("norm", _text, "NAME", "Measure of errors: position-max, position-rms, ..."),
    "accuracy": ("accuracy", _text, "E", "Largest error bound to trust. [1e-8 of the motion]"),
    "rtol": ("rtol", _text, "R", "Tolerance of the reference. [the tightest useful one]"),
    "level": (
        "level",
        _text,
        "LEVEL",
        "Of the reference: consensus or extended. [consensus]",
    ),
    "digits": ("digits", _text, "N", "Digits of an extended reference. [18]"),
    "time_limit": (
        "time-limit",
        _text,
        "S",
        "Seconds that an extended reference may take. [60]",
    ),
}


def table_options(function: Callable) -> Callable:
    """Add an option for each field of a table's spec and of the rope."""
    for field, (_, metavar, words) in reversed(ROPE.items()):
        name = f"--{field.replace('_', '-')}"
        function = click.option(name, f"rope_{field}", metavar=metavar, help=words)(function)
    for field, (option, _, metavar, words) in reversed(TABLE.items()):
        function = click.option(f"--{option}", field, metavar=metavar, help=words)(function)
    return function


def given_values(options: Mapping[str, str | None]) -> tuple[dict[str, Any], dict[str, Any]]:
    """What was typed, as values of a spec and of its rope; not yet checked.

    Arguments:
        options: from click, None where nothing was typed.
    """
    spec = {
        field: read(text)
        for field, (_, read, _, _) in TABLE.items()
        if (text := options[field]) is not None
    }
    rope = {
        field: read(text)
        for field, (read, _, _) in ROPE.items()
        if (text := options[f"rope_{field}"]) is not None
    }
    return spec, rope
