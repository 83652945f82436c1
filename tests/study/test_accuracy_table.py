"""The accuracy table."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

from ropeode import InextensibleRope, Problem, Rope, accuracy_table
from ropeode.analysis import error_series
from ropeode.simulation import simulate
from ropeode.study import DEFAULT_STEPPERS, default_steppers, problem_class
from tests.exact_reference import exact_reference


def test_rows_are_runs_and_orders_follow_them():
    problem, said = Rope(num_nodes=4, damping=0.1).problem(frames=3), []
    steppers, ladder = ["explicit-euler", "rk4"], (16, 40, 100, 250)
    table = accuracy_table(problem, steppers, ladder, progress=lambda *each: said.append(each))
    assert [(row.stepper, row.steps_per_frame) for row in table.rows] == [
        (stepper, steps) for stepper in steppers for steps in ladder
    ]
    for row in table.rows:
        run = simulate(problem, row.stepper, row.steps_per_frame)
        assert row.dt == pytest.approx(1 / row.steps_per_frame)
        assert row.rhs_evaluations == run.rhs_evaluations
        series = error_series(run, table.reference)
        assert (row.error_max, row.error_final) == (series.max, series.final)
        assert row.error_rms == series.rms
    assert [each.stepper for each in table.orders] == steppers
    for each in table.orders:
        dts = {row.dt for row in table.rows if row.stepper == each.stepper}
        assert {*each.order.used, *(point.dt for point in each.order.left_out)} == dts
    fractions = [fraction for _, fraction in said]
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0


def decaying(t, y, args):
    return -y


def test_default_steppers_fit_and_solve_the_problem(driven_pendulum):
    """A rope with springs is not given to steppers that keep lengths, whose limit is another."""
    keep_lengths = {"constraint-verlet", "rattle"}
    needs_damping = {"stormer-verlet", "stormer-verlet:start=rest"}
    everything = set(DEFAULT_STEPPERS)
    for problem, expected in [
        (Rope(num_nodes=4).problem(frames=2), everything - keep_lengths),
        (driven_pendulum, everything - keep_lengths),
        (InextensibleRope(num_nodes=4).problem(frames=2), everything - needs_damping),
        (Problem(decaying, [1.0], [0.0, 1.0]), {"explicit-euler", "rk4"}),
    ]:
        expected = [each for each in DEFAULT_STEPPERS if each in expected]
        assert default_steppers(problem) == expected


def test_problem_classes(driven_pendulum):
    """Damped, at rest at the start, rigid: where no damped node can move, nothing is damped."""
    for problem, expected in [
        (InextensibleRope(num_nodes=4).problem(2), (True, True, True)),
        (InextensibleRope(num_nodes=4, damping=0.0).problem(2), (False, True, True)),
        (InextensibleRope(num_nodes=2, damping=(3, 0)).problem(2), (False, True, True)),
        (InextensibleRope(num_nodes=4, initial_velocity=(0, 1)).problem(2), (True, False, True)),
        (Rope(num_nodes=4).problem(2), (True, True, False)),
        (driven_pendulum, (True, False, False)),
        (Problem(decaying, [1.0], [0.0, 1.0]), (True, False, False)),
    ]:
        assert tuple(problem_class(problem)) == expected


def test_steppers_of_another_problem_are_marked(small_rope):
    """Asked for, they run; the table says that they solve something else."""
    found = accuracy_table(small_rope, ["rattle", "rk4"], (32, 48, 72))
    assert [(each.expected, each.solves) for each in found.orders] == [(0, False), (4, True)]
    assert found.orders[0].order.verdict == "does not converge"


def test_diverged_runs_are_rows_without_errors(decay):
    table = accuracy_table(decay, steps_per_frame=(2, 200, 400, 800))
    assert [each.stepper for each in table.orders] == ["explicit-euler", "rk4"]
    row = table.rows[0]
    assert (row.status, row.diverged_at) == ("diverged", 3)
    assert (row.error_max, row.error_final, row.error_rms, row.round_off) == (None,) * 4
    assert not row.resolved
    order = table.orders[0].order
    assert order.left_out[0].reason == "unstable"
    assert order.verdict == "converges"


@pytest.mark.parametrize(("jump_times", "expected"), [((), 4), ((0.5,), None)])
def test_jumps_take_the_expectation_away(jump_times, expected):
    problem = Problem(decaying, [1.0], [0.0, 1.0], jump_times=jump_times)
    known = exact_reference(problem, np.exp(-problem.ts)[:, None])
    assert accuracy_table(known, ["rk4"], [4]).orders[0].expected == expected


def test_an_orbit_that_is_back_at_each_sample_is_not_unstable() -> None:
    def attraction(t, x, v, args):
        return -x / jnp.sum(x**2) ** 1.5

    whole = Problem.second_order(attraction, [[1.0, 0.0]], [[0.0, 1.0]], [0.0, 2 * np.pi])
    known = exact_reference(whole, np.stack([whole.y0] * 2))
    table = accuracy_table(known, ["rk4", "stormer-verlet"], [64, 128, 256, 512])
    reasons = {left.reason for each in table.orders for left in each.order.left_out}
    assert "unstable" not in reasons
    assert [each.order.verdict for each in table.orders] == ["converges", "converges"]
