"""Right steppers pass every check, on ropes that are drawn at random."""

from __future__ import annotations

import pytest

from tests.checking.random_ropes import findings, ropes

# On ropes of their own right steppers are checked in the fast tests too (test_checks.py).
pytestmark = pytest.mark.slow

# Of each kind one, with other ropes than benchmarks/false_alarms.py draws by default.
STEPPERS = (
    "velocity_verlet",
    "yoshida4",
    "dormand-prince5",
    "ropeode stormer-verlet:damping=lagged",
)


@pytest.mark.parametrize("name", STEPPERS)
def test_right_steppers_are_not_rejected_on_random_ropes(name):
    drawn, _ = ropes(2, 0)
    found = findings(name, drawn)
    assert [f"{check}: {each.line}" for check, each in found.items() if each.status == "fail"] == []
    assert sum(each.status == "pass" for each in found.values()) >= 12
