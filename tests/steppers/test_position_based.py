"""What the graphics steppers converge to, with more iterations and with smaller steps."""

from __future__ import annotations

import dataclasses

import jax
import numpy as np
import pytest
from scipy.optimize import root

from ropeode.errors import InputError
from ropeode.problems import InextensibleRope, Rope
from ropeode.simulation import simulate
from tests.steppers.ropes import SHAPE, in_space
from tests.verification.extrapolation import rope_solution

MASS, DAMPING = np.array(SHAPE["node_mass"]), np.array(SHAPE["damping"])
LINKS_OF_NODE = np.array([1, 2, 2, 2, 1])


def springs(**given):
    return in_space(Rope, **{"stiffness": (3, 2, 4.5, 1), **given}).problem(3)


def rigid(**given):
    return in_space(InextensibleRope, **given).problem(3)


def implicit_euler(problem, steps):
    """``v = v_old + dt a(x_old + dt v, v)`` with the whole acceleration, solved for v: a frame."""
    dt = 1.0 / steps
    acceleration = jax.jit(lambda x, v: problem.mechanics.acceleration(0.0, x, v, problem.args))
    x, v = problem.y0

    def wrong(w):
        w = w.reshape(x.shape)
        return (w - v - dt * np.asarray(acceleration(x + dt * w, w))).ravel()

    for _ in range(steps):
        with jax.enable_x64(True):
            v = root(wrong, v.ravel(), tol=1e-14).x.reshape(x.shape)
        x = x + dt * v
    return np.stack([x, v])


def test_projective_dynamics_to_the_end_is_implicit_euler():
    # Soft enough for the iterations to settle at the long step.
    problem = springs(stiffness=(0.3, 0.2, 0.45, 0.1))
    for steps in (1, 7):
        run = simulate(problem, "projective-dynamics:iterations=400", steps)
        expected = implicit_euler(problem, steps)
        np.testing.assert_allclose(run.states[1], expected, rtol=0, atol=1e-11)


def test_rigid_links_have_no_compliance():
    """On them XPBD is position-based dynamics, and that is what the latter makes of springs."""
    pbd, xpbd = (f"{name}:iterations=3,sweep=averaged" for name in ("pbd", "xpbd"))
    expected = simulate(rigid(), pbd, 20).states
    assert np.array_equal(simulate(rigid(), xpbd, 20).states, expected)
    assert np.array_equal(simulate(springs(), pbd, 20).states, expected)


@pytest.mark.parametrize(
    ("stepper", "problem"), [("pbd:sweep=averaged", rigid), ("xpbd:sweep=averaged", springs)]
)
def test_averaged_moves_are_those_of_another_rope(stepper, problem):
    """Each node's mass is multiplied by its number of links; its damping rate stays."""
    other = problem(node_mass=MASS * LINKS_OF_NODE, damping=DAMPING * LINKS_OF_NODE)
    truth, own_truth = (rope_solution(each).astype(float) for each in (other, problem()))
    runs = [simulate(problem(), stepper, steps) for steps in (320, 640)]
    coarse, fine = (np.max(np.abs(run.states - truth)) for run in runs)
    assert np.log2(coarse / fine) == pytest.approx(1.0, abs=0.05)
    assert np.max(np.abs(runs[-1].states - own_truth)) > 4 * fine


@pytest.mark.parametrize(
    "stepper", ["xpbd", "xpbd:sweep=jacobi", "xpbd:sweep=averaged", "projective-dynamics"]
)
def test_springs_without_a_direction_do_not_pull(stepper):
    """All nodes at one point: each falls by itself, with the velocity at the end of each step."""
    rope = Rope(start=(0, 0), end=(1, 2), damping=0.2, num_nodes=4, pinned=(), node_mass=0.5)
    problem = rope.problem(2)
    y0 = np.zeros_like(problem.y0)
    y0[0] = [[1.0], [2.0]]
    run = simulate(dataclasses.replace(problem, y0=y0), stepper, 4)
    v, x = 0.0, 2.0
    for _ in range(8):
        v = (v - 0.25) / (1 + 0.25 * 0.4)
        x += 0.25 * v
    np.testing.assert_allclose(run.positions[-1], [[1.0, x]] * 4, rtol=1e-14)


def test_links_of_the_wrong_kind_are_refused():
    taut = springs(pinned=(0, 4))
    for stepper in ("xpbd", "projective-dynamics"):
        assert simulate(taut, stepper, 20).status == "ok"
    for stepper in ("pbd", "constraint-verlet", "rattle"):
        with pytest.raises(InputError, match="taut between the pinned nodes 0 and 4"):
            simulate(taut, stepper, 20)
    with pytest.raises(InputError, match="springs, and 'inextensible rope' has rigid ones.* Fix:"):
        simulate(rigid(), "projective-dynamics", 4)
