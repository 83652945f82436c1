"""A stored reference, computed again with today's solvers."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ropeode.norms import distance
from ropeode.problems.problem import Problem
from ropeode.references.certificate import largest_norms
from ropeode.references.files.store import reference_from, stored_facts
from ropeode.references.reference import TIME_LIMIT, Reference, reference

# In so many pieces of a dense output a value is computed again.
_PIECES = 256


@dataclasses.dataclass(frozen=True, eq=False)
class Verification:
    """How a stored reference stands against a new one.

    With dense output the new one has samples between those of the file, too.

    Arguments:
        path: of the file, whose seal, structure and problem were found to be right.
        digest: sha256 of the file.
        stored: the reference in it.
        recomputed: the new one.
        samples: that both trust, and that were compared, those between included.
        of: so many that the file trusts; more than `samples` where the new one ends before.
        distances: for each quantity the largest distance over them.
        outside: the first sample time, for each quantity that has one, at which the two are
            further apart than their bounds together.
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
        """Whether all that was compared lies within the bounds."""
        return not self.outside


def verify_reference(
    path: str | Path,
    problem: Problem | None = None,
    *,
    time_limit: float = TIME_LIMIT,
    progress: Callable[[str], None] = lambda text: None,
) -> Verification:
    """Check a file, and compute its reference again.

    Arguments:
        path: of the file.
        problem: as for `load_reference`.
        time_limit: in seconds, for all runs in extended precision; what they do not reach is
            not compared.
        progress: as for `reference`.

    Raises:
        InputError: as `load_reference`.
        ReferenceRefused: today no reference can be had for the problem.
    """
    facts = stored_facts(path)
    stored = reference_from(facts, problem)
    made = stored.certificate
    times = _times_to_compare(stored)
    asked = dataclasses.replace(stored.problem, ts=times)
    again = reference(
        asked, made.accuracy, level=made.level, time_limit=time_limit, progress=progress
    )
    trusted = stored.times[: stored.trusted]
    wanted = int(np.sum(times <= trusted[-1]))
    times = times[: again.trusted][times[: again.trusted] <= trusted[-1]]
    samples = len(times)
    states = _stored_states(stored, times)
    distances, outside = {}, {}
    for quantity, norm in largest_norms(stored.problem).items():
        apart = distance(stored.problem, norm, states, again.states[:samples])
        bound = stored.bound(norm)[np.searchsorted(trusted, times)]
        if stored.dense is not None:
            covered = times <= stored.dense.end
            bound[covered] = stored.bound_at(times[covered], norm)
        allowed = bound + again.bound(norm)[:samples]
        distances[quantity] = float(np.max(apart))
        if np.any(apart > allowed):
            outside[quantity] = float(times[int(np.argmax(apart > allowed))])
    return Verification(
        path=facts.path,
        digest=facts.digest,
        stored=stored,
        recomputed=again,
        samples=samples,
        of=wanted,
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
