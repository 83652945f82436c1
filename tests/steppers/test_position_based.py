"""What the graphics steppers converge to, with more iterations and with smaller steps."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.optimize import root

from ropeode.errors import InputError
from ropeode.precision import in_float64
from ropeode.problems import InextensibleRope, Rope
from ropeode.simulation import simulate
from tests.verification.extrapolation import inextensible_rope_solution, rope_solution

NODES = 5
MASS, DAMPING = np.array([1.0, 2, 0.5, 1.5, 0.7]), np.array([0.1, 0.2, 0.3, 0.4, 0.5])
SHAPE = {"start": (0, 0, 1), "end": (3, -1, 0.5), "num_nodes": NODES, "gravity": (0.3, -1, 0.2)}
LINKS_OF_NODE = np.array([1, 2, 2, 2, 1])


def springs(mass=MASS, damping=DAMPING, stiffness=(3, 2, 4.5, 1), **given):
    # Across the rope, and not equal.
    velocity = np.outer((0.5, 0, -0.2, 0.1, 0.4), (1.0, 3.0, 0.0))
    given = {"pinned": (1,), "initial_velocity": velocity, **given}
    return Rope(**SHAPE, node_mass=mass, damping=damping, stiffness=stiffness, **given).problem(3)


def rigid(mass=MASS, damping=DAMPING):
    velocity = np.outer((0.5, 0, -0.2, 0.1, 0.4), (1.0, 3.0, 0.0))
    own = {"node_mass": mass, "damping": damping, "pinned": (1,), "initial_velocity": velocity}
    return InextensibleRope(**SHAPE, **own).problem(3)


def implicit_euler(problem, steps):
    """``v = v_old + dt a(x_old + dt v, v)`` with the whole acceleration, solved for v: a frame."""
    dt = 1.0 / steps

    @in_float64
    def acceleration(x, v):
        return np.asarray(problem.mechanics.acceleration(0.0, x, v, problem.args))

    x, v = problem.y0
    for _ in range(steps):

        def wrong(w, x=x, v=v):
            w = w.reshape(x.shape)
            return (w - v - dt * acceleration(x + dt * w, w)).ravel()

        v = root(wrong, v.ravel(), tol=1e-14).x.reshape(x.shape)
        x = x + dt * v
    return np.stack([x, v])


@pytest.mark.parametrize("steps", [1, 7])
def test_projective_dynamics_to_the_end_is_implicit_euler(steps):
    # Soft enough for the iterations to settle at the long step.
    problem = springs(stiffness=(0.3, 0.2, 0.45, 0.1))
    run = simulate(problem, "projective-dynamics:iterations=400", steps)
    np.testing.assert_allclose(run.states[1], implicit_euler(problem, steps), rtol=0, atol=1e-11)


@pytest.mark.parametrize(
    ("stepper", "order"),
    [
        ("xpbd", 2),
        ("xpbd:iterations=100", 2),
        pytest.param("xpbd:sweep=jacobi", 2, marks=pytest.mark.slow),
        pytest.param("xpbd:iterations=100,sweep=jacobi", 2, marks=pytest.mark.slow),
        ("projective-dynamics", 2),
        pytest.param("projective-dynamics:iterations=2", 4, marks=pytest.mark.slow),
    ],
)
def test_how_near_implicit_euler_they_are(stepper, order):
    """So near that its error is theirs; but XPBD, its iterations to the end, is another method."""
    problem = springs()
    coarse, fine = (
        np.max(np.abs(simulate(problem, stepper, n).states[1] - implicit_euler(problem, n)))
        for n in (20, 40)
    )
    assert np.log2(coarse / fine) == pytest.approx(order, abs=0.25)
    assert coarse > 1e-8


@pytest.mark.parametrize("iterations", [1, 3])
@pytest.mark.parametrize("sweep", ["gauss-seidel", "averaged"])
def test_substeps_are_steps(iterations, sweep):
    stepper, problem = f"xpbd:iterations={iterations},sweep={sweep}", springs()
    found = simulate(problem, f"{stepper},substeps=3", 5)
    np.testing.assert_allclose(found.states, simulate(problem, stepper, 15).states, atol=1e-12)


@pytest.mark.parametrize("sweep", ["gauss-seidel", "jacobi", "averaged"])
def test_rigid_links_have_no_compliance(sweep):
    """On them XPBD is position-based dynamics, and that is what the latter makes of springs."""
    options, each = f"iterations=2,sweep={sweep}", 20
    expected = simulate(rigid(), f"pbd:{options}", each).states
    assert np.array_equal(simulate(rigid(), f"xpbd:{options}", each).states, expected)
    assert np.array_equal(simulate(springs(), f"pbd:{options}", each).states, expected)


@pytest.mark.parametrize(
    ("stepper", "problem"),
    [
        ("pbd:sweep=averaged", rigid),
        pytest.param("pbd:iterations=4,sweep=averaged", rigid, marks=pytest.mark.slow),
        ("xpbd:sweep=averaged", springs),
        pytest.param("xpbd:iterations=4,sweep=averaged", springs, marks=pytest.mark.slow),
        pytest.param("xpbd:substeps=2,sweep=averaged", springs, marks=pytest.mark.slow),
    ],
)
def test_averaged_moves_are_those_of_another_rope(stepper, problem):
    """Each node's mass is multiplied by its number of links; its damping rate stays."""
    other = problem(MASS * LINKS_OF_NODE, DAMPING * LINKS_OF_NODE)
    solution = inextensible_rope_solution if problem is rigid else rope_solution
    truth, own_truth = (solution(each).astype(float) for each in (other, problem()))
    runs = [simulate(problem(), stepper, steps) for steps in (320, 640)]
    coarse, fine = (np.max(np.abs(run.states - truth)) for run in runs)
    assert np.log2(coarse / fine) == pytest.approx(1.0, abs=0.05)
    assert np.max(np.abs(runs[-1].states - own_truth)) > 4 * fine


@pytest.mark.parametrize("nodes", [3, 5])
@pytest.mark.parametrize("iterations", [1, 2, 3, 4])
def test_lengths_under_jacobi_grow_as_predicted(nodes, iterations):
    """On a straight rope: ``c_new = S (2 c - c_old)``, with S from all links' masses at once."""
    weight = np.array([0.0, 1.0, 0.5, 2.0, 1.0])[:nodes]
    across = np.diff(np.eye(nodes), axis=0)
    matrix = across @ np.diag(weight) @ across.T
    one = np.eye(nodes - 1) - matrix @ np.diag(1 / np.diag(matrix))
    power = np.linalg.matrix_power(one, iterations)
    block = np.block([[2 * power, -power], [np.eye(nodes - 1), np.zeros_like(power)]])
    predicted = np.max(np.abs(np.linalg.eigvals(block)))
    frames = 40
    mass = [1.0 if w == 0 else 1 / w for w in weight]
    rope = InextensibleRope(
        start=(0, 0), end=(0, -(nodes - 1)), num_nodes=nodes, node_mass=mass, gravity=(0, -1e-30),
        damping=0,
    ).problem(frames)  # fmt: skip
    # Errors far below the roundings of lengths near 1 are lost: begin with larger ones.
    y0 = rope.y0.copy()
    y0[0, 1, 1:] += 1e-12 * np.cos(3.0 * np.arange(1, nodes))
    run = simulate(dataclasses.replace(rope, y0=y0), f"pbd:sweep=jacobi,iterations={iterations}", 1)
    gaps = np.linalg.norm(np.diff(run.positions, axis=1), axis=2) - 1.0
    size = np.max(np.abs(gaps), axis=1)
    assert (predicted > 1.0) == (iterations % 2 == 1)
    if predicted < 1.0:
        assert np.max(size[20:]) < 1e-12
        return
    late = np.flatnonzero((size > 1e-9) & (size < 1e-4))
    measured = (size[late[-1]] / size[late[0]]) ** (1 / (late[-1] - late[0]))
    assert measured == pytest.approx(predicted, rel=0.01)


@pytest.mark.parametrize(
    "stepper", ["xpbd", "xpbd:sweep=jacobi", "xpbd:sweep=averaged", "projective-dynamics"]
)
def test_springs_without_a_direction_do_not_pull(stepper):
    """All nodes at one point: each falls by itself, with the velocity at the end of each step."""
    for nodes in (1, 4):
        problem = Rope(
            start=(0, 0), end=(1, 2), gravity=(0, -1), damping=0.2, num_nodes=nodes, pinned=(),
            node_mass=0.5,
        ).problem(2)  # fmt: skip
        y0 = np.zeros_like(problem.y0)
        y0[0] = [[1.0], [2.0]]
        problem = dataclasses.replace(problem, y0=y0)
        run = simulate(problem, stepper, 4)
        v, x = 0.0, 2.0
        for _ in range(8):
            v = (v - 0.25) / (1 + 0.25 * 0.4)
            x += 0.25 * v
        np.testing.assert_allclose(run.positions[-1], np.tile([1.0, x], (nodes, 1)), rtol=1e-14)


def test_a_taut_rope_of_springs_is_for_those_that_let_it_stretch():
    problem = springs(pinned=(0, 4), initial_velocity=np.zeros((5, 3)))
    for stepper in ("xpbd", "projective-dynamics"):
        assert simulate(problem, stepper, 20).status == "ok"
    with pytest.raises(InputError, match="taut between the pinned nodes 0 and 4"):
        simulate(problem, "pbd", 20)


def test_projective_dynamics_needs_springs():
    with pytest.raises(InputError) as caught:
        simulate(rigid(), "projective-dynamics", 4)
    (line,) = caught.value.problems
    assert "whose links are springs, and 'inextensible rope' has rigid ones" in line
    assert "Fix:" in line
