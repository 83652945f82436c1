"""A stored reference, computed again with today's solvers."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ropeode.norms import distance
from ropeode.problems.problem import Problem
from ropeode.references.certificate import largest_norms
from ropeode.references.reference import Reference, reference
from ropeode.references.stored.store import reference_from, stored_facts


@dataclasses.dataclass(frozen=True, eq=False)
class Verification:
    """How a stored reference stands against a new one.

    Arguments:
        path: of the file, whose seal, structure and problem were found to be right.
        digest: sha256 of the file.
        stored: the reference in it.
        recomputed: the new one.
        samples: that both trust, and that were compared.
        distances: for each quantity the largest distance over them.
        outside: the first sample time, for each quantity that has one, at which the two are
            further apart than their bounds together.
    """

    path: Path
    digest: str
    stored: Reference
    recomputed: Reference
    samples: int
    distances: dict[str, float]
    outside: dict[str, float]

    @property
    def agrees(self) -> bool:
        """Whether all that was compared lies within the bounds."""
        return not self.outside


def verify_reference(
    path: str | Path,
    problem: Problem | None = None,
    *,
    progress: Callable[[str], None] = lambda text: None,
) -> Verification:
    """Check a file, and compute its reference again.

    Arguments:
        path: of the file.
        problem: as for `load_reference`.
        progress: as for `reference`.

    Raises:
        InputError: as `load_reference`.
        ReferenceRefused: today no reference can be had for the problem.
    """
    facts = stored_facts(path)
    stored = reference_from(facts, problem)
    made = stored.certificate
    again = reference(stored.problem, made.accuracy, level=made.level, progress=progress)
    samples = min(stored.trusted, again.trusted)
    distances, outside = {}, {}
    for quantity, norm in largest_norms(stored.problem).items():
        apart = distance(stored.problem, norm, stored.states[:samples], again.states[:samples])
        allowed = stored.bound(norm)[:samples] + again.bound(norm)[:samples]
        distances[quantity] = float(np.max(apart))
        if np.any(apart > allowed):
            outside[quantity] = float(stored.times[int(np.argmax(apart > allowed))])
    return Verification(
        path=facts.path,
        digest=facts.digest,
        stored=stored,
        recomputed=again,
        samples=samples,
        distances=distances,
        outside=outside,
    )
