"""The adaptive solvers that references are made with."""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from ropeode.problems.problem import Problem
from ropeode.problems.rope import Rope
from ropeode.references.solvers import diffrax_program, diffrax_solver, program_cache, scipy_solver

SOLVERS = {
    **{f"diffrax {name}": (diffrax_solver, name) for name in diffrax_program.SOLVERS},
    **{f"SciPy {name}": (scipy_solver, name) for name in scipy_solver.SOLVERS},
}
EXPLICIT = ("diffrax Dopri8", "SciPy DOP853")


def solve(name, problem, rtol, max_steps=100_000):
    module, solver = SOLVERS[name]
    return module.solve(problem, solver, rtol, rtol, max_steps=max_steps)


def logistic(ts=(0.0, 0.3, 1.0, 1.1, 4.0)):
    ts = np.asarray(ts)
    return Problem(
        lambda t, y, args: y * (1 - y), [0.1], ts, exact=lambda t: 1 / (1 + 9 * np.exp(-t))[:, None]
    )


@pytest.mark.parametrize("name", SOLVERS)
def test_solves_at_the_sample_times(name):
    problem = logistic()
    rtol = 1e-12 if name in EXPLICIT else 1e-9
    run = solve(name, problem, rtol)
    assert run.solver == name
    assert run.failure is None
    np.testing.assert_allclose(run.states, problem.exact(problem.ts), rtol=0, atol=30 * rtol)


@pytest.mark.parametrize("name", EXPLICIT)
def test_samples_are_steps_and_no_interpolation(name):
    # Sampled once and a hundred times: were samples interpolated, many would be worse.
    few, many = logistic([0.0, 4.0]), logistic(np.linspace(0, 4, 101))
    for problem in (few, many):
        run = solve(name, problem, 1e-12)
        assert np.max(np.abs(run.states - problem.exact(problem.ts))) < 5e-12


def test_dense_output_would_be_worse():
    import diffrax
    import jax

    with jax.enable_x64(True):
        problem = Rope().problem(frames=20)
        tight = diffrax_solver.solve(problem, "Dopri8", 1e-13, 1e-13, max_steps=10**5)
        clipped = diffrax_solver.solve(problem, "Dopri8", 1e-12, 1e-12, max_steps=10**5)
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


def saw(t, y, args):
    """A right-hand side that jumps at 0.37 and at a sample time, 2."""
    slope = jnp.where(t < 0.37, 1.0, jnp.where(t < 2.0, -2.0, 5.0))
    return slope * jnp.ones(1) - 0.5 * y


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


@pytest.mark.parametrize("name", SOLVERS)
def test_steps_land_on_jumps(name):
    ts = np.array([0.0, 0.2, 1.0, 2.0, 3.0])
    problem = Problem(saw, [1.0], ts, jump_times=[0.37, 2.0])
    rtol = 1e-12 if name in EXPLICIT else 1e-9
    run = solve(name, problem, rtol)
    np.testing.assert_allclose(run.states, saw_exact(ts), rtol=0, atol=30 * rtol)
    if name in EXPLICIT:
        undeclared = solve(name, dataclasses.replace(problem, jump_times=()), rtol)
        assert run.steps < undeclared.steps


@pytest.mark.parametrize("name", SOLVERS)
def test_a_pole_ends_the_run_before_it(name):
    problem = Problem(lambda t, y, args: y**2, [1.0], np.linspace(0.0, 2.0, 21))
    run = solve(name, problem, 1e-8, max_steps=3000)
    assert run.failure
    assert "stopped after t" in run.failure
    assert len(run.states) <= 10 or np.all(np.abs(run.states[10:]) > 1e3)
    np.testing.assert_allclose(run.states[:9, 0], 1 / (1 - problem.ts[:9]), rtol=1e-5)


@pytest.mark.parametrize("name", SOLVERS)
def test_not_a_number_is_not_a_success(name):
    problem = Problem(lambda t, y, args: jnp.sqrt(1.0 - t) * jnp.ones(1), [0.0], [0.0, 0.5, 1.0, 3])
    run = solve(name, problem, 1e-8, max_steps=3000)
    assert run.failure
    assert len(run.states) < 4
    assert np.all(np.isfinite(run.states))


@pytest.mark.parametrize("name", SOLVERS)
def test_the_budget_is_kept(name):
    run = solve(name, logistic(), 1e-10, max_steps=3)
    assert run.steps <= 4
    assert len(run.states) < 5
    assert "step" in run.failure


def test_one_compilation_serves_a_ladder():
    program_cache._compiled.cache_clear()
    for damping in (0.01, 0.2):
        problem = Rope(num_nodes=3, damping=damping).problem(frames=2)
        for rtol in (1e-6, 1e-8):
            diffrax_solver.solve(problem, "Dopri8", rtol, rtol, max_steps=1000)
    assert program_cache._compiled.cache_info().misses == 1
