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
from ropeode.references.compute import reference
from ropeode.references.files.store import reference_from, stored_facts
from ropeode.references.options import SMALLEST_RTOL, TIME_LIMIT
from ropeode.references.reference import Reference

# The number of pieces of a dense output in which one value is computed again.
_PIECES = 256


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Verification(Tabular):
    """A stored reference, compared with a new one.

    With dense output the new one also has samples between those of the file.

    Arguments:
        path: of the file, whose checksum, structure and problem are right.
        digest: sha256 of the file.
        stored: the reference in it.
        recomputed: the new one.
        samples: how many were compared: those that both trust, those between included.
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
    times = _times_to_compare(stored)
    certificate = stored.certificate
    # One number is the default; at least it serves all components alike.
    atol = certificate.atol * (SMALLEST_RTOL / certificate.rtol)
    recomputed = reference(
        dataclasses.replace(stored.problem, ts=times),
        certificate.accuracy,
        atol=atol if np.ndim(atol) else None,
        level=certificate.level,
        time_limit=time_limit,
        progress=progress,
    )
    trusted = stored.times[: stored.trusted]
    of = int(np.sum(times <= trusted[-1]))
    times = times[: recomputed.trusted][times[: recomputed.trusted] <= trusted[-1]]
    samples = len(times)
    states = _stored_states(stored, times)
    distances, outside = {}, {}
    for quantity, norm in largest_norms(stored.problem).items():
        series = distance(stored.problem, norm, states, recomputed.states[:samples])
        bound = stored.bound(norm)[np.searchsorted(trusted, times)]
        if stored.dense is not None:
            covered = times <= stored.dense.end
            bound[covered] = stored.bound_at(times[covered], norm)
        too_far = series > bound + recomputed.bound(norm)[:samples]
        distances[quantity] = float(np.max(series))
        if np.any(too_far):
            outside[quantity] = float(times[int(np.argmax(too_far))])
    return Verification(
        path=facts.path,
        digest=facts.digest,
        stored=stored,
        recomputed=recomputed,
        samples=samples,
        of=of,
        distances=distances,
        outside=outside,
    )


def _times_to_compare(stored: Reference) -> np.ndarray:
    """The sample times, and with dense output one at random in each of some pieces."""
    if stored.dense is None:
        return stored.problem.ts
    nodes, random = stored.dense.times, np.random.default_rng(5)
    # Not between a jump time and the last number before it.
    pieces = np.flatnonzero(np.diff(nodes) > 1e-9 * (nodes[-1] - nodes[0]))
    pieces = random.permutation(pieces)[:_PIECES]
    between = nodes[pieces] + random.uniform(0.1, 0.9, len(pieces)) * np.diff(nodes)[pieces]
    return np.union1d(stored.problem.ts, between)


def _stored_states(stored: Reference, times: np.ndarray) -> np.ndarray:
    """What the file says at these times: its samples, and between them its dense output."""
    states = stored.states[np.minimum(np.searchsorted(stored.times, times), len(stored.states) - 1)]
    between = ~np.isin(times, stored.times)
    if np.any(between):
        states[between] = stored.at(times[between])
    return states
