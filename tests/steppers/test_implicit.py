"""Implicit steppers: their linear equations, their iterations, and what they cost."""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from scipy import integrate

from ropeode import accuracy_table, format_table
from ropeode.checking import undamped
from ropeode.precision import in_float64
from ropeode.problems import PROBLEMS, Ensemble, InextensibleRope, Problem, Rope
from ropeode.simulation import simulate
from ropeode.steppers import ProblemClass, Stepper, as_stepper, by_family
from ropeode.steppers.block_tridiagonal import (
    solve_block_tridiagonal,
    solve_neighbours,
    solve_small,
)
from ropeode.theory import structure_of

IMPLICIT = [each.name for each in by_family()["implicit"]]
EVERY = pytest.mark.parametrize("name", IMPLICIT)
FAST = [
    pytest.param(name, marks=() if name in ("implicit-euler", "gauss4") else pytest.mark.slow)
    for name in IMPLICIT
]

# The systems of two stages are compared with dense ones by test_a_node_alone_and_two_nodes.
IN_ONE_STAGE = [
    pytest.param(name, marks=() if name == "implicit-euler" else pytest.mark.slow)
    for name in IMPLICIT
]


def rope(**more):
    """A rope in three dimensions with unequal nodes."""
    given = {
        "start": (0.0, 0.0, 1.0),
        "end": (3.0, -1.0, 0.5),
        "num_nodes": 6,
        "node_mass": (1.0, 2.0, 0.5, 1.5, 0.7, 1.1),
        "stiffness": (30.0, 20.0, 45.0, 10.0, 25.0),
        "pinned": (0, 4),
        "gravity": (0.3, -1.0, 0.2),
        "damping": (0.1, 0.2, 0.3, 0.4, 0.5, 0.6),
        "initial_velocity": (0.4, 0.3, -0.2),
    }
    return Rope(**{**given, **more})


# --- linear equations


def blocks(rows, size, systems, seed):
    """Random blocks, of which those on the diagonal need an exchange of rows, and a right side."""
    rng = np.random.default_rng(seed)
    lower, upper = rng.normal(size=(2, rows, size, size, systems))
    diagonal = rng.normal(size=(rows, size, size, systems))
    # Large, but at the wrong places of each block.
    diagonal += 9.0 * np.roll(np.eye(size), 1, axis=0)[None, :, :, None]
    return lower, diagonal, upper, rng.normal(size=(rows, size, systems))


def dense(lower, diagonal, upper, system):
    """The whole matrix of one system."""
    rows, size = diagonal.shape[:2]
    matrix = np.zeros((rows, size, rows, size))
    for i in range(rows):
        matrix[i, :, i] = diagonal[i, :, :, system]
        if i > 0:
            matrix[i, :, i - 1] = lower[i, :, :, system]
        if i < rows - 1:
            matrix[i, :, i + 1] = upper[i, :, :, system]
    return matrix.reshape(rows * size, rows * size)


@pytest.mark.parametrize(("rows", "size", "systems"), [(7, 2, 3), (1, 3, 1), (2, 1, 2), (5, 6, 2)])
@in_float64
def test_block_tridiagonal_systems_are_solved_as_dense_ones(rows, size, systems):
    lower, diagonal, upper, right = blocks(rows, size, systems, seed=rows)
    found = np.asarray(solve_block_tridiagonal(*map(jnp.asarray, (lower, diagonal, upper, right))))
    for system in range(systems):
        matrix = dense(lower, diagonal, upper, system)
        expected = np.linalg.solve(matrix, right[..., system].reshape(-1))
        np.testing.assert_allclose(found[..., system].reshape(-1), expected, rtol=1e-11)


@pytest.mark.parametrize(("rows", "size", "systems"), [(7, 2, 3), (1, 3, 1), (2, 2, 2), (4, 3, 1)])
@in_float64
def test_the_matrix_of_a_map_between_neighbours_is_read_off(rows, size, systems):
    lower, diagonal, upper, right = blocks(rows, size, systems, seed=10 + rows)
    matrices = [dense(lower, diagonal, upper, system) for system in range(systems)]

    def linear(u):
        """Of arrays ``(size, rows, systems)``."""
        images = [
            (matrices[i] @ jnp.moveaxis(u[..., i], 0, 1).reshape(-1)).reshape(rows, size)
            for i in range(systems)
        ]
        return jnp.moveaxis(jnp.stack(images, axis=-1), 1, 0)

    right = np.moveaxis(right, 1, 0)
    found = np.asarray(solve_neighbours(linear, jnp.asarray(right)))
    np.testing.assert_allclose(linear(found), right, rtol=1e-10, atol=1e-12)


@in_float64
def test_small_systems_with_a_zero_pivot_are_solved():
    matrix = np.array([[0.0, 2.0, 1.0], [3.0, 0.0, 0.0], [1e-20, 1.0, 0.0]])
    right = np.array([[1.0, 4.0], [2.0, 5.0], [3.0, 6.0]])
    found = np.asarray(solve_small(jnp.asarray(matrix)[..., None], jnp.asarray(right)[..., None]))
    np.testing.assert_allclose(found[..., 0], np.linalg.solve(matrix, right), rtol=1e-14)


# --- ropes


def with_dense_jacobian(problem):
    """The same problem without the fact that only neighbours are coupled."""
    return problem.changed(mechanics=dataclasses.replace(problem.mechanics, neighbours=False))


@pytest.mark.parametrize("name", IN_ONE_STAGE)
def test_the_block_tridiagonal_and_the_dense_way_agree(name):
    problem = rope().problem(frames=2)
    fast, whole = (simulate(each, name, 7) for each in (problem, with_dense_jacobian(problem)))
    assert fast.jacobian_evaluations == whole.jacobian_evaluations
    np.testing.assert_allclose(fast.states, whole.states, rtol=1e-11, atol=1e-12)


@pytest.mark.parametrize("name", IN_ONE_STAGE)
@pytest.mark.parametrize("kind", ["rope", "plane", "inextensible"])
def test_ropes_side_by_side_move_as_each_alone(name, kind):
    """Also where one of them needs more iterations than the others."""
    if kind == "inextensible":
        problems = [
            InextensibleRope(
                start=(0, 0), end=(3, 1), num_nodes=4, gravity=(0, -g), damping=0.3
            ).problem(frames=2)
            for g in (1.0, 0.01, 1.5)
        ]
    else:
        dim = {"rope": 3, "plane": 2}[kind]
        cut = {
            "start": (0.0, 0.0, 1.0)[:dim],
            "end": (3.0, -1.0, 0.5)[:dim],
            "initial_velocity": (0.4, 0.3, -0.2)[:dim],
        }
        problems = [
            rope(**cut, gravity=tuple(g * np.array((0.3, -1.0, 0.2)[:dim]))).problem(frames=2)
            for g in (1.0, 0.01, 9.0)
        ]
    found = simulate(Ensemble.of(problems), name, 5)
    for each, problem in zip(found, problems, strict=True):
        alone = simulate(problem, name, 5)
        assert each.status == alone.status == "ok"
        assert each.jacobian_evaluations == alone.jacobian_evaluations
        assert each.rhs_evaluations == alone.rhs_evaluations
        np.testing.assert_allclose(each.states, alone.states, rtol=1e-10, atol=1e-11)
    assert found.jacobian_evaluations is not None
    assert len(set(found.jacobian_evaluations)) > 1


def test_a_stiff_rope_stays_bounded_at_steps_far_beyond_explicit_limits():
    problem = rope(stiffness=1e6).problem(frames=60)
    size = np.max(np.abs(problem.positions(problem.y0[None])))
    assert simulate(problem, "explicit-euler", 2).status == "diverged"
    for name in ("implicit-euler", "implicit-euler:newton=1"):
        run = simulate(problem, name, 2)
        assert run.status == "ok"
        assert np.max(np.abs(run.positions)) < 3 * size


# --- stiff problems

# Up to where the state jumps to the other branch.
SLOW_BRANCH = {"epsilon": 0.001, "duration": 0.6}


@pytest.mark.parametrize(
    ("problem", "numbers", "name", "steps", "tolerance"),
    [
        ("van-der-pol", SLOW_BRANCH, "bdf2", 4, 1e-3),
        pytest.param("van-der-pol", SLOW_BRANCH, "gauss4", 4, 1e-3, marks=pytest.mark.slow),
        ("hires", {}, "bdf2", 20, 0.001),
        pytest.param("hires", {}, "gauss4", 20, 0.001, marks=pytest.mark.slow),
        # Its frames grow, which two-step methods do not take.
        ("robertson", {}, "implicit-euler", 20, 1e-6),
    ],
)
def test_stiff_problems_are_solved(problem, numbers, name, steps, tolerance):
    """With steps at which explicit methods diverge."""
    given = PROBLEMS[problem](**numbers)
    assert simulate(given, "rk4", steps).status == "diverged"
    run = simulate(given, name, steps)
    assert run.status == "ok"
    ivp = given.to_scipy()
    expected = integrate.solve_ivp(**ivp, method="Radau", jac=ivp["fun"].jac, rtol=1e-9, atol=1e-12)
    found = run.states.reshape(len(run.states), -1).T
    assert np.max(np.abs(found[:, -1] - expected.y[:, -1])) < tolerance * np.max(np.abs(expected.y))


@EVERY
def test_one_step_of_the_test_equation_is_the_stability_function(name):
    z = -37.0 + 11.0j
    matrix = np.array([[z.real, -z.imag], [z.imag, z.real]])
    problem = Problem(lambda t, y, a: a @ y, [1.0, 0.0], [0.0, 1.0], matrix)
    found = simulate(problem, name, 1).states[1] @ [1, 1j]
    expected = {
        "implicit-euler": 1 / (1 - z),
        "implicit-midpoint": (1 + z / 2) / (1 - z / 2),
        "trapezium": (1 + z / 2) / (1 - z / 2),
        # The first step is one of the theta method.
        "bdf2": (1 + z / 3) / (1 - 2 / 3 * z),
        "gauss4": (1 + z / 2 + z**2 / 12) / (1 - z / 2 + z**2 / 12),
    }[name]
    assert abs(found - expected) < 1e-14
    assert abs(expected) <= 1


@EVERY
@pytest.mark.parametrize("size", [1e3, 1e7, 5.3e11])
def test_what_decays_at_once_is_solved(name, size):
    """The new state is smaller than the roundings of the old one."""
    matrix = size * np.array([[-0.3, -2.0], [2.0, -0.3]])
    problem = Problem(lambda t, y, a: a @ y, [1.0, 0.3], np.arange(4.0), matrix)
    assert simulate(problem, name, 1).status == "ok"


# --- iterations


def no_root():
    """``y' = 2 + y^2``: beyond a step of some length implicit Euler's equation has no root."""
    return Problem(lambda t, y, a: 2.0 + y**2, [0.0], np.arange(4.0))


@EVERY
def test_a_step_without_a_solution_is_unsolved(name):
    run = simulate(no_root(), name, 1)
    assert (run.status, run.diverged_at) == ("unsolved", 1)
    assert np.all(np.isfinite(run.states))
    assert run.lost == "was not solved at frame 1"
    linear = simulate(no_root(), f"{name}:newton=1", 1)
    assert linear.status != "unsolved"


def test_implicit_euler_is_unsolved_where_its_quadratic_equation_has_no_root():
    """``Y = y + dt (2 + Y^2)`` has roots where ``1 >= 4 dt (y + 2 dt)``."""
    for steps in (4, 7, 11, 20):
        dt, y, n = 1.0 / steps, 0.0, 0
        while 4 * dt * (y + 2 * dt) <= 1:
            y, n = (1 - np.sqrt(1 - 4 * dt * (y + 2 * dt))) / (2 * dt), n + 1
        run = simulate(no_root(), "implicit-euler", steps)
        assert (run.status, run.diverged_at) == ("unsolved", 1 + n // steps)


def test_a_slope_that_defeats_newtons_method_is_unsolved():
    """Its cube roots send each iterate to the other side, twice as far away."""
    problem = Problem(lambda t, y, a: -jnp.cbrt(y - 1.0) * 1e9 - y, [1.5], [0.0, 1.0, 2.0])
    assert simulate(problem, "implicit-euler", 3).status == "unsolved"


def test_a_run_that_overflows_by_itself_has_diverged():
    """Its equations are linear, and solved until there is no number left."""
    problem = Problem(lambda t, y, a: a * y, [1.0], np.arange(5.0), 3.0)
    run = simulate(problem, "implicit-euler:newton=1", 4)
    assert run.status == "ok"
    growth = Problem(lambda t, y, a: a * y, [1.0], np.arange(500.0), 3.0)
    run = simulate(growth, "implicit-euler", 4)
    assert run.status == "diverged"
    assert run.diverged_at == pytest.approx(np.log(1e150) / np.log(4.0) / 4, abs=1.5)


def driven_rope(strength):
    """A rope with a force that grows with the velocity's square, and ends in finite time."""
    own = rope(initial_velocity=(0.6, 0.4, 0.5)).problem(frames=3)

    def acceleration(t, x, v, args):
        numbers, strength = args
        springs = own.mechanics.acceleration(t, x, v, numbers)
        return springs + strength * v**2 * numbers.free

    return Problem.second_order(
        acceleration,
        own.y0[0],
        own.y0[1],
        own.ts,
        (own.args, np.full((1, 1), strength)),
        links=lambda args: own.mechanics.links(args[0]),
        node_axis=1,
        in_turn=True,
        neighbours=True,
    )


@pytest.mark.parametrize("name", FAST)
def test_an_infinite_derivative_is_unsolved(name):
    """Newton's correction is zero there, and the state would stay for ever where it is."""
    tank = Problem(lambda t, y, args: jnp.sqrt(y) + 1.0, [0.0], [0.0, 1.0, 2.0])
    run = simulate(tank, name, 8)
    assert (run.status, run.diverged_at) == ("unsolved", 1)
    assert simulate(tank, f"{name}:newton=1", 8).status == "diverged"


def test_a_rope_that_is_unsolved_leaves_the_others_alone():
    problems = [driven_rope(strength) for strength in (0.05, 3.0, 0.02)]
    alone = [simulate(problem, "implicit-midpoint", 3) for problem in problems]
    assert [each.status for each in alone] == ["ok", "unsolved", "ok"]
    family = Ensemble.of([problems[0].with_numbers(each.y0, each.args, {}) for each in problems])
    found = simulate(family, "implicit-midpoint", 3)
    for each, other in zip(found, alone, strict=True):
        assert (each.status, each.diverged_at) == (other.status, other.diverged_at)
        assert each.jacobian_evaluations == other.jacobian_evaluations
        np.testing.assert_allclose(each.states, other.states, rtol=1e-9, atol=1e-10)
    assert "none diverged, 1 unsolved" in repr(found)


def test_members_that_lie_in_lanes_have_each_its_status():
    problems = [
        Problem(lambda t, y, a: a + y**2, [0.0], np.arange(4.0), a) for a in (0.01, 2.0, 0.02)
    ]
    found = simulate(Ensemble.of(problems), "implicit-euler", 3)
    assert [each.status for each in found] == ["ok", "unsolved", "ok"]


def test_evaluations_are_those_of_a_linear_problem():
    """Newton's method finds the root at once, and sees it in the next iteration."""
    problem = Problem(lambda t, y, a: -a * y, [1.0, 2.0], [0.0, 1.0, 2.0, 3.0], 0.7)
    for name, of_rhs, of_jacobian in (
        ("implicit-euler", 30, 30),
        ("implicit-euler:newton=1", 15, 15),
        ("implicit-midpoint", 30, 30),
        ("trapezium", 45, 30),
        ("bdf2", 31, 30),
        ("gauss4", 60, 60),
        ("gauss4:newton=1", 30, 30),
        ("rk4", 60, 0),
    ):
        run = simulate(problem, name, 5)
        assert (run.rhs_evaluations, run.jacobian_evaluations) == (of_rhs, of_jacobian)


def test_diffrax_says_whether_it_solved():
    run = simulate(no_root(), "diffrax:ImplicitEuler", 1)
    assert (run.status, run.diverged_at) == ("unsolved", 1)
    assert run.rhs_evaluations is None
    assert run.jacobian_evaluations is None


def test_tables_say_which_runs_were_not_solved():
    """``y = sqrt(2) tan(sqrt(2) t)``; one step of this frame is too long, two are not."""
    problem = Problem(
        lambda t, y, a: 2.0 + y**2,
        [0.0],
        [0.0, 0.5],
        exact=lambda ts: np.sqrt(2) * np.tan(np.sqrt(2) * ts)[:, None],
    )
    table = accuracy_table(
        problem, steppers=["implicit-euler"], steps_per_frame=[1, 64, 128, 256, 512]
    )
    row, (found,) = table.rows[0], table.orders
    assert (row.status, row.diverged_at, row.error_max) == ("unsolved", 1, None)
    assert found.order.left_out[0].reason == "unsolved"
    assert found.order.observed == pytest.approx(1.0, abs=0.1)
    for form in ("text", "markdown", "latex", "csv", "json", "html"):
        assert "unsolved" in format_table(table, form)


class GivesUp(Stepper):
    """A user's stepper in plain Python that stops iterating after its third step."""

    compiled = False

    def init(self, system, t, y, dt):
        return y, 0

    def step(self, system, t, carried, dt):
        y, n = carried
        return (y + dt * system.rhs(t, y) if n < 3 else np.nan * y), n + 1

    def state(self, system, t, carried, dt):
        return carried[0]

    def solved(self, carried):
        return carried[1] <= 3


def test_a_users_stepper_says_whether_it_solved():
    problem = Problem(lambda t, y, a: -y, [1.0], np.arange(5.0))
    run = simulate(problem, GivesUp(), 2)
    assert (run.status, run.diverged_at) == ("unsolved", 2)


# --- facts


@EVERY
def test_declared_orders(name):
    stepper = as_stepper(name)
    own = {"implicit-euler": 1, "gauss4": 4}.get(name, 2)
    for problem_class in (ProblemClass(), ProblemClass(damped=True, at_rest=False)):
        assert stepper.order(problem_class) == own
        assert as_stepper(f"{name}:newton=1").order(problem_class) == min(own, 2)
    assert stepper.symplectic is (name in ("implicit-midpoint", "gauss4"))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["implicit-midpoint", "gauss4"])
def test_one_iteration_is_not_symplectic_and_says_so(name):
    for label, expected in ((name, True), (f"{name}:newton=1", False)):
        stepper = as_stepper(label)
        found = structure_of(undamped(), stepper, ["symplectic"])
        assert not isinstance(found, str)
        assert stepper.symplectic is found["symplectic"].holds is expected


def test_gauss_and_midpoint_keep_quadratic_invariants():
    """Of a rope that flies freely: its angular momentum about the origin."""
    problem = Rope(
        start=(0, 0), end=(3, 1), num_nodes=4, pinned=(), gravity=(0, 0), damping=0.0,
        node_mass=(1.0, 2.0, 0.5, 1.5), initial_velocity=((1, 0), (0, 2), (-1, 1), (0.3, 0)),
    ).problem(frames=6)  # fmt: skip

    def drift(name):
        run = simulate(problem, name, 3)
        x, v = run.positions, run.velocities
        momentum = np.sum(
            np.array([1.0, 2.0, 0.5, 1.5]) * (x[..., 0] * v[..., 1] - x[..., 1] * v[..., 0]), axis=1
        )
        return np.max(np.abs(momentum - momentum[0]))

    assert drift("implicit-midpoint") < 1e-11
    assert drift("gauss4") < 1e-11
    assert drift("implicit-euler") > 1e-3


@pytest.mark.parametrize("nodes", [2, pytest.param(1, marks=pytest.mark.slow)])
def test_a_node_alone_and_two_nodes(nodes):
    problem = Rope(
        start=(0, 0), end=(1, 0), num_nodes=nodes, pinned=(), damping=0.3,
        initial_velocity=(0.3, 1.0),
    ).problem(frames=2)  # fmt: skip
    fast = simulate(problem, "gauss4", 4)
    np.testing.assert_allclose(
        fast.states, simulate(with_dense_jacobian(problem), "gauss4", 4).states, atol=1e-12
    )


def test_reductions_of_thousands_of_nodes_compile():
    problem = Rope(start=(0, 0), end=(-4000, 0), num_nodes=2100).problem(frames=1)
    assert simulate(problem, "implicit-euler", 2).status == "ok"
