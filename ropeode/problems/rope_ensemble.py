"""Ropes that differ in some of their numbers."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ropeode.errors import InputError
from ropeode.problems.ensemble import Ensemble
from ropeode.validation import bad_value, unknown

if TYPE_CHECKING:
    from ropeode.problems.rope_input import RopeInput

# Field of a rope, and the name of it in the arguments of its right-hand side.
_ARGUMENTS = {
    "node_mass": "mass",
    "stiffness": "stiffness",
    "damping": "damping",
    "gravity": "gravity",
}
_VELOCITY = "initial_velocity"


def rope_ensemble(rope: RopeInput, frames: int, arrays: Mapping[str, Any]) -> Ensemble:
    """The ropes that `RopeInput.ensemble` describes; raises as it does."""
    own = type(rope).model_fields
    allowed = [name for name in (*_ARGUMENTS, _VELOCITY) if name in own]
    if wrong := [unknown("field", name, allowed) for name in arrays if name not in allowed]:
        raise InputError(wrong)
    values = {name: _members(name, array) for name, array in arrays.items()}
    lengths = {name: len(array) for name, array in values.items()}
    if len(set(lengths.values())) != 1:
        allowed_lengths = "arrays with as many members each, at least one array"
        raise bad_value("ensemble", lengths, allowed_lengths, "for example damping=[0.0, 0.1]")

    _check(rope, values)
    problem = _member(rope, values, 0).problem(frames)
    size = len(next(iter(values.values())))
    args = {
        name: np.broadcast_to(leaf, (size, *leaf.shape))
        for name, leaf in problem.args._asdict().items()
    }
    for field, name in _ARGUMENTS.items():
        if field in values:
            array = values[field]
            array = array[..., None] if field == "gravity" or array.ndim == 1 else array
            args[name] = np.broadcast_to(array, args[name].shape)
    y0 = None
    if _VELOCITY in values:
        velocity = values[_VELOCITY]
        rows = velocity[:, :, None] if velocity.ndim == 2 else np.moveaxis(velocity, 1, 2)
        y0 = np.repeat(problem.y0[None], size, axis=0)
        y0[:, 1] = rows * rope.free()
    return Ensemble.varying(
        problem,
        y0=y0,
        args=type(problem.args)(**args),
        parameters=functools.partial(_parameters, rope, values, problem.parameters),
    )


def _member(rope: RopeInput, values: Mapping[str, np.ndarray], index: int) -> RopeInput:
    return _with(rope, {name: array[index] for name, array in values.items()})


def _parameters(
    rope: RopeInput, values: Mapping[str, np.ndarray], common: Mapping[str, Any], index: int
) -> Mapping[str, Any]:
    return {**common, **_member(rope, values, index).model_dump(mode="json")}


def _members(name: str, array: Any) -> np.ndarray:
    try:
        values = np.asarray(array, dtype=np.float64)
    except (TypeError, ValueError):
        values = np.asarray(np.nan)
    if values.ndim == 0 or not len(values) or not np.all(np.isfinite(values)):
        raise bad_value(
            name,
            array,
            "an array of finite numbers, one entry along its first axis for each rope",
            f"for example {name}=[...]; what all ropes share belongs to the rope itself",
        )
    return values


def _check(rope: RopeInput, values: Mapping[str, np.ndarray]) -> None:
    """Raises:
    InputError: one line for each field with a value that a rope refuses.
    """
    if _VELOCITY in values and "stiffness" not in type(rope).model_fields:
        # Only each rope itself shows whether velocities stretch a link.
        every = range(len(values[_VELOCITY]))
        tried = [{name: array[index] for name, array in values.items()} for index in every]
    else:
        # A field's smallest and largest values show whether one is not allowed.
        tried = [
            {name: pick(array, axis=0) for name, array in values.items()}
            for pick in (np.min, np.max)
        ]
    for each in tried:
        _with(rope, each)


def _with(rope: RopeInput, changed: Mapping[str, np.ndarray]) -> RopeInput:
    """The rope with other values."""
    return type(rope)(
        **{**rope.model_dump(), **{name: value.tolist() for name, value in changed.items()}}
    )
