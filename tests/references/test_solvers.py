"""The adaptive solvers that references are made with."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

from ropeode.problems import PROBLEMS, Problem
from ropeode.references import (
    DOPRI8,
    OWN_DOP853,
    RADAU9,
    SCIPY_BDF,
    SCIPY_DOP853,
    SCIPY_RADAU,
    solve,
)
from ropeode.references.solvers.dop853 import solve as solve_side_by_side
from tests.references.scalar_problems import scalar
from tests.sampled import sampled

SOLVERS = (DOPRI8, RADAU9, SCIPY_DOP853, SCIPY_RADAU, SCIPY_BDF, OWN_DOP853)
EXPLICIT = (DOPRI8, SCIPY_DOP853, OWN_DOP853)


# SciPy's solvers are all driven alike.
@pytest.mark.parametrize("solver", sampled(SOLVERS, fast=set(SOLVERS) - {SCIPY_BDF}), ids=str)
def test_a_solver_solves_or_says_why_not_and_keeps_what_it_has(solver):
    """At a pole, where there are no numbers, and at the end of its budget."""
    ts, rtol = np.array([0.0, 0.3, 1.0, 1.1, 2.0, 4.0]), 1e-12 if solver in EXPLICIT else 1e-9
    logistic = scalar("logistic", 0.1, ts)
    run = solve(logistic, solver, rtol, rtol, max_steps=100_000)
    assert run.solver == solver
    assert run.failure is None
    exact = 1 / (1 + 9 * np.exp(-ts))
    np.testing.assert_allclose(run.states[:, 0], exact, rtol=0, atol=30 * rtol)

    ts = np.array([0.0, 0.4, 0.8, 1.0, 1.2, 2.0])
    run = solve(scalar("square", 1.0, ts), solver, 1e-8, 1e-8, max_steps=100_000)
    assert run.steps < 3000
    assert run.failure.startswith("stopped after t = 1: ")
    assert "step size" in run.failure
    assert run.reached == pytest.approx(1.0, abs=1e-6)
    assert len(run.states) <= 4 or np.all(np.abs(run.states[3:]) > 1e3)
    np.testing.assert_allclose(run.states[:3, 0], 1 / (1 - ts[:3]), rtol=1e-5)

    ends = scalar("root of what is left", 0.0, [0.0, 0.25, 0.5, 1.0, 3.0, 4.0])
    run = solve(ends, solver, 1e-8, 1e-8, max_steps=3000)
    assert run.failure
    assert len(run.states) < 5
    assert np.all(np.isfinite(run.states))

    run = solve(logistic, solver, 1e-10, 1e-10, max_steps=3)
    assert run.steps <= 4
    assert len(run.states) < 6
    assert "step" in run.failure


def test_rounding_leaves_no_rest_of_a_frame():
    """It would be a step of its own, after which others have to grow, or which ends the run."""
    problem = scalar("decay", 1.0, np.linspace(0.0, 7.0, 6))
    longest = np.diff(problem.ts) / 1000
    run = solve(problem, DOPRI8, 1e-6, 1e-6, max_steps=10**5, longest_steps=longest)
    assert run.failure is None
    assert 5000 <= run.steps <= 5003


@pytest.mark.parametrize("frame", [1e-5, 2e-6])
def test_times_with_few_digits_left_do_not_stop_a_run(frame):
    """At t = 1.7e9 they are 2.4e-7 apart, more than the shortest steps that are asked for."""
    ts = 1.7e9 + frame * np.arange(6)
    problem = scalar("decay", 1.0, ts, 1e4)
    exact = np.exp(-1e4 * (ts - ts[0]))
    for steps in ({}, {"longest_steps": np.full(5, frame / 32)}):
        run = solve(problem, DOPRI8, 1e-10, 1e-10, max_steps=1000, **steps)
        assert run.failure is None
        np.testing.assert_allclose(run.states[:, 0], exact, rtol=1e-8)


# Many problems side by side.


def swing(t, y, args):
    return jnp.stack([y[1], -args * jnp.sin(y[0])])


def pendulums(count):
    ts = np.linspace(0.0, 5.0, 6)
    return [Problem(swing, [0.1 + 2.0 * k / count, 0.0], ts, 1.0 + k) for k in range(count)]


def side_by_side(problems, rtols, max_steps=500):
    atols = [rtol * problem.scale for rtol, problem in zip(rtols, problems, strict=True)]
    return solve_side_by_side(problems, rtols, atols, max_steps=[max_steps] * len(problems))


def test_it_is_scipys_method_but_for_rounding():
    problems = pendulums(7)
    for problem, run in zip(problems, side_by_side(problems, [1e-10] * 7), strict=True):
        scipys = solve(problem, SCIPY_DOP853, 1e-10, 1e-10 * problem.scale, max_steps=1000)
        assert run.failure is None
        assert run.steps == scipys.steps
        # Rounding of each step, grown by no more than a few.
        np.testing.assert_allclose(run.states, scipys.states, rtol=0, atol=1e-13 * problem.scale)


def test_lanes_do_not_feel_each_other():
    """More problems than lanes, so that those that wait take the places of those that end."""
    many = 140
    problems, rtols = pendulums(many), np.logspace(-12, -4, many)

    def states(order):
        runs = side_by_side([problems[k] for k in order], rtols[order])
        return {k: (run.states.tobytes(), run.steps) for k, run in zip(order, runs, strict=True)}

    whole = states(list(range(many)))
    assert states(np.random.default_rng(1).permutation(many).tolist()) == whole
    for k in (0, many // 2, many - 1):
        assert states([k]) == {k: whole[k]}


def test_what_fails_says_where_and_holds_up_nobody():
    # y' = a y^2, with y = y0/(1 - a y0 t), which has a pole.
    problems = [scalar("square", 1.0, np.linspace(0.0, 2.0, 6), a) for a in (0.3, 0.75, -1.0)]
    limits = [1000, 10**5, 3]
    fine, pole, short = solve_side_by_side(problems, [1e-10] * 3, [1e-10] * 3, max_steps=limits)
    assert fine.failure is None
    assert "t = 1.33" in str(pole.failure)
    assert len(pole.states) == 4
    assert "3 steps did not suffice" in str(short.failure)
    assert short.steps == 3


# Of the Test Set for IVP Solvers, each computed there at a tolerance of 1e-18.
PUBLISHED = {
    "oregonator": [0.1000814870318523e1, 0.1228178521549917e4, 0.1320554942846706e3],
    "robertson": [0.2083340149701255e-7, 0.8333360770334713e-13, 0.9999999791665050],
    "van-der-pol": [0.1706167732170483e1, -0.8928097010247975],
}


@pytest.mark.parametrize("name", sampled(PUBLISHED, fast={"oregonator"}))
def test_published_end_values(name):
    """Each component, however small it is; Robertson's rates cancel to nine digits of the state."""
    problem = PROBLEMS[name](**({"epsilon": 1e-6} if name == "van-der-pol" else {}))
    run = solve(
        problem, RADAU9, 1e-10, 1e-10 * np.abs(np.reshape(PUBLISHED[name], problem.y0.shape))
    )
    np.testing.assert_allclose(run.states[-1].reshape(-1), PUBLISHED[name], rtol=1e-8)
