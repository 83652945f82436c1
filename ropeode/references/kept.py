"""References of the library's problems that a command finds in its cache folder."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Callable
from importlib import metadata, util
from pathlib import Path
from typing import Any

import numpy as np

from ropeode.problems.library import PROBLEMS
from ropeode.problems.problem import Problem
from ropeode.references import cache_folder
from ropeode.references.certificate import versions
from ropeode.references.files.encoding import arrays_of, certificate_from, texts_of
from ropeode.references.files.store import Facts, reference_from
from ropeode.references.options import ReferenceOptions
from ropeode.references.reference import Reference

# All that computes a reference. Of other problems than the library's, nobody knows what they read.
_PACKAGES = ("jax", "jaxlib", "diffrax", "equinox", "lineax", "optimistix", "numpy", "scipy")
_SOURCES = ("*.py", "problems/**/*.py", "references/**/*.py")


def kept_or_computed(
    problem: Problem, options: ReferenceOptions, compute: Callable[[], Reference]
) -> Reference:
    """The reference that an earlier command computed with the same software, or a new one.

    A new one is kept if it is trusted to the end: another may owe its horizon to a busy machine.

    Arguments:
        problem: what is solved.
        options: of the reference.
        compute: computes it.
    """
    if not cache_folder.is_used() or problem.parameters.get("kind") not in PROBLEMS:
        return compute()
    name = f"references/{_key(problem, options)}.npz"
    found = _read(name, problem)
    if found is not None:
        return found
    reference = compute()
    if reference.horizon is None:
        _write(name, reference)
    return reference


def _key(problem: Problem, options: ReferenceOptions) -> str:
    """A hash of all that a reference depends on."""
    package = Path(__file__).parents[1]
    whole = hashlib.sha256()
    described = [dict(problem.parameters), options.model_dump(), dict(versions(*_PACKAGES))]
    whole.update(json.dumps([*described, _heyoka()], sort_keys=True).encode())
    for array in (problem.ts, problem.y0):
        whole.update(array.tobytes())
    for path in sorted(path for pattern in _SOURCES for path in package.glob(pattern)):
        whole.update(path.read_bytes())
    return whole.hexdigest()


def _heyoka() -> str:
    return metadata.version("heyoka") if util.find_spec("heyoka") else "not installed"


def _read(name: str, problem: Problem) -> Reference | None:
    contents = cache_folder.read(name)
    if contents is None:
        return None
    try:
        with np.load(io.BytesIO(contents), allow_pickle=False) as file:
            numbers = dict(file)
        texts = json.loads(numbers.pop("texts").tobytes())
        described, claims = (json.loads(texts[name]) for name in ("problem", "certificate"))
        certificate = certificate_from(described, claims, numbers)
        digest = hashlib.sha256(contents).hexdigest()
        return reference_from(Facts(Path(name), digest, described, certificate, numbers), problem)
    except (ValueError, KeyError):
        # Of another problem (one that was changed after the library made it), or none of ours.
        return None


def _write(name: str, reference: Reference) -> None:
    file = io.BytesIO()
    numbers: dict[str, Any] = {name: each.values for name, each in arrays_of(reference).items()}
    numbers["texts"] = np.frombuffer(json.dumps(texts_of(reference)).encode(), np.uint8)
    np.savez(file, **numbers)
    cache_folder.write(name, file.getvalue())
