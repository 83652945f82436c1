"""Right steppers pass every check, on ropes that are drawn at random."""

from __future__ import annotations

import pytest

from tests.checking.random_ropes import findings, ropes

# Of each kind one, with other ropes than benchmarks/false_alarms.py draws by default.
STEPPERS = (
    "velocity_verlet",
    pytest.param("yoshida4", marks=pytest.mark.slow),
    pytest.param("dormand-prince5", marks=pytest.mark.slow),
    pytest.param("ropeode stormer-verlet:damping=lagged", marks=pytest.mark.slow),
)


@pytest.mark.parametrize("name", STEPPERS)
def test_right_steppers_are_not_rejected_on_random_ropes(name):
    drawn, _ = ropes(2, 0)
    found = findings(name, drawn)
    assert [f"{check}: {each.line}" for check, each in found.items() if each.status == "fail"] == []
    assert sum(each.status == "pass" for each in found.values()) >= 12
