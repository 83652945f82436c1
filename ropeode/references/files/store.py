"""Saving references and loading them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ropeode.errors import InputError
from ropeode.files import check_writable, replacing
from ropeode.problems.library import PROBLEMS
from ropeode.problems.problem import Problem
from ropeode.references.certificate import Certificate
from ropeode.references.files import netcdf
from ropeode.references.files.checksum import check_seal, seal
from ropeode.references.files.encoding import (
    ROPE_ARRAYS,
    SCHEMA,
    arrays_of,
    certificate_from,
    dense_from,
    probed,
    states_from,
    words_of,
)
from ropeode.references.reference import Reference
from ropeode.validation import complaint, shown

# Two versions of a library may round a right-hand side differently, by a few units.
_SAME = 1e-11


def save_reference(reference: Reference, path: str | Path) -> Path:
    """Write a reference to a NetCDF4 file, whole or not at all.

    Arguments:
        reference: with its certificate.
        path: of the file; one that exists is replaced.

    Returns:
        The path.

    Raises:
        InputError: it cannot be written.
    """
    path = check_writable("out", path)
    arrays, words = arrays_of(reference), words_of(reference)
    with replacing(path) as part:
        netcdf.write(part, arrays, words)
        seal(part)
    return path


def load_reference(path: str | Path, problem: Problem | None = None) -> Reference:
    """Read a reference from a file, after its seal, structure and problem have been checked.

    Arguments:
        path: of the file.
        problem: that it is to be the reference of. Needed where the file's own was not made
            by the library; where it is given, the file is refused if its problem is another.

    Raises:
        InputError: the file is not as it was written, or is no reference, or of another
            problem; says what differs.
    """
    return reference_from(stored_facts(path), problem)


def reference_from(facts: Facts, problem: Problem | None = None) -> Reference:
    """The reference that a file says, after its problem has been checked.

    Arguments:
        facts: of the file.
        problem: as for `load_reference`.

    Raises:
        InputError: the reference is of another problem; says what differs.
    """
    if problem is None:
        problem = _own_problem(facts.path, facts.problem)
    _check_same(facts.path, problem, facts.problem, facts.numbers)
    return Reference(
        problem=problem,
        states=states_from(problem, int(facts.problem["samples"]), facts.numbers),
        certificate=facts.certificate,
        dense=dense_from(problem, facts.numbers),
    )


class Facts(NamedTuple):
    """What a file says, without its problem having been built.

    Fields:
        path: of the file.
        digest: sha256 of the file.
        problem: name, parameters, number of samples.
        certificate: of the reference.
        numbers: all arrays by name.
    """

    path: Path
    digest: str
    problem: Mapping[str, Any]
    certificate: Certificate
    numbers: Mapping[str, np.ndarray]


def stored_facts(path: str | Path) -> Facts:
    """Read what a file says, after its seal and its structure have been checked.

    Arguments:
        path: of the file.

    Raises:
        InputError: the file is not as it was written, or is no reference.
    """
    path = Path(path)
    digest = check_seal(path)
    arrays, texts = netcdf.read(path)
    if texts.get("schema") != SCHEMA:
        allowed = f"a file with the schema {SCHEMA!r}"
        raise InputError(complaint("reference", str(path), allowed, "use another version"))
    words = {name: json.loads(texts[name]) for name in ("problem", "certificate")}
    numbers = {name: array.values for name, array in arrays.items()}
    return Facts(path, digest, words["problem"], certificate_from(words, numbers), numbers)


def _own_problem(path: Path, described: Mapping[str, Any]) -> Problem:
    """The problem that the library makes from the stored parameters."""
    parameters = dict(described["parameters"])
    kind = parameters.pop("kind", None)
    if kind not in PROBLEMS:
        raise InputError(
            complaint(
                "problem",
                described["name"],
                f"the problem itself, since that of {str(path)!r} is not of the library",
                "give it, as in load_reference(path, problem) or --problem FILE.py:NAME",
            )
        )
    return PROBLEMS[kind](**parameters)


def _check_same(
    path: Path, problem: Problem, described: Mapping[str, Any], numbers: Mapping[str, np.ndarray]
) -> None:
    """Raises:
    InputError: the file is of another problem; names each difference.
    """
    mine, its = dict(problem.parameters), described["parameters"]
    names = ["kind"] if mine.get("kind") != its.get("kind") else sorted({*mine, *its})
    faults = [
        _difference(path, name, mine.get(name), its.get(name))
        for name in names
        if mine.get(name) != its.get(name)
    ]
    if list(problem.jump_times) != described["jump_times"]:
        given = list(problem.jump_times)
        faults.append(_difference(path, "jump_times", given, described["jump_times"]))
    own = {"time": problem.ts, "initial_state": problem.y0}
    own |= {
        name: np.asarray(getattr(problem.args, name))
        for name in ROPE_ARRAYS
        if name in numbers and hasattr(problem.args, name)
    }
    for name, values in own.items() if not faults else ():
        stored = numbers.get(name)
        if stored is None or stored.shape != values.shape or not np.array_equal(stored, values):
            faults.append(_difference(path, name, values.tolist(), np.asarray(stored).tolist()))
    if not faults:
        rates = probed(problem)[1]
        apart = np.abs(rates - numbers["probe_rate"])
        if rates.shape != numbers["probe_rate"].shape or np.any(
            apart > _SAME * np.max(np.abs(numbers["probe_rate"]))
        ):
            worst = int(np.argmax(np.max(apart, axis=0)))
            its_rate = float(numbers["probe_rate"][0, worst])
            what = f"right-hand side (entry {worst}, at a state to try it on)"
            faults.append(_difference(path, what, float(rates[0, worst]), its_rate))
    if faults:
        raise InputError(faults)


def _difference(path: Path, name: str, mine: Any, its: Any) -> str:
    return complaint(
        name,
        mine,
        f"{shown(its)}, which is what the reference in {str(path)!r} was made for",
        "use another file, or make a reference of this problem",
    )
