"""Nodes that are updated one by one, from neighbours that have already moved."""

from __future__ import annotations

import numpy as np

from ropeode.checking.check_context import Examination
from ropeode.checking.check_ropes import renumbered, undamped
from ropeode.checking.diagnosis.diagnostic_ropes import alternate_nodes_pinned
from ropeode.checking.diagnosis.order_tests import OrderTests
from ropeode.checking.report import Diagnosis
from ropeode.problems.problem import Problem

_STEPS = (8, 32)
# What rounding leaves of zero, as a part of the rope's size.
_ROUNDING = 1e-10
# From dt to dt/4 a difference of order 1 shrinks by 4. A difference that does not even shrink by
# this comes from a wrong force, not from the order of updates.
_SHRINKS = 2.5


def diagnose_in_place_updates(
    examination: Examination, tests: OrderTests | None = None
) -> Diagnosis | None:
    """Test whether numbering the nodes from the other end changes runs, but not their limit.

    On a rope in which no two moving nodes are neighbours it must change nothing; and the order,
    where `tests` have shown it to be too low, must be kept there.
    """
    apart = alternate_nodes_pinned()
    coarse, fine = (_difference(examination, undamped(), steps) for steps in _STEPS)
    alone = max(_difference(examination, apart, steps) for steps in _STEPS)
    if not (fine > _ROUNDING and coarse > _SHRINKS * fine and alone <= _ROUNDING):
        return None
    evidence = {
        "steps_per_frame": list(_STEPS),
        "differences": [coarse, fine],
        "difference_without_neighbours": alone,
    }
    order = ""
    if tests is not None:
        if tests.on(apart) != "kept":
            return None
        evidence["orders"] = dict(tests.orders)
        order = f"; without such neighbours the order is {tests.expected}"
    return Diagnosis(
        "in-place",
        f"nodes are updated in place: numbering them from the other end changes the motion by "
        f"{coarse:.1e} of the rope's size, but only if neighbouring nodes move{order}. Compute "
        "all forces before the first node moves",
        evidence,
    )


def _difference(examination: Examination, problem: Problem, steps: int) -> float:
    """How much renumbering changes a run, as a part of the rope's size."""
    own = examination.run(problem, steps)
    other = examination.run(renumbered(problem), steps)[:, :, ::-1]
    difference = float(np.max(np.abs(own - other))) / problem.scale
    return difference if np.isfinite(difference) else np.inf
