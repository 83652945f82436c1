"""The round-off estimate against round-off that is known."""

from __future__ import annotations

import numpy as np
import pytest

from ropeode.analysis.roundoff import in_other_units, round_off
from ropeode.norms import norm_for
from ropeode.problems.library import PROBLEMS
from ropeode.problems.problem import Problem
from ropeode.problems.rope import Rope
from ropeode.render.stepper_list import variants
from ropeode.simulation import simulate
from ropeode.steppers import STEPPERS

VARIANTS = [each for cls in STEPPERS.values() for each in variants(cls)]


@pytest.mark.parametrize("stepper", VARIANTS, ids=lambda each: each.label)
def test_other_units_change_nothing_but_rounding(stepper):
    problem = Rope(
        num_nodes=4, node_mass=(1, 2, 0.5, 1), damping=0.2, initial_velocity=(1, -1)
    ).problem(frames=3)
    run = simulate(problem, stepper, 10)
    found = round_off(run, in_other_units(problem), 4, norm_for(problem))
    assert 0 < found < 1e-10


@pytest.mark.parametrize("name", PROBLEMS)
def test_every_problem_can_be_put_in_other_units(name):
    problem = PROBLEMS[name]()
    run = simulate(problem, "rk4", 20)
    found = round_off(run, in_other_units(problem), len(problem.ts), norm_for(problem))
    assert found < 1e-9 * problem.scale


@pytest.mark.parametrize("steps", [2000, 5000, 30000])
def test_against_a_run_without_round_off(steps):
    # y' = -y/3 by explicit Euler is (1 - dt/3)^n y0, known to all digits.
    problem = Problem(lambda t, y, args: -y / 3.0, [1.0, 0.37], [0.0, 1.0, 2.0])
    run = simulate(problem, "explicit-euler", steps)
    n = steps * np.arange(3, dtype=np.longdouble)[:, None]
    exact = np.exp(n * np.log1p(-np.longdouble(1) / 3 / steps)) * problem.y0
    true = float(np.max(np.abs(run.states - exact)))
    found = round_off(run, in_other_units(problem), 3, norm_for(problem))
    assert true < 30 * found
    assert found < 100 * true


def test_repeating_errors_are_seen():
    # (1 - r dt)(x - x_before) rounds almost alike in each step; noise that is added to the
    # steps does not show it. The excess over order 1 at the finest step is the round-off.
    problem = Rope().problem(frames=20)
    runs = {n: simulate(problem, "stormer-verlet:damping=lagged", n) for n in (2048, 4096, 16384)}
    best = simulate(problem, "velocity-verlet", 4096).positions[-1]
    wrong = {n: np.max(np.abs(run.positions[-1] - best)) for n, run in runs.items()}
    excess = abs(wrong[16384] - wrong[2048] / 8)
    assert excess > 5e-6
    found = round_off(runs[16384], in_other_units(problem), 21, norm_for(problem))
    assert excess < 30 * found
