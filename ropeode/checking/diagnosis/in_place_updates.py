"""Nodes that are updated one by one, with what their neighbours have moved to already."""

from __future__ import annotations

import numpy as np

from ropeode.checking.candidate import Candidate
from ropeode.checking.check_context import Examination
from ropeode.checking.diagnosis.diagnostic_ropes import apart, renumbered
from ropeode.checking.diagnosis.order_tests import Experiments
from ropeode.checking.problems import undamped
from ropeode.checking.report import Diagnosis
from ropeode.problems.problem import Problem

_STEPS = (8, 32)
# Of the rope's size: what rounding leaves of zero.
_ROUNDING = 1e-10
# From dt to dt/4 a difference of order 1 shrinks by 4; what does not shrink by this is another
# force, and no way of making steps.
_SHRINKS = 2.5


def in_place(examination: Examination, experiments: Experiments | None = None) -> Diagnosis | None:
    """Say so if a rope counted from its other end moves otherwise, but in the limit the same.

    It must not matter where no two nodes that move are neighbours.

    Arguments:
        examination: of the stepper.
        experiments: on its order, if that is too low; it must then be kept there.
    """
    candidate = examination.candidate
    coarse, fine = (_difference(candidate, undamped(), steps) for steps in _STEPS)
    alone = max(_difference(candidate, apart(), steps) for steps in _STEPS)
    if not (fine > _ROUNDING and coarse > _SHRINKS * fine and alone <= _ROUNDING):
        return None
    evidence = {
        "steps_per_frame": list(_STEPS),
        "differences": [coarse, fine],
        "difference_without_neighbours": alone,
    }
    if experiments is not None:
        if experiments.on(apart()) != "kept":
            return None
        evidence["orders"] = dict(experiments.orders)
    order = f", and there the order is {experiments.expected}" if experiments else ""
    return Diagnosis(
        "in-place",
        f"nodes are updated in place: counted from its other end the rope moves otherwise, by "
        f"{coarse:.1e} of its size, and not where no two neighbours move{order}; compute all "
        "forces before the first node is moved",
        evidence,
    )


def _difference(candidate: Candidate, problem: Problem, steps: int) -> float:
    """How far the rope and the one counted from the other end get apart, of its size."""
    own = candidate.run(problem, steps)
    other = candidate.run(renumbered(problem), steps)[:, :, ::-1]
    apart = float(np.max(np.abs(own - other))) / problem.scale
    return apart if np.isfinite(apart) else np.inf
