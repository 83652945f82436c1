"""What a problem's right-hand side shows at a few random states near the initial one."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ropeode.precision import in_float64
from ropeode.problems.functions import compiled
from ropeode.problems.problem import Problem

_PROBES = 3


def random_states(problem: Problem) -> Iterator[tuple[float, np.ndarray]]:
    """A few times of a problem's span with a state for each, without any symmetry."""
    draw = np.random.default_rng(5).normal(size=(_PROBES, *problem.y0.shape))
    states = problem.y0 * (1.0 + 0.1 * draw) + 0.1 * problem.scale * draw
    return zip(np.linspace(problem.ts[0], problem.ts[-1], _PROBES), states, strict=True)


@in_float64
def free_coordinates(problem: Problem) -> np.ndarray:
    """Which coordinates can move at all, as truth values of the shape of the positions.

    A coordinate whose acceleration is exactly zero at all of a few random states is held.

    Arguments:
        problem: a mechanical problem.
    """
    problem.require_mechanics("problem")
    rates = compiled(problem.rhs)
    slopes = [np.asarray(rates(t, y, problem.args))[1] for t, y in random_states(problem)]
    return np.any(np.asarray(slopes) != 0.0, axis=0)
