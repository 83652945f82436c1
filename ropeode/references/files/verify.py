"""A stored reference, computed again with today's solvers."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from ropeode.display import Tabular
from ropeode.norms import distance
from ropeode.problems import Problem
from ropeode.progress import Progress, bar, shows_progress
from ropeode.references.certificate import largest_norms
from ropeode.references.compute import solved_again
from ropeode.references.files.store import reference_from, stored_facts
from ropeode.references.options import TIME_LIMIT
from ropeode.references.reference import Reference


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Verification(Tabular):
    """A stored reference, compared with a new one.

    Arguments:
        path: of the file, whose checksum, structure and problem are right.
        digest: sha256 of the file.
        stored: the reference in it.
        recomputed: the new one.
        samples: how many were compared: those that both trust.
        of: how many the file trusts; more than `samples` where the new one ends before.
        distances: for each quantity, the largest distance over the samples.
        outside: the first sample time at which the distance exceeds the sum of the bounds, for
            each quantity that has one.

    Examples:
        >>> from ropeode import Rope, reference, save_reference, verify_reference
        >>> path = save_reference(reference(Rope(num_nodes=4).problem(frames=3)), "rope.nc")
        >>> found = verify_reference(path)
        >>> found.samples, found.of, found.agrees
        (4, 4, True)
    """

    path: Path
    digest: str
    stored: Reference
    recomputed: Reference
    samples: int
    of: int
    distances: dict[str, float]
    outside: dict[str, float]

    @property
    def agrees(self) -> bool:
        """Whether all distances lie within the bounds."""
        return not self.outside


@shows_progress
def verify_reference(
    path: str | Path,
    problem: Problem | None = None,
    *,
    time_limit: float = TIME_LIMIT,
    progress: Progress = bar,
) -> Verification:
    """Check a file, and compute its reference again.

    Arguments:
        path: of the file.
        problem: as for `load_reference`.
        time_limit: in seconds, for all runs together; samples that they do not reach are not
            compared.
        progress: as for `reference`.

    Raises:
        InputError: as for `load_reference`.
        ReferenceRefused: the problem has no reference with today's solvers.

    Examples:
        >>> from ropeode import Rope, reference, save_reference, verify_reference
        >>> path = save_reference(reference(Rope(num_nodes=4).problem(frames=3)), "rope.nc")
        >>> verify_reference(path)
        <Verification: rope.nc: agrees, 4 of 4 samples compared>
    """
    facts = stored_facts(path)
    stored = reference_from(facts, problem)
    recomputed = solved_again(stored, stored.problem.ts, time_limit, progress)
    samples = min(stored.trusted, recomputed.trusted)
    distances, outside = {}, {}
    for quantity, norm in largest_norms(stored.problem).items():
        both = (each.states[:samples] for each in (stored, recomputed))
        series = distance(stored.problem, norm, *both)
        too_far = series > stored.bound(norm)[:samples] + recomputed.bound(norm)[:samples]
        distances[quantity] = float(np.max(series))
        if np.any(too_far):
            outside[quantity] = float(stored.times[int(np.argmax(too_far))])
    return Verification(
        path=facts.path,
        digest=facts.digest,
        stored=stored,
        recomputed=recomputed,
        samples=samples,
        of=stored.trusted,
        distances=distances,
        outside=outside,
    )
