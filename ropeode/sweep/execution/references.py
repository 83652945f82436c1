"""References of a sweep: computed once for each problem, and kept in the sweep's folder."""

from __future__ import annotations

import dataclasses
import hashlib
import io
import json
from collections.abc import Hashable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ropeode.errors import ReferenceRefused
from ropeode.files import make_folder, write_whole
from ropeode.problems.ensemble import Ensemble, family
from ropeode.problems.problem import Problem
from ropeode.references.certificate import Certificate
from ropeode.references.compute import each_reference
from ropeode.references.reference import Reference
from ropeode.references.solvers.solver import Solver
from ropeode.validation import in_one_line

FOLDER = "references"
_SCHEMA = "ropeode.sweep-reference/2"
_DIGEST_BYTES = 32
# What a file does not say of a certificate: durations differ from run to run, and the witnesses'
# numbers are not needed for rows.
_NOT_KEPT: Mapping[str, Any] = {
    "drift": {},
    "witnesses": (),
    "seconds": np.nan,
    "compile_seconds": np.nan,
}


def references_of(
    folder: Path, problems: Mapping[str, Problem], options: Mapping[str, Any], *, keep: bool
) -> dict[str, Reference | str]:
    """The references of problems up to their trust horizons: read, or computed side by side.

    Each is independent of the others. Processes that compute the same reference at the same time
    write the same file, each of them whole.

    Arguments:
        folder: of the sweep.
        problems: by key.
        options: of the references, as `ropeode.reference` takes them.
        keep: whether new references are written to the folder, each as soon as it is computed.

    Returns:
        By key the reference, or the reason why there is none.

    Raises:
        InputError: a file cannot be written.
    """
    references: dict[str, Reference | str] = {}
    families: dict[Hashable, list[str]] = {}
    for key, problem in problems.items():
        if (kept := _read(reference_path(folder, key), key, problem)) is not None:
            references[key] = kept
        else:
            families.setdefault(family(problem), []).append(key)
    for keys in families.values():
        outcomes = _computed([problems[key] for key in keys], options)
        for key, outcome in zip(keys, outcomes, strict=True):
            new = _trusted(outcome) if isinstance(outcome, Reference) else in_one_line(outcome)
            references[key] = new
            # Where a solver raised, the next attempt may succeed.
            if keep and isinstance(outcome, (Reference, ReferenceRefused)):
                path = reference_path(folder, key)
                make_folder(path.parent)
                write_whole(path, _packed(key, new, outcome))
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


def _packed(key: str, new: Reference | str, outcome: Reference | Exception) -> bytes:
    """The contents of a file: NumPy arrays, the rest as JSON, and the sha256 of both."""
    words: dict[str, Any] = {"schema": _SCHEMA, "key": key}
    arrays: dict[str, Any] = {}
    if isinstance(new, Reference) and isinstance(outcome, Reference):
        kept = {k: v for k, v in vars(new.certificate).items() if k not in _NOT_KEPT}
        arrays = {f"bound_{name}": series for name, series in kept.pop("bounds").items()}
        arrays["states"] = new.states
        words |= {
            "certificate": {**kept, "solver": str(new.certificate.solver)},
            # For readers of the file.
            "witnesses": [f"{w.role}: {w.solver}" for w in outcome.certificate.witnesses],
            "parameters": dict(outcome.problem.parameters),
        }
    else:
        words["refused"] = new
    file = io.BytesIO()
    np.savez(file, words=np.array(json.dumps(words, default=dict, sort_keys=True)), **arrays)
    return file.getvalue() + hashlib.sha256(file.getvalue()).digest()


def _read(path: Path, key: str, problem: Problem) -> Reference | str | None:
    """The contents of a file; None if there is no file, or it is damaged."""
    try:
        contents = path.read_bytes()
    except OSError:
        return None
    body, digest = contents[:-_DIGEST_BYTES], contents[-_DIGEST_BYTES:]
    if hashlib.sha256(body).digest() != digest:
        return None
    with np.load(io.BytesIO(body), allow_pickle=False) as arrays:
        words = json.loads(str(arrays["words"]))
        if (words["schema"], words["key"]) != (_SCHEMA, key):
            return None
        if "refused" in words:
            return words["refused"]
        bounds = {
            name.removeprefix("bound_"): arrays[name]
            for name in arrays.files
            if name.startswith("bound_")
        }
        kept = words["certificate"]
        kept["solver"] = Solver.parse(kept["solver"])
        certificate = Certificate(**kept, bounds=bounds, **_NOT_KEPT)
        return Reference(problem, arrays["states"], certificate)
