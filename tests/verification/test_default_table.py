"""What the default rope must show; docs/explanation/default-table.md explains it."""

from __future__ import annotations

import pytest

from ropeode import accuracy_table
from ropeode.problems import Rope

PER_STEP = "stormer-verlet:damping=per-step"
# What a start and a damping of its own cost is tested with less work in test_orders.py.
STEPPERS = ("explicit-euler", "stormer-verlet", "rk4", PER_STEP)
STEPS = (16, 32, 64, 128, 256, 512, 1024, 2048, 4096)


@pytest.fixture(scope="module")
def table():
    return accuracy_table(Rope().problem(frames=20), STEPPERS, STEPS)


def order_of(table, stepper):
    return next(each.order for each in table.orders if each.stepper == stepper)


def errors_of(table, stepper):
    return {row.steps_per_frame: row.error_max for row in table.rows if row.stepper == stepper}


def reasons(table, stepper):
    """By the steps in a frame, whose length is 1."""
    return {round(1 / point.dt): point.reason for point in order_of(table, stepper).left_out}


@pytest.mark.parametrize(
    ("stepper", "order", "within", "slack"),
    [
        # Its error bends at these step sizes: its interval is that wide.
        ("explicit-euler", 1, 0.1, 0.0),
        ("stormer-verlet", 2, 0.03, 0.0),
        # Its finest error is ten times the reference's bound, and so is its slope uncertain.
        ("rk4", 4, 0.03, 0.02),
    ],
)
def test_orders(table, stepper, order, within, slack):
    found = order_of(table, stepper)
    assert found.verdict == "converges"
    assert found.observed == pytest.approx(order, abs=within)
    assert found.ci95[0] - slack <= order <= found.ci95[1] + slack


def test_explicit_euler_is_unstable_at_coarse_steps(table):
    left = reasons(table, "explicit-euler")
    assert [left[steps] for steps in STEPS[:4]] == ["unstable"] * 4
    assert errors_of(table, "explicit-euler")[16] > 1e50


def test_damping_per_step_solves_another_equation(table):
    assert order_of(table, PER_STEP).verdict == "does not converge"
    errors = errors_of(table, PER_STEP)
    assert errors[4096] > errors[16] > 100


def test_the_finest_steps_drown_in_round_off_or_in_the_bound(table):
    assert table.reference.horizon is None
    assert table.reference.bound()[-1] < 1e-10
    left = reasons(table, "stormer-verlet")
    assert left[4096] == "round-off"
    assert set(left.values()) == {"round-off"}
    left = reasons(table, "rk4")
    assert left[4096] == "below the reference's bound"
    assert "pre-asymptotic" not in left.values()
