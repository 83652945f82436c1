"""The accuracy table."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

from ropeode import InextensibleRope, Problem, Rope, accuracy_table, reference
from ropeode.norms import NORMS
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
    known = reference(problem)
    for row in table.rows:
        run = simulate(problem, row.stepper, row.steps_per_frame)
        assert row.dt == pytest.approx(1 / row.steps_per_frame)
        assert row.rhs_evaluations == run.rhs_evaluations
        if row.resolved:
            apart = np.linalg.norm(run.positions - known.positions, axis=2).max(axis=1)[1:]
            assert row.error_max == pytest.approx(apart.max(), rel=1e-3)
            assert row.error_final == pytest.approx(apart[-1], rel=1e-3)
            assert row.error_rms == pytest.approx(np.sqrt(np.mean(apart**2)), rel=1e-3)
    assert [each.stepper for each in table.orders] == steppers
    for each in table.orders:
        dts = {row.dt for row in table.rows if row.stepper == each.stepper}
        assert {*each.order.used, *(point.dt for point in each.order.left_out)} == dts
    fractions = [fraction for _, fraction in said]
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0
    assert any("reference" in text for text, _ in said)
    assert any("rk4: 250 steps" in text for text, _ in said)


@pytest.mark.parametrize("name", [norm for norm in NORMS if not norm.startswith("state")])
def test_norms_of_a_rope(name, small_rope):
    found = accuracy_table(small_rope, ["velocity-verlet"], (32, 48, 72, 108), norm=name)
    assert found.norm.name == name
    assert found.orders[0].order.observed == pytest.approx(2, abs=0.05)


def test_default_steppers_fit_and_solve_the_problem(driven_pendulum):
    """A rope with springs is not given to steppers that keep lengths, whose limit is another."""
    keep_lengths = {"constraint-verlet", "rattle"}
    needs_damping = {"stormer-verlet", "stormer-verlet:start=rest"}
    everything = set(DEFAULT_STEPPERS)
    rigid = InextensibleRope(num_nodes=4).problem(frames=2)
    for problem, expected in [
        (Rope(num_nodes=4).problem(frames=2), everything - keep_lengths),
        (driven_pendulum, everything - keep_lengths),
        (rigid, everything - needs_damping),
        (Problem(lambda t, y, args: -y, [1.0], [0.0, 1.0]), {"explicit-euler", "rk4"}),
    ]:
        found = default_steppers(problem)
        assert found == [each for each in DEFAULT_STEPPERS if each in expected]


def test_problem_classes(driven_pendulum):
    """Damped, at rest at the start, rigid: where no damped node can move, nothing is damped."""
    for problem, expected in [
        (InextensibleRope(num_nodes=4), (True, True, True)),
        (InextensibleRope(num_nodes=4, damping=0.0), (False, True, True)),
        (InextensibleRope(num_nodes=2, damping=(3, 0)), (False, True, True)),
        (InextensibleRope(num_nodes=4, initial_velocity=(0, 1)), (True, False, True)),
        (Rope(num_nodes=4), (True, True, False)),
    ]:
        assert tuple(problem_class(problem.problem(frames=2))) == expected
    for problem in (driven_pendulum, Problem(lambda t, y, args: -y, [1.0], [0.0, 1.0])):
        assert tuple(problem_class(problem)) == (True, False, False)


def test_steppers_of_another_problem_are_marked(small_rope):
    """Asked for, they run; the table says that they solve something else."""
    found = accuracy_table(small_rope, ["rattle", "rk4"], (32, 48, 72))
    assert [(each.expected, each.solves) for each in found.orders] == [(0, False), (4, True)]
    assert found.orders[0].order.verdict == "does not converge"


def test_diverged_runs_are_rows_without_errors():
    problem = Problem(lambda t, y, args: -100 * y**3, [1.0], np.arange(13.0))
    table = accuracy_table(problem, steps_per_frame=(2, 200, 400, 800))
    assert [each.stepper for each in table.orders] == ["explicit-euler", "rk4"]
    row = table.rows[0]
    assert row.status == "diverged"
    assert row.diverged_at is not None
    assert (row.error_max, row.error_final, row.error_rms, row.round_off) == (None,) * 4
    assert not row.resolved
    order = table.orders[0].order
    assert order.left_out[0].reason == "unstable"
    assert order.verdict == "converges"


def test_past_the_horizon_nothing_is_judged():
    problem = Rope(num_nodes=4, damping=0.0).problem(frames=3)
    whole = accuracy_table(problem, ["rk4"], (8, 12, 18), rtol=1e-6, accuracy=1.0)
    accuracy = float(whole.reference.bound()[2])
    cut = accuracy_table(problem, ["rk4"], (8, 12, 18), rtol=1e-6, accuracy=accuracy)
    assert cut.reference.horizon == 3.0
    for long, short in zip(whole.rows, cut.rows, strict=True):
        if long.error_max and short.error_max:
            assert short.error_max <= long.error_max


@pytest.mark.parametrize(("jump_times", "expected"), [((), 4), ((0.5,), None)])
def test_jumps_take_the_expectation_away(jump_times, expected):
    problem = Problem(lambda t, y, args: -y, [1.0], [0.0, 1.0], jump_times=jump_times)
    known = exact_reference(problem, np.exp(-problem.ts)[:, None])
    assert accuracy_table(known, ["rk4"], [4]).orders[0].expected == expected


def test_an_orbit_that_is_back_at_each_sample_is_not_unstable() -> None:
    def attraction(t, x, v, args):
        return -x / jnp.sum(x**2) ** 1.5

    whole = Problem.second_order(attraction, [[1.0, 0.0]], [[0.0, 1.0]], [0.0, 2 * np.pi])
    table = accuracy_table(whole, ["rk4", "stormer-verlet"], [64, 128, 256, 512])
    reasons = {left.reason for each in table.orders for left in each.order.left_out}
    assert "unstable" not in reasons
    assert [each.order.verdict for each in table.orders] == ["converges", "converges"]
