"""Saving references and loading them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ropeode.errors import InputError
from ropeode.files import check_suffix, write_whole
from ropeode.problems import PROBLEMS, NoEquations, Problem
from ropeode.references.certificate import Certificate
from ropeode.references.files.checksum import unusable, verify_checksum, with_checksum
from ropeode.references.files.contents import Description, parsed
from ropeode.references.files.encoding import (
    ROPE_ARRAYS,
    SCHEMA,
    arrays_of,
    certificate_from,
    probed,
    restored,
    texts_of,
)
from ropeode.references.reference import Reference
from ropeode.validation import bad_value, complaint, shown

# Parameters of the library's problems that say how large they are.
_SIZES = ("frames", "num_nodes", "num_masses")
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
        InputError: its name does not end in ``.nc``, or it cannot be written.

    Examples:
        >>> from ropeode import load, save_reference
        >>> str(save_reference(load("kepler"), "mine.nc"))
        'mine.nc'
    """
    path = check_reference_path(path)
    # Not above: HDF5 takes its time to load, and a command that writes no file does without.
    from ropeode.references.files import netcdf

    arrays, texts = arrays_of(reference), texts_of(reference)
    write_whole(path, with_checksum(netcdf.encoded(arrays, texts)))
    return path


def check_reference_path(path: str | Path) -> Path:
    """A path that a reference can be written to, checked before anything is computed.

    Raises:
        InputError: its name does not end in ``.nc``, or it cannot be written to.
    """
    then = "; then `ropeode reference export` writes text from it"
    return check_suffix("out", path, [".nc"], then)


def load_reference(path: str | Path, problem: Problem | None = None) -> Reference:
    """Read a reference from a file, and check its checksum, structure and problem.

    Arguments:
        path: of the file.
        problem: that the reference must solve; a file of another problem is refused. By default
            the library builds it. If it is not one of the library, all that the file holds is
            there without it: times, states, bounds, certificate; what computes with the
            equations, as steppers and further references do, says that it needs the problem.

    Raises:
        InputError: the file is not as it was written, or holds no reference, or one of another
            problem; says what differs.

    Examples:
        >>> from ropeode import load, load_reference, save_reference
        >>> path = save_reference(load("kepler"), "mine.nc")
        >>> load_reference(path)
        <Reference: Kepler, 90 frames; heyoka Taylor, 124 bits, estimated bound 1.1e-16,
        trusted to the end>
    """
    return reference_from(stored_facts(path), problem)


def reference_from(facts: Facts, problem: Problem | None = None) -> Reference:
    """The reference in a file; checks its problem, as `load_reference` does."""
    problem = problem or _of_the_library(facts)
    if problem is None:
        problem = _without_equations(facts)
    else:
        _check_same(facts.path, problem, facts.problem, facts.numbers)
    try:
        return restored(problem, facts.problem.samples, facts.certificate, facts.numbers)
    except ValueError as error:
        raise _not_a_reference(facts.path, error) from error


def _of_the_library(facts: Facts) -> Problem | None:
    """The problem that the file's parameters describe; None if the library has none of its kind."""
    parameters = dict(facts.problem.parameters)
    kind = parameters.pop("kind", None)
    if not isinstance(kind, str) or kind not in PROBLEMS:
        return None
    times, first = (facts.numbers[each] for each in ("time", facts.problem.quantities[0]))
    nodes = first.shape[1] if first.ndim > 1 else 1
    # Nothing is built that is larger than what is there.
    for name, size in zip(_SIZES, (len(times) - 1, nodes, nodes), strict=True):
        if parameters.get(name, size) != size:
            why = f"{name} of the problem: {size}, as in the arrays"
            raise _not_a_reference(facts.path, ValueError(why))
    try:
        return PROBLEMS[kind](**parameters)
    except InputError as error:
        raise InputError([f"{facts.path}: {line}" for line in error.problems]) from error


class Facts(NamedTuple):
    """The contents of a file; the problem is described, not built.

    Fields:
        path: of the file.
        digest: sha256 of the file.
        problem: name, parameters, number of samples.
        certificate: of the reference.
        numbers: all arrays by name.
    """

    path: Path
    digest: str
    problem: Description
    certificate: Certificate
    numbers: Mapping[str, np.ndarray]


def stored_facts(path: str | Path) -> Facts:
    """Read a file, and check its checksum and its structure.

    Raises:
        InputError: the file is not as it was written, or holds no reference.
    """
    from ropeode.references.files import netcdf

    path = Path(path)
    digest = verify_checksum(path)
    arrays, texts = netcdf.read(path)
    if texts.get("schema") != SCHEMA:
        allowed = f"a file with the schema {SCHEMA!r}"
        raise bad_value("reference", str(path), allowed, "use another version")
    numbers = {name: array.values for name, array in arrays.items()}
    try:
        problem, claims = parsed(texts, numbers)
    except ValueError as error:
        raise _not_a_reference(path, error) from error
    return Facts(path, digest, problem, certificate_from(problem, claims, numbers), numbers)


def _not_a_reference(path: Path, why: ValueError) -> InputError:
    return unusable(path, f"a file that holds a reference ({why})")


def _without_equations(facts: Facts) -> Problem:
    """What the file says of a problem that nobody can build from it."""
    description, numbers = facts.problem, facts.numbers
    missing = NoEquations(description.name, str(facts.path))
    return Problem.without_equations(
        missing,
        numbers["initial_state"],
        numbers["time"],
        _node_axis(description, numbers),
        name=description.name,
        parameters=description.parameters,
        jump_times=description.jump_times,
        structure=missing if description.tree else None,
    )


def _node_axis(description: Description, numbers: Mapping[str, np.ndarray]) -> int | None:
    """The axis of the initial state's positions that counts nodes; None if it has no positions."""
    if "position" not in numbers or description.node_axis is not None:
        return description.node_axis
    # Files of older releases do not say it. Files count nodes by the first axis, and begin with
    # the initial state.
    start = numbers["initial_state"]
    halves = np.stack([numbers[name][0] for name in description.quantities])
    return int(start.ndim == 3 and not np.array_equal(start, halves))


def _check_same(
    path: Path, problem: Problem, description: Description, numbers: Mapping[str, np.ndarray]
) -> None:
    """Raises:
    InputError: the file is of another problem; names each difference.
    """
    own, its = dict(problem.parameters), description.parameters
    names = ["kind"] if own.get("kind") != its.get("kind") else sorted({*own, *its})
    faults = [
        _difference(path, name, own.get(name), its.get(name))
        for name in names
        if own.get(name) != its.get(name)
    ]
    for name in ("jump_times", "quantities"):
        mine, theirs = (tuple(getattr(each, name)) for each in (problem, description))
        if mine != theirs:
            faults.append(_difference(path, name, mine, theirs))
    arrays = {"time": problem.ts, "initial_state": problem.y0}
    arrays |= {
        name: np.asarray(getattr(problem.args, name))
        for name in ROPE_ARRAYS
        if name in numbers and hasattr(problem.args, name)
    }
    for name, values in arrays.items() if not faults else ():
        stored = numbers.get(name)
        if stored is None or stored.shape != values.shape or not np.array_equal(stored, values):
            faults.append(_difference(path, name, values.tolist(), np.asarray(stored).tolist()))
    if not faults:
        rates = probed(problem)[1]
        its = numbers["probe_rate"]
        # Where one of them is not a number, the other must not be one either.
        room = _SAME * np.max(np.abs(rates), where=np.isfinite(rates), initial=0.0)
        differs = ~np.isclose(rates, its, rtol=0.0, atol=room, equal_nan=True)
        if differs.any():
            probe, entry = np.argwhere(differs)[0]
            name = f"right-hand side (entry {entry}, at a test state)"
            values = float(rates[probe, entry]), float(its[probe, entry])
            faults.append(_difference(path, name, *values))
    if faults:
        raise InputError(faults)


def _difference(path: Path, name: str, own: Any, its: Any) -> str:
    return complaint(
        name,
        own,
        f"{shown(its)}, which is that of the problem in {str(path)!r}",
        "use another file, or compute a reference of this problem",
    )
