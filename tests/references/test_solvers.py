"""The adaptive solvers that references are made with."""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from ropeode.problems import Problem, Rope
from ropeode.references import (
    DOPRI8,
    KVAERNO5,
    OWN_DOP853,
    SCIPY_BDF,
    SCIPY_DOP853,
    SCIPY_RADAU,
    Solver,
    solve,
    taylor,
)
from tests.references.scalar_problems import scalar

SOLVERS = (DOPRI8, KVAERNO5, SCIPY_DOP853, SCIPY_RADAU, SCIPY_BDF)
EXPLICIT = (DOPRI8, SCIPY_DOP853)
every_solver = pytest.mark.parametrize("solver", SOLVERS, ids=str)


def solved(solver, problem, rtol, max_steps=100_000):
    return solve(problem, solver, rtol, rtol, max_steps=max_steps)


TS = (0.0, 0.3, 1.0, 1.1, 2.0, 4.0)


def logistic(t):
    return 1 / (1 + 9 * np.exp(-np.asarray(t)))[:, None]


@every_solver
def test_solves_at_the_sample_times(solver):
    rtol = 1e-12 if solver in EXPLICIT else 1e-9
    run = solved(solver, scalar("logistic", 0.1, TS), rtol)
    assert run.solver == solver
    assert run.failure is None
    np.testing.assert_allclose(run.states, logistic(TS), rtol=0, atol=30 * rtol)


@pytest.mark.parametrize(
    "solver",
    [DOPRI8, pytest.param(SCIPY_DOP853, marks=pytest.mark.slow)],
    ids=str,
)
def test_samples_are_steps_and_no_interpolation(solver):
    # Sampled at a hundred times: were samples interpolated, many would be worse.
    for ts in 0.04 * np.arange(1, 101).reshape(25, 4):
        problem = scalar("logistic", 0.1, [0.0, *ts, 4.5])
        run = solved(solver, problem, 1e-12)
        assert np.max(np.abs(run.states - logistic(problem.ts))) < 5e-12


@pytest.mark.parametrize("longest", [None, np.array([0.1, 0.2, 0.3, 0.1, 0.3, 0.5])])
def test_one_program_for_up_to_eight_samples(longest):
    """The steps to the earlier samples do not depend on how many come after them."""
    eight = dataclasses.replace(scalar("logistic", 0.1, TS), ts=np.array([*TS, 4.5, 6.0]))
    solver = {"max_steps": 1000}
    if longest is not None:
        solver["longest_steps"] = np.append(longest, 0.2)
    whole = solve(eight, DOPRI8, 1e-9, 1e-9, **solver)
    for samples in (7, 6, 5):
        if longest is not None:
            solver["longest_steps"] = longest[: samples - 1]
        fewer = dataclasses.replace(eight, ts=eight.ts[:samples])
        run = solve(fewer, DOPRI8, 1e-9, 1e-9, **solver)
        assert run.states.tobytes() == whole.states[:samples].tobytes()
        assert run.steps < whole.steps
        assert run.compile_seconds == 0.0


@pytest.mark.parametrize("jumps", [(), (1.0,), (1.0, 1.1)])
def test_each_frame_has_its_own_longest_step(jumps):
    """In a short frame after a long one too, and after a jump between them."""
    problem = scalar("decay", 1.0, TS, jump_times=jumps)
    steps = np.array([20, 20, 90, 20, 20])
    run = solve(problem, DOPRI8, 1e-6, 1e-6, max_steps=1000, longest_steps=np.diff(TS) / steps)
    assert run.failure is None
    # Steps grow by no more than a factor of ten at a time, at the start and after short ones.
    assert np.sum(steps) <= run.steps <= np.sum(steps) + 20


def test_rounding_leaves_no_rest_of_a_frame():
    """It would be a step of its own, after which others have to grow, or which ends the run."""
    ts, steps = np.linspace(0.0, 700.0, 701), 7
    problem = Problem(lambda t, y, args: -y, [1.0], ts)
    run = solve(problem, DOPRI8, 1e-6, 1e-6, max_steps=10**5, longest_steps=np.diff(ts) / steps)
    assert run.failure is None
    assert 700 * steps <= run.steps <= 700 * steps + 10


@pytest.mark.slow
def test_dense_output_would_be_worse():
    import diffrax
    import jax

    with jax.enable_x64(True):
        problem = Rope().problem(frames=20)
        tight = solve(problem, DOPRI8, 1e-13, 1e-13, max_steps=10**5)
        clipped = solve(problem, DOPRI8, 1e-12, 1e-12, max_steps=10**5)
        free = diffrax.diffeqsolve(
            diffrax.ODETerm(problem.rhs),
            diffrax.Dopri8(),
            0.0,
            20.0,
            None,
            jnp.asarray(problem.y0),
            jax.tree.map(jnp.asarray, problem.args),
            saveat=diffrax.SaveAt(ts=jnp.asarray(problem.ts)),
            stepsize_controller=diffrax.PIDController(rtol=1e-12, atol=1e-12),
            max_steps=10**5,
        )
        error = {
            "clipped": np.max(np.abs(clipped.states - tight.states)),
            "interpolated": np.max(np.abs(np.asarray(free.ys) - tight.states)),
        }
    assert error["interpolated"] > 5 * error["clipped"]


def saw_exact(ts):
    def piece(y, slope, span):
        return 2 * slope + (y - 2 * slope) * np.exp(-span / 2)

    at1 = piece(1.0, 1.0, 0.37)
    at2 = piece(at1, -2.0, 2.0 - 0.37)
    return np.array(
        [
            piece(1.0, 1.0, t)
            if t < 0.37
            else piece(at1, -2.0, t - 0.37)
            if t < 2
            else piece(at2, 5.0, t - 2.0)
            for t in ts
        ]
    )[:, None]


@pytest.mark.parametrize(
    "solver",
    [
        pytest.param(solver, marks=pytest.mark.slow if solver == KVAERNO5 else (), id=str(solver))
        for solver in SOLVERS
    ],
)
def test_steps_land_on_jumps(solver):
    """At 0.37, and at a sample time, 2."""
    ts = np.array([0.0, 0.2, 0.6, 1.0, 2.0, 3.0])
    problem = scalar("saw", 1.0, ts, jump_times=[0.37, 2.0])
    rtol = 1e-12 if solver in EXPLICIT else 1e-9
    run = solved(solver, problem, rtol)
    np.testing.assert_allclose(run.states, saw_exact(ts), rtol=0, atol=30 * rtol)
    if solver in EXPLICIT:
        undeclared = solved(solver, dataclasses.replace(problem, jump_times=()), rtol)
        assert run.steps < undeclared.steps


def test_the_compiled_method_is_scipys_but_for_rounding():
    for problem in (scalar("logistic", 0.1, TS), scalar("follows", 0.0, TS, -3.0)):
        compiled = solve(problem, OWN_DOP853, 1e-10, 1e-12, max_steps=1000)
        scipys = solve(problem, SCIPY_DOP853, 1e-10, 1e-12, max_steps=1000)
        assert compiled.failure is None
        # The first step is chosen in another way.
        assert abs(compiled.steps - scipys.steps) <= 3
        np.testing.assert_allclose(compiled.states, scipys.states, rtol=0, atol=1e-10)


def test_the_compiled_method_in_many_calls():
    """Between two calls, of some thousand steps each, it reads the clock."""
    problem = scalar("follows", 0.0, 3e3 * np.array(TS), -3.0)
    run = solve(problem, OWN_DOP853, 1e-10, 1e-10, max_steps=100_000)
    assert run.steps > 10_000
    np.testing.assert_allclose(run.states[:, 0], np.sin(problem.ts), atol=1e-9)


@pytest.mark.parametrize(
    ("name", "y0", "limits", "reason"),
    [
        ("square", 1.0, {}, "t = 1: the step size has become too small"),
        ("root of what is left", 0.0, {}, "t = 1: the step size has become too small"),
        ("follows", 0.0, {"max_steps": 5}, "5 steps did not suffice"),
        ("follows", 0.0, {"seconds": 0.0}, "its time was up"),
    ],
)
def test_why_the_compiled_method_stops(name, y0, limits, reason):
    problem = scalar(name, y0, TS, 1.0)
    run = solve(problem, OWN_DOP853, 1e-10, 1e-10, **{"max_steps": 5000, **limits})
    assert reason in run.failure
    assert run.ran_out == bool(limits)
    assert np.all(np.isfinite(run.states))
    assert len(run.states) < len(TS)


@every_solver
def test_a_pole_ends_the_run_before_it(solver):
    problem = scalar("square", 1.0, [0.0, 0.4, 0.8, 1.0, 1.2, 2.0])
    run = solved(solver, problem, 1e-8)
    assert run.steps < 3000
    assert run.failure.startswith("stopped after t = 1: ")
    assert "step size" in run.failure
    assert run.reached == pytest.approx(1.0, abs=1e-6)
    assert len(run.states) <= 4 or np.all(np.abs(run.states[3:]) > 1e3)
    np.testing.assert_allclose(run.states[:3, 0], 1 / (1 - problem.ts[:3]), rtol=1e-5)


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


@every_solver
def test_not_a_number_is_not_a_success(solver):
    problem = scalar("root of what is left", 0.0, [0.0, 0.25, 0.5, 1.0, 3.0, 4.0])
    run = solved(solver, problem, 1e-8, max_steps=3000)
    assert run.failure
    assert len(run.states) < 5
    assert np.all(np.isfinite(run.states))


@every_solver
def test_the_budget_is_kept(solver):
    run = solved(solver, scalar("logistic", 0.1, TS), 1e-10, max_steps=3)
    assert run.steps <= 4
    assert len(run.states) < len(TS)
    assert "step" in run.failure


@pytest.mark.parametrize(
    "solver", [*SOLVERS, OWN_DOP853, taylor(113)], ids=lambda solver: solver.library
)
def test_a_file_names_each_solver(solver):
    assert Solver.parse(str(solver)) == solver


def test_one_compilation_serves_a_ladder():
    runs = [
        solve(Rope(num_nodes=4, damping=damping).problem(frames=3), DOPRI8, rtol, rtol)
        for damping in (0.01, 0.2)
        for rtol in (1e-6, 1e-8)
    ]
    assert [run.compile_seconds for run in runs[1:]] == [0.0, 0.0, 0.0]
