"""The accuracy table, and the leading term of the error in it."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

from ropeode import InextensibleRope, Problem, Rope, accuracy_table, reference
from ropeode.analysis import error_series, observed_order
from ropeode.norms import norm_for
from ropeode.problems import PROBLEMS
from ropeode.simulation import simulate
from ropeode.study import DEFAULT_STEPPERS, default_steppers, problem_class
from ropeode.study.error_constant import ErrorConstant, error_constant
from ropeode.theory import PredictedError
from tests.exact_reference import exact_reference, rope_reference


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


DECAYING = Problem(lambda t, y, args: -y, [1.0], [0.0, 1.0])


def test_problem_classes_and_their_default_steppers(driven_pendulum):
    """Damped, at rest at the start, rigid: where no damped node can move, nothing is damped.

    A rope with springs is not given to steppers that keep lengths, whose limit is another.
    """
    springs = {*DEFAULT_STEPPERS} - {"constraint-verlet", "rattle"}
    rigid = {*DEFAULT_STEPPERS} - {"stormer-verlet", "stormer-verlet:start=rest"}
    for problem, of_class, steppers in [
        (Rope(num_nodes=4).problem(2), (True, True, False), springs),
        (driven_pendulum, (True, False, False), springs),
        (InextensibleRope(num_nodes=4).problem(2), (True, True, True), rigid),
        (InextensibleRope(num_nodes=4, damping=0.0).problem(2), (False, True, True), None),
        (InextensibleRope(num_nodes=2, damping=(3, 0)).problem(2), (False, True, True), None),
        (InextensibleRope(initial_velocity=(0, 1)).problem(2), (True, False, True), None),
        (DECAYING, (True, False, False), {"explicit-euler", "rk4"}),
    ]:
        assert tuple(problem_class(problem)) == of_class
        if steppers is not None:
            chosen = [each for each in DEFAULT_STEPPERS if each in steppers]
            assert default_steppers(problem) == chosen


def test_steppers_of_another_problem_are_marked(small_rope):
    """Asked for, they run; the table says that they solve something else."""
    found = accuracy_table(rope_reference(small_rope), ["rattle", "rk4"], (32, 48, 72))
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


def test_an_orbit_that_is_back_at_each_sample_is_not_unstable() -> None:
    def attraction(t, x, v, args):
        return -x / jnp.sum(x**2) ** 1.5

    whole = Problem.second_order(attraction, [[1.0, 0.0]], [[0.0, 1.0]], [0.0, 2 * np.pi])
    known = exact_reference(whole, np.stack([whole.y0] * 2))
    table = accuracy_table(known, ["rk4", "stormer-verlet"], [64, 128, 256, 512])
    reasons = {left.reason for each in table.orders for left in each.order.left_out}
    assert "unstable" not in reasons
    assert [each.order.verdict for each in table.orders] == ["converges", "converges"]


def test_agreement_begins_where_it_lasts_to_the_finest_step():
    def constant(measured):
        return ErrorConstant(1, np.array([1.0, 2.0]), None, measured)

    found = constant({0.1: 2.01, 0.2: 2.15, 0.4: 2.5, 0.8: 2.0})
    assert (found.dt, found.measured, found.ratio) == (0.1, 2.01, 1.005)
    assert found.agree_from(0.01) == 0.1
    assert found.agree_from(0.1) == 0.2
    assert constant({0.1: 2.5, 0.2: 2.0}).agree_from(0.1) is None


def test_runs_that_cannot_be_used_count_for_nothing():
    problem = DECAYING.changed(ts=np.arange(3.0))
    dts = [0.5, 0.25, 0.125, 0.0625, 0.03125]
    errors = [9.0, 0.25, 0.126, 0.0626, 0.9]
    order = observed_order(dts, errors, rounding=[0, 0, 0, 0, 0.5], motion=1.0)
    # At the third step size rounding makes more than a part in 300 of the error.
    rounding = [1e-4, 1e-4, 1e-3, 1e-4, 0.5]
    runs = dict(zip(dts, zip(errors, rounding, strict=True), strict=True))
    exact = exact_reference(problem, np.exp(-problem.ts)[:, None])
    prediction = PredictedError(1, problem.ts, np.array([[0.0], [1.0], [0.5]]), 1e-6)
    found = error_constant(exact, norm_for(problem), runs, order, prediction)
    assert list(found.measured_at) == [0.0625, 0.25]
    assert found.measured == pytest.approx(0.0626 / 0.0625)
    none = error_constant(exact, norm_for(problem), runs, order, "nobody knows")
    assert (none.predicted, none.why, none.order, none.ratio) == (None, "nobody knows", 1, None)
    zero = PredictedError(1, problem.ts, np.zeros((3, 1)), 0.0)
    zero = error_constant(exact, norm_for(problem), runs, order, zero)
    assert zero.predicted is None
    assert zero.why == "the term with dt^1 vanishes"


@pytest.mark.slow
def test_three_points_that_theory_confirms_are_an_order():
    """Of rk4 on Lorenz's equations; coarser ones only look like order 5."""
    truth = reference(PROBLEMS["lorenz"]())
    table = accuracy_table(truth, ["rk4"], (64, 128, 256, 512, 1024), predict=True)
    (found,) = table.orders
    assert (found.order.verdict, len(found.order.used)) == ("converges", 3)
    assert found.order.observed == pytest.approx(4, abs=0.05)
    (found,) = accuracy_table(truth, ["rk4"], (16, 32, 64, 128), predict=True).orders
    assert found.order.verdict == "undetermined"
    assert "theory says order 4 from about" in found.order.why
