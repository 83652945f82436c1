"""References of a sweep: made once for each problem, and kept in the sweep's folder."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Hashable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ropeode.errors import ReferenceRefused
from ropeode.files import make_folder, write_whole
from ropeode.problems.ensemble import Ensemble, family
from ropeode.problems.problem import Problem
from ropeode.references.compute import each_reference
from ropeode.references.reference import Reference
from ropeode.validation import in_one_line

FOLDER = "references"
_SCHEMA = "ropeode.sweep-reference/1"
_DIGEST_BYTES = 32


class Known(NamedTuple):
    """What a sweep needs of a reference: the part inside the trust horizon.

    Fields:
        states: at the trusted samples, ``(trusted, *state)``.
        bounds: the estimated error bound for each quantity, ``(trusted,)``.
        horizon: the first sample time outside; None if there is none.
        reason: why the horizon ends there.
    """

    states: np.ndarray
    bounds: Mapping[str, np.ndarray]
    horizon: float | None
    reason: str | None


class Refused(NamedTuple):
    """That no reference can be had, and why."""

    reason: str


def known_references(
    folder: Path, problems: Mapping[str, Problem], asked: Mapping[str, Any], *, keep: bool
) -> dict[str, Known | Refused]:
    """The references of problems, from the folder, or else made side by side and kept there.

    What becomes of each does not depend on the others. Processes that make the same one at the
    same time write the same file, each of them whole.

    Arguments:
        folder: of the sweep.
        problems: what to solve, by their keys.
        asked: of the references, as `ropeode.reference` takes it.
        keep: whether those that are made are to be kept, each as soon as it is there.

    Returns:
        By key.

    Raises:
        InputError: a file cannot be written.
    """
    found: dict[str, Known | Refused] = {}
    families: dict[Hashable, list[str]] = {}
    for key, problem in problems.items():
        if (known := _read(reference_path(folder, key), key)) is not None:
            found[key] = known
        else:
            families.setdefault(family(problem), []).append(key)
    for keys in families.values():
        made = _made([problems[key] for key in keys], asked)
        for key, outcome in zip(keys, made, strict=True):
            found[key] = _inside(outcome) if isinstance(outcome, Reference) else _refused(outcome)
            # What a solver stumbled over may be gone with the next try.
            if keep and isinstance(outcome, (Reference, ReferenceRefused)):
                path = reference_path(folder, key)
                make_folder(path.parent)
                told = _told(outcome) if isinstance(outcome, Reference) else {}
                write_whole(path, _packed(key, found[key], told))
    return found


def _made(problems: Sequence[Problem], asked: Mapping[str, Any]) -> Iterator[Reference | Exception]:
    """The reference of each problem of a family, or why there is none."""
    done = 0
    try:
        for outcome in each_reference(Ensemble.of(problems), **asked):
            yield outcome
            done += 1
    except Exception as error:
        if len(problems) == 1:
            yield error
            return
        # One of them it is; the others are not to suffer for it.
        for problem in problems[done:]:
            yield from _made([problem], asked)


def _refused(error: Exception) -> Refused:
    return Refused(in_one_line(error))


def reference_path(folder: Path, key: str) -> Path:
    """Where the reference of a problem is kept; at most some thousand files in a folder."""
    return folder / FOLDER / key[:2] / f"{key}.npz"


def _inside(made: Reference) -> Known:
    return Known(
        states=made.states[: made.trusted],
        bounds={name: series[: made.trusted] for name, series in made.certificate.bounds.items()},
        horizon=made.horizon,
        reason=made.certificate.horizon_reason,
    )


def _told(made: Reference) -> dict[str, Any]:
    """What else the certificate says, for whoever looks into the file."""
    certificate = made.certificate
    return {
        "level": certificate.level,
        "solver": str(certificate.solver),
        "rtol": certificate.rtol,
        "atol": certificate.atol,
        "accuracy": certificate.accuracy,
        "witnesses": [f"{each.role}: {each.solver}" for each in certificate.witnesses],
        "versions": dict(certificate.versions),
        "parameters": dict(made.problem.parameters),
    }


def _packed(key: str, found: Known | Refused, told: Mapping[str, Any]) -> bytes:
    """A file's contents: NumPy arrays with words in JSON, and the sha256 of them all."""
    words: dict[str, Any] = {"schema": _SCHEMA, "key": key, **told}
    arrays: dict[str, Any] = {}
    if isinstance(found, Refused):
        words["refused"] = found.reason
    else:
        words |= {"horizon": found.horizon, "reason": found.reason}
        arrays["states"] = found.states
        arrays |= {f"bound_{name}": series for name, series in found.bounds.items()}
    file = io.BytesIO()
    np.savez(file, words=np.array(json.dumps(words)), **arrays)
    return file.getvalue() + hashlib.sha256(file.getvalue()).digest()


def _read(path: Path, key: str) -> Known | Refused | None:
    """What a file says; None if there is none, or it is not as it was written."""
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
            return Refused(words["refused"])
        bounds = {
            name.removeprefix("bound_"): arrays[name]
            for name in arrays.files
            if name.startswith("bound_")
        }
        return Known(arrays["states"], bounds, words["horizon"], words["reason"])
