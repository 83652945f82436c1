"""What two runs in extended precision must agree to, with runs whose error is known."""

from __future__ import annotations

import numpy as np
import pytest

from ropeode.problems import PROBLEMS
from ropeode.references.extended import solution as module
from ropeode.references.extended.taylor import ExtendedRun


@pytest.mark.parametrize("digits", [15, 17])
def test_more_bits_until_three_times_the_difference_has_the_digits(monkeypatch, digits):
    problem = PROBLEMS["oscillator"](frames=3)
    exact = np.broadcast_to(problem.y0, (4, *problem.y0.shape)).astype(np.longdouble)
    limit = 10.0**-digits
    runs = []

    def solve(problem, *, precision, time_limit, progress, shift=None, looked_into=False):
        """The first coarse run is off by a little less, and then a little more, than is allowed."""
        error = np.array([0.0, 0.3, 0.4, 0.4]) * limit * (len(runs) == 1)
        states = exact + error.reshape(-1, *[1] * problem.y0.ndim)
        # The finer run alone is looked into, and starts where the problem does.
        assert looked_into == (shift is None) == (len(runs) % 2 == 0)
        # It leaves time enough for the other one.
        assert 1e9 * (0.4 if looked_into else 0.99) < time_limit < 1e9 * (0.6 if looked_into else 1)
        runs.append(ExtendedRun(precision, 2.0**-precision, states, 1, 0.0, 0.0))
        return runs[-1]

    monkeypatch.setattr(module, "solve", solve)
    found = module.extended_solution(problem, digits=digits, time_limit=1e9)
    assert found.agreed == 4
    assert found.failure is None
    # The first pair agrees at two samples only.
    assert len(runs) > 2
    assert found.coarse is not runs[1]
