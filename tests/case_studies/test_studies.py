"""The studies of the open questions, and of small steps, agree with theory and with runs."""

from __future__ import annotations

import math

import numpy as np
import pytest

from docs.studies.projection_sweeps import sweep_study
from docs.studies.rest_time import rest_times
from docs.studies.small_steps import (
    cheapest,
    damping_rates,
    fewest_steps,
    splits,
    tip_errors,
)
from ropeode import Rope, hanging_equilibrium, simulate
from ropeode.analysis import normal_modes
from ropeode.errors import InputError
from ropeode.theory import stability_function_of
from tests.exact_reference import rope_reference


@pytest.mark.slow
def test_any_number_of_sweeps_has_order_one_and_nearly_one_constant(study):
    one, three = study.swept
    for each in study.swept:
        low, high = each.order.ci95
        assert low - 0.02 <= 1 <= high + 0.02
        assert each.constant == pytest.approx(each.errors[-1] / each.dts[-1])
        # Lengths are off by a multiple of the square of dt.
        slope = np.polyfit(np.log(each.dts), np.log(each.violations), 1)[0]
        assert slope == pytest.approx(2.0, abs=0.1)
    assert all(more < less for more, less in zip(three.violations, one.violations, strict=True))
    assert one.constant == pytest.approx(three.constant, rel=0.05)
    with pytest.raises(InputError, match="an inextensible rope"):
        sweep_study(Rope(num_nodes=3).problem(2))


@pytest.mark.slow
@pytest.mark.parametrize("rope", ["constraint", "force"])
def test_frames_to_rest(rope):
    """Per step they fall as one over the steps; per time they do not depend on the steps."""
    steps = (128, 192, 320)
    per_step = rest_times(rope, "per-step", steps, per_step=2e-4)
    # The last swing that is faster than the threshold is over after half a period, 53 frames.
    for each in per_step:
        assert abs(each.product - 15.0) <= 53 * each.rate / 2
    # At least what the threshold of a thousandth takes; the fall adds a little.
    assert 2 * np.log(1000) < np.mean([each.product for each in per_step]) < 18
    per_time = rest_times(rope, "lagged", steps, per_step=2e-4)
    assert np.ptp([each.settled_at for each in per_time]) <= 4
    assert {each.rate for each in per_time} == {2e-4 * 256}


# Of the size that other tests have too, so that its programs are compiled once.
MASS, FRAMES = np.array([1.0, 2.0, 0.7, 1.5]), 3
UNEQUAL = Rope(
    end=(-40.0, 190.0),
    num_nodes=4,
    node_mass=tuple(MASS),
    stiffness=(300.0, 900.0, 500.0),
    damping=0.0,
    initial_velocity=(0.3, -0.6),
)
LENGTHS = np.full(3, np.hypot(40.0, 10.0) / 3)


@pytest.fixture(scope="module")
def truth():
    return rope_reference(UNEQUAL.problem(FRAMES))


def test_all_splits_of_each_budget_are_run_and_measured_as_they_say(truth):
    """By formulas written anew; tests/steppers/test_formulas.py has the step, link by link."""
    found = splits(truth, (1, 2, 6))
    each = [(run.steps, run.iterations) for run in found.runs]
    assert sorted(each) == [(1, 1), (1, 2), (1, 6), (2, 1), (3, 2), (6, 1)]
    kinetic = 0.5 * MASS @ np.sum(truth.velocities[-1] ** 2, axis=1)
    for run in found.runs:
        made = simulate(truth.problem, f"xpbd:iterations={run.iterations}", run.steps)
        apart = np.linalg.norm(made.positions - truth.positions, axis=2)[1:] / LENGTHS.sum()
        tip = apart[:, -1]
        errors = (tip[-1], tip.max(), np.sqrt(np.mean(tip**2)), apart.max())
        assert (run.final, run.max, run.rms, run.worst) == pytest.approx(errors, rel=1e-6)
        start, *_, end = truth.problem.energies(made.states)
        assert run.energy == pytest.approx((start - end) / kinetic, rel=1e-6)
        for stretch, of in ((run.stretch, made), (found.stretch, truth)):
            lengths = np.linalg.norm(np.diff(of.positions, axis=1), axis=2)
            assert stretch == pytest.approx(np.max(lengths / LENGTHS) - 1.0, rel=1e-6)
    # An error that the reference cannot tell is left out.
    exact = simulate(truth.problem, "diffrax:Dopri8", 64)
    assert tip_errors(exact, truth).max is None


def furthest(truth, method, steps):
    """The error of the tip, as a part of the rope's length."""
    run = simulate(truth.problem, method, steps)
    if run.status != "ok":
        return np.inf
    return np.linalg.norm(run.positions - truth.positions, axis=2)[:, -1].max() / LENGTHS.sum()


def test_the_fewest_steps_are_enough_and_one_less_is_not(truth):
    for row in cheapest(truth, ["implicit-euler:newton=1", "xpbd", "velocity-verlet"], rounds=0):
        assert row.steps == fewest_steps(truth, row.method)
        assert row.seconds is None
        assert row.error == pytest.approx(furthest(truth, row.method, row.steps))
        assert row.error <= 0.01 < furthest(truth, row.method, row.steps - 1)
        # Verlet evaluates the forces once at the start as well.
        once = 1 / FRAMES if row.method == "velocity-verlet" else 0
        assert row.units == pytest.approx(row.steps + once)


@pytest.mark.slow
def test_damping_is_that_of_theory_and_of_runs():
    """For a pendulum of one spring XPBD damps as implicit Euler does; Verlet does not damp."""
    pendulum = Rope(end=(-3.0, 200.0), num_nodes=2, node_mass=1.7, stiffness=40.0, damping=0.0)
    problem = pendulum.problem(1)
    omega = normal_modes(problem, hanging_equilibrium(problem)).frequencies[0]
    methods = ["implicit-euler", "xpbd", "velocity-verlet"]
    rows = damping_rates(methods, (6, 20), problem)
    assert [(row.method, row.steps) for row in rows] == [(m, n) for m in methods for n in (6, 20)]
    for row in rows:
        theory = stability_function_of(problem, row.method if row.method != "xpbd" else methods[0])
        factor = theory.radius(np.array([1j * omega / row.steps]))[0]
        rate = -row.steps * math.log(factor)
        assert row.of_step == pytest.approx(rate, rel=1e-7, abs=1e-12)
        assert row.measured == pytest.approx(rate, rel=1e-5, abs=1e-8)
        if row.method != "velocity-verlet":
            assert row.implicit_euler == pytest.approx(rate, rel=1e-9)
        assert abs(row.speed - 1.0) < 0.01
