"""Implicit steppers: their linear equations, their iterations, and what they cost.

That each solves the equations of its method, test_formulas.py says; that ropes side by side move as
each of them alone, with as many iterations, tests/simulation/test_ensembles.py.
"""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from scipy import integrate

from ropeode.checking import undamped
from ropeode.problems import PROBLEMS, Problem, Rope
from ropeode.simulation import simulate
from ropeode.steppers import ProblemClass, as_stepper, by_family
from ropeode.theory import structure_of
from tests.theory.steps import WithMemory

IMPLICIT = [each.name for each in by_family()["implicit"]]


def linear(t, y, matrix):
    return matrix @ y


# --- linear equations


@pytest.mark.parametrize("size", [3, 8])
def test_a_matrix_with_zeros_on_its_diagonal_is_no_obstacle(size):
    """Of few unknowns and of many: it is that of ``1 - dt A``, whose rows must be exchanged."""
    matrix = np.roll(np.diag(np.arange(1.0, size + 1)), 1, axis=1)
    matrix[0] += 0.5 * (np.arange(size) > 0)
    start = np.arange(2.0, size + 2)
    problem = Problem(linear, start, [0.0, 1.0], np.eye(size) - matrix)
    run = simulate(problem, "implicit-euler:newton=1", 1)
    np.testing.assert_allclose(run.states[1], np.linalg.solve(matrix, start), rtol=1e-14)


@pytest.mark.parametrize("nodes", [2, pytest.param(1, marks=pytest.mark.slow)])
def test_the_shortest_ropes_move_as_by_a_dense_matrix(nodes):
    """Also where there is no neighbour for the blocks beside the diagonal."""
    problem = Rope(
        start=(0, 0), end=(1, 0), num_nodes=nodes, pinned=(), damping=0.3,
        initial_velocity=(0.3, 1.0),
    ).problem(frames=2)  # fmt: skip
    mechanics = dataclasses.replace(problem.mechanics, neighbours=False)
    both = problem, problem.changed(mechanics=mechanics)
    fast, dense = (simulate(each, "implicit-midpoint", 4) for each in both)
    assert fast.jacobian_evaluations == dense.jacobian_evaluations
    np.testing.assert_allclose(fast.states, dense.states, atol=1e-12)


def test_reductions_of_thousands_of_nodes_compile():
    problem = Rope(start=(0, 0), end=(-4000, 0), num_nodes=2100).problem(frames=1)
    assert simulate(problem, "implicit-euler", 2).status == "ok"


# --- stiff problems


def test_a_stiff_problem_is_solved():
    """With steps at which explicit methods diverge."""
    given = PROBLEMS["robertson"]()
    assert simulate(given, "rk4", 20).status == "diverged"
    run = simulate(given, "implicit-euler", 20)
    assert run.status == "ok"
    ivp = given.to_scipy()
    expected = integrate.solve_ivp(**ivp, method="Radau", jac=ivp["fun"].jac, rtol=1e-9, atol=1e-12)
    assert np.max(np.abs(run.states[-1] - expected.y[:, -1])) < 1e-6


@pytest.mark.parametrize("name", IMPLICIT)
def test_steps_of_the_test_equation_are_the_stability_function(name):
    """Also where the new state is smaller than the roundings of the old one."""
    for z in (-37.0 + 11.0j, *(size * (-0.3 - 2.0j) for size in (1e3, 1e7, 5.3e11))):
        matrix = np.array([[z.real, -z.imag], [z.imag, z.real]])
        run = simulate(Problem(linear, [1.0, 0.0], np.arange(4.0), matrix), name, 1)
        expected = {
            "implicit-euler": 1 / (1 - z),
            "implicit-midpoint": (1 + z / 2) / (1 - z / 2),
            "trapezium": (1 + z / 2) / (1 - z / 2),
            # The first step is one of the theta method.
            "bdf2": (1 + z / 3) / (1 - 2 / 3 * z),
            "gauss4": (1 + z / 2 + z**2 / 12) / (1 - z / 2 + z**2 / 12),
        }[name]
        assert run.status == "ok"
        assert abs(run.states[1] @ [1, 1j] - expected) < 1e-14


# --- iterations


def no_root(t, y, a):
    """``y' = 2 + y^2``: beyond a step of some length implicit Euler's equation has no root."""
    return 2.0 + y**2


def cube_roots(t, y, a):
    """They send each iterate of Newton's method to the other side, twice as far away."""
    return -jnp.cbrt(y - 1.0) * 1e9 - y


def infinite_derivative(t, y, a):
    """Newton's correction is zero there, and the state would stay for ever where it is."""
    return jnp.sqrt(y) + 1.0


FRAMES = np.arange(4.0)


@pytest.mark.parametrize(
    ("rhs", "start", "name", "steps"),
    [
        *((no_root, 0.0, name, 1) for name in (*IMPLICIT, "diffrax:ImplicitEuler")),
        (cube_roots, 1.5, "implicit-euler", 3),
        (infinite_derivative, 0.0, "implicit-euler", 8),
        pytest.param(infinite_derivative, 0.0, "gauss4", 8, marks=pytest.mark.slow),
    ],
)
def test_a_step_without_a_solution_is_unsolved(rhs, start, name, steps):
    problem = Problem(rhs, [start], FRAMES)
    run = simulate(problem, name, steps)
    assert (run.status, run.diverged_at) == ("unsolved", 1)
    assert np.all(np.isfinite(run.states))
    if rhs is infinite_derivative:
        # A single iteration is not asked whether it has solved anything.
        assert simulate(problem, f"{name}:newton=1", steps).status == "diverged"


def test_implicit_euler_is_unsolved_where_its_quadratic_equation_has_no_root():
    """``Y = y + dt (2 + Y^2)`` has roots where ``1 >= 4 dt (y + 2 dt)``."""
    for steps in (4, 7, 11, 20):
        dt, y, n = 1.0 / steps, 0.0, 0
        while 4 * dt * (y + 2 * dt) <= 1:
            y, n = (1 - np.sqrt(1 - 4 * dt * (y + 2 * dt))) / (2 * dt), n + 1
        run = simulate(Problem(no_root, [0.0], FRAMES), "implicit-euler", steps)
        assert (run.status, run.diverged_at) == ("unsolved", 1 + n // steps)


def test_a_run_that_overflows_by_itself_has_diverged():
    """Its equations are linear, and solved until there is no number left."""
    problem = Problem(lambda t, y, a: a * y, [1.0], np.arange(500.0), 3.0)
    run = simulate(problem, "implicit-euler", 4)
    assert run.status == "diverged"
    assert run.diverged_at == pytest.approx(np.log(1e150) / np.log(4.0) / 4, abs=1.5)


def test_evaluations_are_those_of_a_linear_problem():
    """Newton's method finds the root at once, and sees it in the next iteration."""
    problem = Problem(linear, [1.0, 2.0], FRAMES, -0.7 * np.eye(2))
    for name, of_rhs, of_jacobian in (
        ("implicit-euler", 30, 30),
        ("implicit-euler:newton=1", 15, 15),
        ("implicit-midpoint", 30, 30),
        ("trapezium", 45, 30),
        ("bdf2", 31, 30),
        ("gauss4", 60, 60),
        # A loop of JAX makes the evaluations, and nobody knows how many.
        ("diffrax:ImplicitEuler", None, None),
    ):
        run = simulate(problem, name, 5)
        assert (run.rhs_evaluations, run.jacobian_evaluations) == (of_rhs, of_jacobian)


class GivesUp(WithMemory):
    """A user's stepper in plain Python that stops iterating after its third step."""

    compiled = False

    def init(self, system, t, y, dt):
        return y, 0

    def step(self, system, t, carried, dt):
        y, n = carried
        return (y + dt * system.rhs(t, y) if n < 3 else np.nan * y), n + 1

    def solved(self, carried):
        return carried[1] <= 3


def test_a_users_stepper_says_whether_it_solved():
    run = simulate(Problem(lambda t, y, a: -y, [1.0], FRAMES), GivesUp(), 2)
    assert (run.status, run.diverged_at) == ("unsolved", 2)


def test_one_iteration_leaves_an_error_of_order_three_in_each_step():
    labels = ("implicit-euler:newton=1", "gauss4:newton=1")
    assert [as_stepper(each).order(ProblemClass()) for each in labels] == [1, 2]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["implicit-midpoint", "gauss4"])
def test_one_iteration_is_not_symplectic_and_says_so(name):
    """Nor does it keep quadratic invariants, as the whole step does."""
    for label, expected in ((name, True), (f"{name}:newton=1", False)):
        stepper = as_stepper(label)
        found = structure_of(undamped(), stepper, ["symplectic", "angular momentum"])
        assert stepper.symplectic is found["symplectic"].holds is expected
        assert found["angular momentum"].holds is expected
