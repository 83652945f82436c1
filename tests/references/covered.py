"""What every reference claims: its error never exceeds its bound."""

from __future__ import annotations

import numpy as np

from ropeode import Problem, Reference, reference
from ropeode.errors import ReferenceRefused
from ropeode.norms import distance
from ropeode.references import ReferenceOptions, Solution, largest_norms, reference_and_runs


def assert_covered(known: Reference, exact: np.ndarray) -> None:
    """The bounds of all quantities cover the true errors, and never fall in time.

    Arguments:
        known: a reference.
        exact: the solution, ``(times, *state)``, or a row for each time.
    """
    exact = np.reshape(exact, (len(exact), *known.problem.y0.shape)).astype(np.longdouble)
    for quantity, norm in largest_norms(known.problem).items():
        true = distance(known.problem, norm, known.states.astype(np.longdouble), exact)
        bound = known.certificate.bounds[quantity][: known.trusted]
        assert np.all(true[: known.trusted] <= bound)
        assert np.all(np.diff(bound) >= 0)


def covered(problem: Problem, exact: np.ndarray, **options) -> Reference | None:
    """The reference of a problem, if it has one; its bounds cover its errors.

    Arguments:
        problem: what to solve.
        exact: as for `assert_covered`.
        options: of `reference`.
    """
    try:
        known = reference(problem, **options)
    except ReferenceRefused:
        return None
    assert_covered(known, exact)
    return known


def reference_and(problem: Problem, role: str) -> tuple[Reference, list[Solution]]:
    """The reference of a problem, and its witnesses of a role, with their states."""
    known, runs = reference_and_runs(problem, ReferenceOptions())
    return known, [run for each, run in runs if each == role]
