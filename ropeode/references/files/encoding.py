"""What a reference is as named arrays and words, and back."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ropeode.precision import in_float64
from ropeode.problems.problem import Problem
from ropeode.references.certificate import Certificate, Witness, padded
from ropeode.references.dense.polynomials import Dense
from ropeode.references.reference import Reference

SCHEMA = "ropeode.reference/1"
PROBES = 3
# What the fields of a rope's args are called in a file, and what runs along them.
ROPE_ARRAYS: dict[str, tuple[str, ...]] = {
    "mass": ("node",),
    "stiffness": ("spring",),
    "rest_length": ("spring",),
    "damping": ("node",),
}


class Array(NamedTuple):
    """A variable of a file.

    Fields:
        dims: names of its dimensions.
        values: of it.
        long_name: what it is.
        units: of it; "1" where it has none.
    """

    dims: tuple[str, ...]
    values: np.ndarray
    long_name: str
    units: str


def arrays_of(reference: Reference) -> dict[str, Array]:
    """All that is stored of a reference as numbers, by name."""
    problem, made = reference.problem, reference.certificate
    rope = _is_rope(problem)
    length, time = ("length", "frame") if rope else ("1", "1")
    units = {"position": length, "velocity": f"{length} {time}-1" if rope else "1", "state": "1"}
    found = {
        "time": Array(("time",), problem.ts, "sample times", time),
        "initial_state": Array(
            _state_dims(problem), problem.y0, "initial state as the solver has it", "1"
        ),
    }
    for quantity in problem.quantities:
        if problem.mechanics is None:
            dims, values = ("time", *_state_dims(problem)), reference.states
        else:
            dims = ("time", "node", "component")
            values = problem.quantity(quantity, reference.states)
        missing = np.full((len(problem.ts) - len(values), *values.shape[1:]), np.nan)
        found[quantity] = Array(dims, np.concatenate([values, missing]), quantity, units[quantity])
        for name, words, series in (
            ("bound", "estimated error bound of the worst node", made.bounds),
            ("drift", "distance from the constraints", made.drift),
        ):
            if quantity in series:
                whole = padded(series[quantity], problem)
                found[_name(name, quantity)] = Array(("time",), whole, words, units[quantity])
        found[_name("witness_difference", quantity)] = Array(
            ("witness", "time"),
            np.stack([witness.differences[quantity] for witness in made.witnesses]),
            "distance of each witness from the reference",
            units[quantity],
        )
    if rope:
        args = problem.args
        for name, dims in ROPE_ARRAYS.items():
            if hasattr(args, name):
                found[name] = Array(dims, np.asarray(getattr(args, name)), name, _rope_unit(name))
        found["gravity"] = Array(
            ("component",), np.asarray(args.gravity)[:, 0], "acceleration", "length frame-2"
        )
        pinned = (np.asarray(args.free) == 0).astype(np.int8)
        found["pinned"] = Array(("node",), pinned, "1 where a node does not move", "1")
    if reference.dense is not None:
        found |= _dense_arrays(problem, reference.dense, time, units)
    probes, rates = probed(problem)
    found["probe_state"] = Array(("probe", "entry"), probes, "states to try the equation on", "1")
    found["probe_rate"] = Array(("probe", "entry"), rates, "right-hand side at these states", "1")
    return found


def words_of(reference: Reference) -> dict[str, str]:
    """All that is stored of a reference as text, by name."""
    problem, made = reference.problem, reference.certificate
    certificate = {
        field.name: getattr(made, field.name)
        for field in dataclasses.fields(made)
        if field.name not in ("bounds", "drift", "witnesses")
    }
    certificate["versions"] = dict(made.versions)
    certificate["witnesses"] = [
        {
            field.name: _plain(getattr(witness, field.name))
            for field in dataclasses.fields(witness)
            if field.name != "differences"
        }
        for witness in made.witnesses
    ]
    described = {
        "name": problem.name,
        "parameters": dict(problem.parameters),
        "jump_times": list(problem.jump_times),
        "samples": len(reference.states),
        "quantities": list(problem.quantities),
        "constrained": sorted(made.drift),
    }
    return {
        "Conventions": "CF-1.11",
        "title": f"reference trajectory: {problem.name}",
        "schema": SCHEMA,
        "problem": json.dumps(described, sort_keys=True),
        "certificate": json.dumps(_plain(certificate), sort_keys=True),
    }


def certificate_from(words: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> Certificate:
    """The certificate that was stored.

    Arguments:
        words: the parsed texts `problem` and `certificate`.
        arrays: the stored numbers by name.
    """
    described, told = words["problem"], dict(words["certificate"])
    quantities, samples = described["quantities"], described["samples"]
    witnesses = told.pop("witnesses")
    differences = {q: arrays[_name("witness_difference", q)] for q in quantities}
    return Certificate(
        **told,
        bounds={q: arrays[_name("bound", q)] for q in quantities},
        drift={q: arrays[_name("drift", q)][:samples] for q in described["constrained"]},
        witnesses=tuple(
            Witness(**each, differences={q: differences[q][index] for q in quantities})
            for index, each in enumerate(witnesses)
        ),
    )


def states_from(problem: Problem, samples: int, arrays: Mapping[str, np.ndarray]) -> np.ndarray:
    """The states that were stored, ``(samples, *y0.shape)``."""
    return _joined(problem, {name: arrays[name][:samples] for name in problem.quantities})


def dense_from(problem: Problem, arrays: Mapping[str, np.ndarray]) -> Dense | None:
    """The dense output that was stored; None if there is none."""
    if "dense_time" not in arrays:
        return None
    times = arrays["dense_time"]
    values = {name: arrays[f"dense_{name}"] for name in problem.quantities}
    count = next(iter(values.values())).shape[1]
    rows = {name: each.reshape(-1, *each.shape[2:]) for name, each in values.items()}
    derivatives = _joined(problem, rows).reshape(len(times), count, *problem.y0.shape)
    bounds = {name: arrays[dense_name("bound", name)] for name in problem.quantities}
    return Dense(times, derivatives, bounds)


def _dense_arrays(
    problem: Problem, dense: Dense, time: str, units: Mapping[str, str]
) -> dict[str, Array]:
    found = {"dense_time": Array(("dense_time",), dense.times, "times of the nodes", time)}
    nodes, count = dense.derivatives.shape[:2]
    rows = dense.derivatives.reshape(-1, *problem.y0.shape)
    for quantity in problem.quantities:
        if problem.mechanics is None:
            dims, values = _state_dims(problem), rows
        else:
            dims, values = ("node", "component"), problem.quantity(quantity, rows)
        found[f"dense_{quantity}"] = Array(
            ("dense_time", "derivative", *dims),
            values.reshape(nodes, count, *values.shape[1:]),
            f"{quantity} and its derivatives by time",
            units[quantity],
        )
        found[dense_name("bound", quantity)] = Array(
            ("dense_time",),
            dense.bounds[quantity],
            "estimated error bound of the worst node at all times up to the node",
            units[quantity],
        )
    return found


def _joined(problem: Problem, values: Mapping[str, np.ndarray]) -> np.ndarray:
    """States in the solver's layout, of quantities as they are stored."""
    if problem.mechanics is None:
        return values["state"]
    halves = []
    for quantity in problem.quantities:
        half = values[quantity]
        if problem.y0[0].ndim == 2:
            half = np.moveaxis(half, 1, 1 + problem.mechanics.node_axis)
        halves.append(half.reshape(len(half), *problem.y0.shape[1:]))
    return np.ascontiguousarray(np.stack(halves, axis=1))


@in_float64
def probed(problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """A few states, and the right-hand side there: by this an equation is known again.

    Returns:
        States and rates, each ``(probes, entries)``.
    """
    draw = np.random.default_rng(4).normal(size=(PROBES, *problem.y0.shape))
    states = problem.y0 * (1.0 + 0.1 * draw) + 0.01 * problem.scale * draw
    # Not at the start: what depends on time may well vanish there.
    times = problem.ts[0] + (problem.ts[-1] - problem.ts[0]) * np.array([0.237, 0.519, 0.841])
    rates = [
        np.asarray(problem.rhs(t, y, problem.args)) for t, y in zip(times, states, strict=True)
    ]
    return states.reshape(PROBES, -1), np.stack(rates).reshape(PROBES, -1)


def _name(what: str, quantity: str) -> str:
    """`bound` is that of positions (or of the state); that of velocities says so."""
    return f"velocity_{what}" if quantity == "velocity" else what


def dense_name(what: str, quantity: str) -> str:
    """The same of dense output."""
    return f"dense_{_name(what, quantity)}"


def _state_dims(problem: Problem) -> tuple[str, ...]:
    return tuple(f"state_{axis}" for axis in range(problem.y0.ndim))


def _is_rope(problem: Problem) -> bool:
    return all(hasattr(problem.args, name) for name in ("rest_length", "gravity", "free", "mass"))


def _rope_unit(name: str) -> str:
    return {
        "mass": "mass",
        "stiffness": "mass frame-2",
        "rest_length": "length",
        "damping": "mass frame-1",
    }[name]


def _plain(value: Any) -> Any:
    """NumPy numbers as Python's; what is not finite as null."""
    if isinstance(value, dict):
        return {key: _plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(entry) for entry in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not np.isfinite(value) else value
