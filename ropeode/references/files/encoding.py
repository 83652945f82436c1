"""A reference as named arrays and texts, and back."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ropeode.precision import in_float64
from ropeode.problems import Problem, compiled
from ropeode.references.certificate import Certificate, Witness, padded
from ropeode.references.files.contents import PROBES, Claims, Description, series_name
from ropeode.references.reference import Reference
from ropeode.references.solvers.solver import Solver

SCHEMA = "ropeode.reference/1"
# Fields of a rope's args that a file has, their dimensions, and their units.
ROPE_ARRAYS: dict[str, tuple[str, str]] = {
    "mass": ("node", "mass"),
    "stiffness": ("spring", "mass frame-2"),
    "rest_length": ("spring", "length"),
    "damping": ("node", "mass frame-1"),
}


class Array(NamedTuple):
    """A variable of a file.

    Fields:
        dims: names of its dimensions.
        values: its numbers.
        long_name: what it is.
        units: "1" where it has none.
    """

    dims: tuple[str, ...]
    values: np.ndarray
    long_name: str
    units: str


def arrays_of(reference: Reference) -> dict[str, Array]:
    """The arrays that a file of a reference holds, by name."""
    problem, certificate = reference.problem, reference.certificate
    rope = _is_rope(problem)
    length, time = ("length", "frame") if rope else ("1", "1")
    units = {"position": length, "velocity": f"{length} {time}-1" if rope else "1", "state": "1"}
    arrays = {
        "time": Array(("time",), problem.ts, "sample times", time),
        "initial_state": Array(
            _state_dims(problem), problem.y0, "initial state as the solver has it", "1"
        ),
    }
    for quantity in problem.quantities:
        dims, values = _in_file(problem, quantity, reference.states)
        missing = np.full((len(problem.ts) - len(values), *values.shape[1:]), np.nan)
        whole = np.concatenate([values, missing])
        arrays[quantity] = Array(("time", *dims), whole, quantity, units[quantity])
        for name, long_name, series in (
            ("bound", "estimated error bound of the worst node", certificate.bounds),
            ("drift", "distance from the constraints", certificate.drift),
        ):
            if quantity in series:
                whole = padded(series[quantity], problem)
                arrays[series_name(name, quantity)] = Array(
                    ("time",), whole, long_name, units[quantity]
                )
        arrays[series_name("witness_difference", quantity)] = Array(
            ("witness", "time"),
            np.stack([witness.differences[quantity] for witness in certificate.witnesses]),
            "distance of each witness from the reference",
            units[quantity],
        )
    if rope:
        args = problem.args
        for name, (dim, unit) in ROPE_ARRAYS.items():
            if hasattr(args, name):
                arrays[name] = Array((dim,), np.asarray(getattr(args, name)), name, unit)
        arrays["gravity"] = Array(
            ("component",), np.asarray(args.gravity)[:, 0], "acceleration", "length frame-2"
        )
        pinned = (np.asarray(args.free) == 0).astype(np.int8)
        arrays["pinned"] = Array(("node",), pinned, "1 where a node does not move", "1")
    probes, rates = probed(problem)
    arrays["probe_state"] = Array(("probe", "entry"), probes, "states to try the equation on", "1")
    arrays["probe_rate"] = Array(("probe", "entry"), rates, "right-hand side at these states", "1")
    return arrays


def texts_of(reference: Reference) -> dict[str, str]:
    """The texts that a file of a reference holds, by name."""
    problem, certificate = reference.problem, reference.certificate
    claims = _fields(certificate, without=("bounds", "drift"))
    claims["versions"] = dict(certificate.versions)
    if certificate.sampling is not None:
        claims["sampling"] = dataclasses.asdict(certificate.sampling)
    claims["witnesses"] = [
        _fields(each, without=("differences",)) for each in certificate.witnesses
    ]
    description = {
        "name": problem.name,
        "parameters": dict(problem.parameters),
        "jump_times": list(problem.jump_times),
        "samples": len(reference.states),
        "quantities": list(problem.quantities),
        "constrained": sorted(certificate.drift),
        "node_axis": None if problem.mechanics is None else problem.mechanics.node_axis,
        "tree": None if problem.structure is None else str(problem.structure),
    }
    return {
        "Conventions": "CF-1.11",
        "title": f"reference trajectory: {problem.name}",
        "schema": SCHEMA,
        "problem": json.dumps(description, sort_keys=True),
        "certificate": json.dumps(_plain(claims), sort_keys=True),
    }


def certificate_from(
    problem: Description, claims: Claims, arrays: Mapping[str, np.ndarray]
) -> Certificate:
    """The certificate in a file, from its texts `problem` and `certificate`."""
    series = {
        name: {q: arrays[series_name(name, q)] for q in quantities}
        for name, quantities in (
            ("bound", problem.quantities),
            ("witness_difference", problem.quantities),
            ("drift", problem.constrained),
        )
    }
    witnesses = [
        Witness(
            **dict(each)
            | {
                "solver": Solver.parse(each.solver),
                "difference": np.inf if each.difference is None else each.difference,
                "differences": {q: s[index] for q, s in series["witness_difference"].items()},
            }
        )
        for index, each in enumerate(claims.witnesses)
    ]
    return Certificate(
        **dict(claims)
        | {
            "solver": Solver.parse(claims.solver),
            "atol": np.asarray(claims.atol)[()],
            "bounds": series["bound"],
            "drift": {q: s[: problem.samples] for q, s in series["drift"].items()},
            "witnesses": tuple(witnesses),
        }
    )


def restored(
    problem: Problem, samples: int, certificate: Certificate, arrays: Mapping[str, np.ndarray]
) -> Reference:
    """The reference in a file.

    Arguments:
        problem: that it solves.
        samples: how many of its states are known.
        certificate: as `certificate_from` has it.
        arrays: of the file.

    Raises:
        ValueError: nodes and components are not those of the problem.
    """
    known = {name: arrays[name][:samples] for name in problem.quantities}
    return Reference(problem, _joined(problem, known), certificate)


def _in_file(
    problem: Problem, quantity: str, states: np.ndarray
) -> tuple[tuple[str, ...], np.ndarray]:
    """A quantity of states in a file's layout: the names of its dimensions, and its values."""
    if problem.mechanics is None:
        return _state_dims(problem), states
    return ("node", "component"), problem.quantity(quantity, states)


def _joined(problem: Problem, values: Mapping[str, np.ndarray]) -> np.ndarray:
    """States in the solver's layout, from quantities in a file's layout.

    Raises:
        ValueError: nodes and components are not those of the problem.
    """
    if problem.mechanics is None:
        return values["state"]
    halves = []
    for quantity in problem.quantities:
        half = values[quantity]
        if problem.y0[0].ndim == 2:
            half = np.moveaxis(half, 1, 1 + problem.mechanics.node_axis)
            if half.shape[1:] != problem.y0.shape[1:]:
                raise ValueError(f"{quantity}: nodes and components of the shape {half.shape[1:]}")
        halves.append(half.reshape(len(half), *problem.y0.shape[1:]))
    return np.ascontiguousarray(np.stack(halves, axis=1))


@in_float64
def probed(problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """A few states, and the right-hand side there, by which a file recognises an equation.

    Returns:
        States and rates, each ``(probes, entries)``.
    """
    draw = np.random.default_rng(4).normal(size=(PROBES, *problem.y0.shape))
    states = problem.y0 * (1.0 + 0.1 * draw) + 0.01 * problem.scale * draw
    # Not at the start, where terms that depend on time may well vanish.
    times = problem.ts[0] + (problem.ts[-1] - problem.ts[0]) * np.array([0.237, 0.519, 0.841])
    rhs = compiled(problem.rhs)
    rates = [np.asarray(rhs(t, y, problem.args)) for t, y in zip(times, states, strict=True)]
    return states.reshape(PROBES, -1), np.stack(rates).reshape(PROBES, -1)


def _state_dims(problem: Problem) -> tuple[str, ...]:
    return tuple(f"state_{axis}" for axis in range(problem.y0.ndim))


def _is_rope(problem: Problem) -> bool:
    """Whether the arguments are those of the library's ropes, whose gravity is a column."""
    named = all(hasattr(problem.args, name) for name in ("rest_length", "gravity", "free", "mass"))
    return named and np.ndim(problem.args.gravity) == 2


def _fields(value: Certificate | Witness, without: tuple[str, ...]) -> dict[str, Any]:
    names = [field.name for field in dataclasses.fields(value)]
    return {name: getattr(value, name) for name in names if name not in without}


def _plain(value: Any) -> Any:
    """A value that JSON can hold; a number that is not finite is None, which JSON calls null."""
    if isinstance(value, dict):
        return {key: _plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(entry) for entry in value]
    if isinstance(value, Solver):
        return str(value)
    if isinstance(value, (np.generic, np.ndarray)):
        value = value.tolist()
    return None if isinstance(value, float) and not np.isfinite(value) else value
