"""The first-order error of constraint Verlet, predicted from the lag of its tensions."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from ropeode import InextensibleRope, accuracy_table

sys.path.insert(0, str(Path(__file__).parents[2] / "docs"))
from studies.tension_lag import predicted_by_lag

UNEQUAL = InextensibleRope(num_nodes=5, node_mass=[1, 2, 3, 1, 2], damping=0.3)


@pytest.mark.slow
@pytest.mark.parametrize(("rope", "sweeps"), [(InextensibleRope(), 1), (UNEQUAL, 4)])
def test_the_lag_predicts_the_error_of_runs(rope, sweeps):
    problem = rope.problem(20)
    table = accuracy_table(problem, [f"constraint-verlet:sweeps={sweeps}"], [256, 512])
    coarse, fine = (row.error_max / row.dt for row in table.rows)
    assert 2.0 * fine - coarse == pytest.approx(predicted_by_lag(problem), rel=3e-4)
