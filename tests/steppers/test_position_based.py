"""Steppers that move links: what they converge to, and what they promise."""

from __future__ import annotations

import numpy as np
import pytest

from ropeode.errors import InputError
from ropeode.problems import InextensibleRope, Rope
from ropeode.simulation import simulate
from tests.steppers.ropes import SHAPE, in_space, sweep_links
from tests.verification.extrapolation import rope_solution

MASS, DAMPING = np.array(SHAPE["node_mass"]), np.array(SHAPE["damping"])
LINKS_OF_NODE = np.array([1, 2, 2, 2, 1])


def springs(**given):
    return in_space(Rope, **{"stiffness": (3, 2, 4.5, 1), **given}).problem(3)


def rigid(**given):
    return in_space(InextensibleRope, **given).problem(3)


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
    run = simulate(problem.changed(y0=y0), stepper, 4)
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


# --- steppers that keep lengths


UNIT = np.finfo(np.float64).eps
AS_ASSIGNED = "start=rest,damping=per-step"


def assignments_program(x, lengths, rope, steps, sweeps):
    """The report's program with constraints: sweep, then move; the last position is the swept.

    From rest, through a frame.
    """
    free = np.array([node not in rope.pinned for node in range(rope.num_nodes)])
    x, last = x.copy(), x
    for _ in range(steps):
        for _ in range(sweeps):
            sweep_links(x, lengths, free / np.array(rope.node_mass))
        move = (1 - rope.damping) * (x - last) + np.array(rope.gravity) / steps**2
        x, last = x + free[:, None] * move, x
    return x


@pytest.mark.parametrize(
    ("pins", "dim", "steps", "sweeps"),
    [((), 2, 1, 1), ((0, 1, 3), 2, 1, 1), ((0, 1, 2, 3, 4, 5), 2, 1, 1), ((0, 5), 3, 6, 3)],
)
def test_constraint_verlet_is_the_assignments_program_from_anywhere(pins, dim, steps, sweeps):
    random = np.random.default_rng([dim, len(pins)])
    x, lengths = random.normal(size=(6, dim)) * 5, random.uniform(10, 20, 5)
    rope = Rope(
        num_nodes=6, start=[0] * dim, end=[5] * dim, gravity=[-1] * dim, pinned=pins,
        node_mass=random.uniform(0.2, 5, 6), damping=0.3,
    )  # fmt: skip
    problem = rope.problem(frames=1)
    args = problem.args._replace(rest_length=lengths)
    anywhere = problem.changed(y0=np.stack([x.T, 0.0 * x.T]), args=args)
    found = simulate(anywhere, f"constraint-verlet:sweeps={sweeps},{AS_ASSIGNED}", steps).positions
    expected = assignments_program(x, lengths, rope, steps, sweeps)
    # Each of the five links is put back by a handful of roundings, of moves up to 30 long; a few
    # steps let them grow.
    np.testing.assert_allclose(found[1], expected, rtol=0, atol=64 * UNIT * 30 * steps**3)
    assert np.array_equal(found[1, list(pins)], x[list(pins)])


@pytest.mark.parametrize(("pinned", "steps"), [((0,), 64), ((2,), 16), ((0, 1), 16), ((), 16)])
def test_rattle_keeps_lengths_and_rates(pinned, steps):
    problem = in_space(InextensibleRope, pinned).problem(frames=4)
    run = simulate(problem, "rattle", steps)
    assert run.status == "ok"
    drift = problem.drift(run.states)
    # The iteration ends where the squares are right to 16 units, of lengths and positions.
    size = np.max(np.abs(run.positions)) + np.max(problem.args.rest_length)
    assert np.max(drift["position"]) <= 32 * UNIT * size
    assert np.max(drift["velocity"]) <= 32 * UNIT * (np.max(np.abs(run.velocities)) + 1)


@pytest.mark.parametrize(
    ("gravity", "status"), [(1e3, "unsolved"), (1e6, "unsolved"), (1e200, "diverged")]
)
def test_too_long_a_step_is_no_wrong_number(gravity, status):
    """No pull along the old links brings back what falls a hundred lengths in one step.

    Where that is so far that its square overflows, there is no equation to solve.
    """
    rope = InextensibleRope(start=(0, 0), end=(1, 0), num_nodes=4, gravity=(0, -gravity))
    problem = rope.problem(frames=3)
    run = simulate(problem, "rattle", 1)
    assert (run.status, run.diverged_at) == (status, 1)
    assert np.array_equal(run.states, problem.y0[None])


def test_nodes_that_coincide_are_finite():
    problem = Rope(num_nodes=4, start=(0, 0), end=(3, 0)).problem(frames=10)
    for places in ([0, 1, 1, 3], [0, 0, 0, 0]):
        collapsed = problem.changed(y0=problem.y0[..., places])
        assert simulate(collapsed, f"constraint-verlet:sweeps=3,{AS_ASSIGNED}", 16).status == "ok"


@pytest.mark.parametrize("label", ["constraint-verlet", "rattle"])
def test_one_free_node_falls(label):
    """There is no link to sweep over or to keep."""
    problem = InextensibleRope(num_nodes=1, pinned=(), damping=0.0).problem(frames=3)
    run = simulate(problem, label, 10)
    np.testing.assert_allclose(run.positions[:, 0, 1], 200 - problem.ts**2 / 2, rtol=1e-12)
