"""References of a sweep: computed once for each problem, and kept in the sweep's folder."""

from __future__ import annotations

import dataclasses
import io
import json
import math
from collections.abc import Hashable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ropeode.errors import InputError, ReferenceRefused
from ropeode.files import make_folder, write_whole
from ropeode.problems import Ensemble, Problem, family_of
from ropeode.references import (
    Certificate,
    Reference,
    Solver,
    each_reference,
    verify_checksum,
    with_checksum,
)
from ropeode.sweep.execution.parts import in_time
from ropeode.validation import in_one_line

FOLDER = "references"
_SCHEMA = "ropeode.sweep-reference/3"
# What a file does not say of a certificate: durations differ from run to run, and the witnesses'
# numbers are not needed for rows.
_NOT_KEPT: Mapping[str, Any] = {
    "drift": {},
    "witnesses": (),
    "sampling": None,
    "seconds": np.nan,
    "compile_seconds": np.nan,
}


def references_of(
    folder: Path,
    problems: Mapping[str, Problem],
    options: Mapping[str, Any],
    *,
    keep: bool,
    seconds: float = math.inf,
) -> dict[str, Reference | str]:
    """The references of problems up to their trust horizons: read, or computed side by side.

    Each is independent of the others. Processes that compute the same reference at the same time
    write the same file, each of them whole.

    Arguments:
        folder: of the sweep.
        problems: by key.
        options: of the references, as `ropeode.reference` takes them.
        keep: whether new references are written to the folder, as soon as they are computed.
        seconds: where computing them takes longer, some are left out; one of each family is not.

    Returns:
        By key the reference, or the reason why there is none.

    Raises:
        InputError: a file cannot be written.
    """
    references: dict[str, Reference | str] = {}
    families: dict[tuple[Hashable, ...], list[str]] = {}
    for key, problem in problems.items():
        if (kept := _read(reference_path(folder, key), key, problem)) is not None:
            references[key] = kept
        else:
            families.setdefault(family_of(problem), []).append(key)
    some_at_a_time = (
        some for alike, keys in families.items() for some in in_time(keys, alike[3:], seconds)
    )
    for keys in some_at_a_time:
        outcomes = _computed([problems[key] for key in keys], options)
        for key, outcome in zip(keys, outcomes, strict=True):
            new = _trusted(outcome) if isinstance(outcome, Reference) else in_one_line(outcome)
            references[key] = new
            # Where a solver raised, the next attempt may succeed.
            if keep and isinstance(outcome, (Reference, ReferenceRefused)):
                _write(reference_path(folder, key), key, new)
    return references


def _computed(
    problems: Sequence[Problem], options: Mapping[str, Any]
) -> Iterator[Reference | Exception]:
    """The reference of each problem of a family, or the exception in its place."""
    done = 0
    try:
        for outcome in each_reference(Ensemble.of(problems), **options):
            yield outcome
            done += 1
    except Exception as error:
        if len(problems) == 1:
            yield error
            return
        # One problem raised; the others are solved without it.
        for problem in problems[done:]:
            yield from _computed([problem], options)


def reference_path(folder: Path, key: str) -> Path:
    """The file of a problem's reference; one folder contains some thousand files at most."""
    return folder / FOLDER / key[:2] / f"{key}.npz"


def _trusted(reference: Reference) -> Reference:
    """A reference up to its trust horizon, as `_read` returns it."""
    certificate, trusted = reference.certificate, reference.trusted
    bounds = {name: series[:trusted] for name, series in certificate.bounds.items()}
    certificate = dataclasses.replace(certificate, bounds=bounds, **_NOT_KEPT)
    return Reference(reference.problem, reference.states[:trusted], certificate)


def _write(path: Path, key: str, reference: Reference | str) -> None:
    """Write a file: NumPy arrays, the rest as JSON, and a checksum of all."""
    words: dict[str, Any] = {"schema": _SCHEMA, "key": key}
    arrays: dict[str, Any] = {}
    if isinstance(reference, Reference):
        kept = {k: v for k, v in vars(reference.certificate).items() if k not in _NOT_KEPT}
        arrays = {f"bound_{name}": series for name, series in kept.pop("bounds").items()}
        arrays["states"] = reference.states
        words["certificate"] = {**kept, "solver": str(kept["solver"])}
        # For readers of the file.
        words["parameters"] = dict(reference.problem.parameters)
    else:
        words["refused"] = reference
    make_folder(path.parent)
    contents = io.BytesIO()
    np.savez(contents, words=np.array(json.dumps(words, default=dict)), **arrays)
    write_whole(path, with_checksum(contents.getvalue()))


def _read(path: Path, key: str, problem: Problem) -> Reference | str | None:
    """The contents of a file; None if there is no file, or it is damaged."""
    try:
        verify_checksum(path)
    except InputError:
        return None
    with np.load(path, allow_pickle=False) as arrays:
        words = json.loads(str(arrays["words"]))
        if (words["schema"], words["key"]) != (_SCHEMA, key):
            return None
        if "refused" in words:
            return words["refused"]
        kept = words["certificate"]
        kept["solver"] = Solver.parse(kept["solver"])
        kept["bounds"] = {
            name.removeprefix("bound_"): arrays[name]
            for name in arrays.files
            if name.startswith("bound_")
        }
        return Reference(problem, arrays["states"], Certificate(**kept, **_NOT_KEPT))
