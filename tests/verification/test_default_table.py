"""What the default rope must show; docs/explanation/default-table.md explains it."""

from __future__ import annotations

import pytest

from ropeode import accuracy_table
from ropeode.problems import Rope
from ropeode.study import DEFAULT_STEPPERS

PER_STEP, LAGGED = "stormer-verlet:damping=per-step", "stormer-verlet:damping=lagged"
# What a start and a damping of its own cost is tested with less work in test_orders.py.
ORDERS = {"explicit-euler": 1, "stormer-verlet": 2, "rk4": 4}
ALSO_ORDERS = {"semi-implicit-euler": 1, "stormer-verlet:start=rest": 1, LAGGED: 1}
FEWER_STEPS = (16, 32, 64, 128, 256, 512, 1024, 2048, 4096)


@pytest.fixture(scope="module")
def table():
    return accuracy_table(Rope().problem(frames=20), [*ORDERS, PER_STEP], FEWER_STEPS)


def order_of(table, stepper):
    return next(each.order for each in table.orders if each.stepper == stepper)


def reasons(table, stepper):
    steps = {row.dt: row.steps_per_frame for row in table.rows}
    return {steps[point.dt]: point.reason for point in order_of(table, stepper).left_out}


def assert_order(table, stepper, order, within=0.03):
    found = order_of(table, stepper)
    assert found.verdict == "converges"
    assert found.observed == pytest.approx(order, abs=within)
    # The finest error of rk4 is ten times the reference's bound, and so is its slope uncertain.
    slack = 0.02 if stepper == "rk4" else 0.0
    assert found.ci95[0] - slack <= order <= found.ci95[1] + slack


@pytest.mark.parametrize(("stepper", "order"), ORDERS.items())
def test_orders(table, stepper, order):
    # The error of explicit Euler bends at these step sizes: its interval is that wide.
    assert_order(table, stepper, order, within=0.1 if stepper == "explicit-euler" else 0.03)


@pytest.mark.slow
def test_orders_of_all_steppers_at_all_steps():
    whole = accuracy_table(Rope().problem(frames=20), [*DEFAULT_STEPPERS, PER_STEP, LAGGED])
    for stepper, order in {**ORDERS, **ALSO_ORDERS}.items():
        assert_order(whole, stepper, order)
    assert order_of(whole, PER_STEP).verdict == "does not converge"
    left = reasons(whole, "stormer-verlet")
    assert left[8192] == left[16384] == "round-off"
    rows = {r.steps_per_frame: r for r in whole.rows if r.stepper == "stormer-verlet"}
    assert rows[16384].error_max > 2 * min(row.error_max for row in rows.values())


def test_explicit_euler_is_unstable_at_coarse_steps(table):
    left = reasons(table, "explicit-euler")
    assert {16, 32, 64, 128} <= {steps for steps, reason in left.items() if reason == "unstable"}
    assert next(r.error_max for r in table.rows if r.stepper == "explicit-euler") > 1e50


def test_damping_per_step_solves_another_equation(table):
    assert order_of(table, PER_STEP).verdict == "does not converge"
    rows = [r for r in table.rows if r.stepper == PER_STEP]
    assert rows[-1].error_max > rows[0].error_max > 100


def test_the_finest_steps_drown_in_round_off_or_in_the_bound(table):
    assert table.reference.horizon is None
    assert table.reference.bound()[-1] < 1e-10
    left = reasons(table, "stormer-verlet")
    assert left[4096] == "round-off"
    assert set(left.values()) == {"round-off"}
    left = reasons(table, "rk4")
    assert left[4096] == "below the reference's bound"
    assert "pre-asymptotic" not in left.values()
