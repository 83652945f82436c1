"""The first-order error of constraint Verlet, predicted from the lag of its tensions."""

from __future__ import annotations

import sys
from pathlib import Path

import jax
import numpy as np
import pytest

from ropeode import InextensibleRope, accuracy_table

sys.path.insert(0, str(Path(__file__).parents[2] / "docs"))
from studies.tension_lag import late_acceleration, predicted_by_lag

UNEQUAL = InextensibleRope(num_nodes=5, node_mass=[1, 2, 3, 1, 2], damping=0.3)


def test_without_lag_it_is_the_rope():
    problem = UNEQUAL.problem(1)
    x, v = np.random.default_rng(0).normal(size=(2, 2, 5)) * 50.0
    with jax.enable_x64(True):
        own, rope = (
            late_acceleration(x, v, 0.0, problem.args),
            problem.mechanics.acceleration(0.0, x, v, problem.args),
        )
    np.testing.assert_allclose(own, rope, rtol=1e-11, atol=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("rope", [InextensibleRope(), UNEQUAL], ids=["default", "unequal"])
@pytest.mark.parametrize("sweeps", [1, 4])
def test_the_lag_predicts_the_error_of_runs(rope, sweeps):
    problem = rope.problem(20)
    table = accuracy_table(problem, [f"constraint-verlet:sweeps={sweeps}"], [256, 512])
    coarse, fine = (row.error_max / row.dt for row in table.rows)
    assert 2.0 * fine - coarse == pytest.approx(predicted_by_lag(problem), rel=3e-4)
