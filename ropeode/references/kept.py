"""References of the library's problems that a command finds in its cache folder."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from typing import Any

import numpy as np

from ropeode import cache
from ropeode.cache import described
from ropeode.problems import Problem
from ropeode.references.files.contents import parsed
from ropeode.references.files.encoding import arrays_of, certificate_from, restored, texts_of
from ropeode.references.options import ReferenceOptions
from ropeode.references.reference import Reference


def kept_or_computed(
    problem: Problem, options: ReferenceOptions, compute: Callable[[], Reference]
) -> Reference:
    """The reference that an earlier command computed with the same software, or a new one.

    A new one is kept if all its runs got to the end, whether or not it is trusted so far: another
    may owe its horizon to a busy machine, on which the time limit ended a run.

    Arguments:
        problem: what is solved.
        options: of the reference.
        compute: computes it.
    """
    if not cache.is_used():
        return compute()
    return cache.kept(
        "reference",
        described((problem, options.model_dump())),
        compute,
        _contents,
        lambda contents: _read(contents, problem),
    )


def _was_in_time(reference: Reference) -> bool:
    """Whether no run ended early: bounds are infinite from where one did."""
    return all(np.isfinite(bound[-1]) for bound in reference.certificate.bounds.values())


def _read(contents: bytes, problem: Problem) -> Reference:
    with np.load(io.BytesIO(contents), allow_pickle=False) as file:
        numbers = dict(file)
    texts = json.loads(numbers.pop("texts").tobytes())
    description, claims = parsed(texts, numbers)
    certificate = certificate_from(description, claims, numbers)
    return restored(problem, description.samples, certificate, numbers)


def _contents(reference: Reference) -> bytes | None:
    if not _was_in_time(reference):
        return None
    file = io.BytesIO()
    numbers: dict[str, Any] = {name: each.values for name, each in arrays_of(reference).items()}
    numbers["texts"] = np.frombuffer(json.dumps(texts_of(reference)).encode(), np.uint8)
    np.savez(file, **numbers)
    return file.getvalue()
