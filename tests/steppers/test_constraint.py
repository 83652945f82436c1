"""Steppers that keep lengths: against the assignment's program, and what they promise."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest

from ropeode.problems import InextensibleRope, Rope
from ropeode.simulation import simulate
from tests.steppers.ropes import in_space

UNIT = np.finfo(np.float64).eps


def one_sweep(x, rest, pinned, mass):
    """The assignment's loop: each spring put back in turn; ``x`` is a list of points."""
    x = [list(point) for point in x]
    for i in range(len(x) - 1):
        a, b = x[i], x[i + 1]
        length = sum((q - p) ** 2 for p, q in zip(a, b, strict=True)) ** 0.5
        # How far each end moves, of the excess: by the other's part of the mass, if it is free.
        free_a, free_b = (0.0 if pinned[node] else 1 / mass[node] for node in (i, i + 1))
        of_a, of_b = (e / (free_a + free_b or 1.0) for e in (free_a, free_b))
        for c in range(len(a)):
            along = (b[c] - a[c]) / length
            excess = length - rest[i]
            a[c], b[c] = a[c] + of_a * excess * along, b[c] - of_b * excess * along
    return x


def assignments_program(rope, steps, frames, sweeps=1):
    """The report's program with constraints: sweep, then move; the last position is the swept.

    Of a rope at rest at the start.
    """
    start, end = np.array(rope.start), np.array(rope.end)
    x = [start + (end - start) * i / (rope.num_nodes - 1) for i in range(rope.num_nodes)]
    rest = [np.linalg.norm(b - a) for a, b in itertools.pairwise(x)]
    return program_from(x, rest, rope, steps, frames, sweeps)


def program_from(x, rest, rope, steps, frames, sweeps):
    """That program from any positions, with links of any lengths."""
    mass = np.broadcast_to(rope.node_mass, rope.num_nodes)
    last = [point.copy() for point in x]
    pinned = [node in rope.pinned for node in range(rope.num_nodes)]
    dt, shown = 1.0 / steps, [np.array(x)]
    for _ in range(frames):
        for _ in range(steps):
            for _ in range(sweeps):
                x = [np.array(point) for point in one_sweep(x, rest, pinned, mass)]
            for i in range(rope.num_nodes):
                if not pinned[i]:
                    here = x[i].copy()
                    move = (1 - rope.damping) * (x[i] - last[i]) + np.array(rope.gravity) * dt**2
                    x[i], last[i] = x[i] + move, here
        shown.append(np.array(x))
    return np.array(shown)


@pytest.mark.parametrize(("kind", "sweeps"), [(InextensibleRope, 1), (Rope, 3)])
def test_constraint_verlet_is_the_assignments_program(kind, sweeps):
    rope = kind(num_nodes=4)
    stepper = f"constraint-verlet:sweeps={sweeps},start=rest,damping=per-step"
    found = simulate(rope.problem(frames=10), stepper, 30)
    expected = assignments_program(rope, 30, 10, sweeps)
    # 300 steps with some rounding units of 400 (1e-13) in each; their growth is not known.
    np.testing.assert_allclose(found.positions, expected, rtol=0, atol=1e-9)
    assert np.max(np.abs(expected[-1] - expected[0])) > 20


@pytest.mark.parametrize(
    ("pins", "dim"), [((), 2), ((0, 5), 3), ((1, 2), 2), ((0, 1, 3), 2), ((0, 1, 2, 3, 4, 5), 2)]
)
def test_a_step_from_anywhere_is_the_assignments_program(pins, dim):
    random = np.random.default_rng([dim, len(pins)])
    x, rest = random.normal(size=(6, dim)) * 5, random.uniform(10, 20, 5)
    mass = random.uniform(0.2, 5, 6)
    rope = Rope(
        num_nodes=6, start=[0] * dim, end=[5] * dim, gravity=[-1] * dim, pinned=pins,
        node_mass=mass.tolist(),
    )  # fmt: skip
    problem = rope.problem(frames=1)
    anywhere = dataclasses.replace(
        problem,
        y0=np.stack([x.T, np.zeros((dim, 6))]),
        args=problem.args._replace(rest_length=rest),
    )
    stepper = "constraint-verlet:sweeps=1,start=rest,damping=per-step"
    found = simulate(anywhere, stepper, 1).positions
    expected = program_from(x, rest, rope, 1, 1, 1)
    # Each of the five links is put back by a handful of roundings, of moves up to 30 long.
    np.testing.assert_allclose(found, expected, rtol=0, atol=64 * UNIT * 30)
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
    assert np.array_equal(
        run.positions[:, list(pinned)], run.positions[:1, list(pinned)].repeat(5, 0)
    )
    assert not np.any(run.velocities[:, list(pinned)])


def test_rattle_is_time_reversible():
    problem = in_space(InextensibleRope, damping=0.0).problem(frames=3)
    there = simulate(problem, "rattle", 50).states
    turned = dataclasses.replace(problem, y0=there[-1] * np.array([1, -1]).reshape(2, 1, 1))
    back = simulate(turned, "rattle", 50).states
    np.testing.assert_allclose(back[::-1, 0], there[:, 0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(back[::-1, 1], -there[:, 1], rtol=0, atol=1e-9)
    assert np.max(np.abs(there[-1] - there[0])) > 0.5


@pytest.mark.parametrize(
    ("gravity", "status"), [(1e3, "unsolved"), (1e6, "unsolved"), (1e200, "diverged")]
)
def test_too_long_a_step_is_no_wrong_number(gravity, status):
    """No pull along the old links brings back what falls a hundred lengths in one step.

    Where that is so far that its square overflows, there is no equation to solve.
    """
    problem = InextensibleRope(
        start=(0, 0), end=(1, 0), num_nodes=4, gravity=(0.3 * gravity, -gravity)
    ).problem(frames=3)
    run = simulate(problem, "rattle", 1)
    assert (run.status, run.diverged_at) == (status, 1)
    assert np.array_equal(run.states, problem.y0[None])
    fine = InextensibleRope(start=(0, 0), end=(1, 0), num_nodes=4, gravity=(0.3, -1))
    assert simulate(fine.problem(frames=3), "rattle", 32).status == "ok"


def test_nodes_that_coincide_are_finite():
    problem = Rope(num_nodes=4, start=(0, 0), end=(3, 0)).problem(frames=10)
    two_at_one_point = problem.y0.copy()
    two_at_one_point[0, :, 2] = two_at_one_point[0, :, 1]
    for y0 in (two_at_one_point, np.zeros_like(problem.y0)):
        collapsed = dataclasses.replace(problem, y0=y0)
        stepper = "constraint-verlet:sweeps=3,start=rest,damping=per-step"
        assert simulate(collapsed, stepper, 16).status == "ok"


@pytest.mark.parametrize("label", ["constraint-verlet", "rattle"])
def test_one_free_node_falls(label):
    """There is no link to sweep over or to keep."""
    problem = InextensibleRope(num_nodes=1, pinned=(), damping=0.0).problem(frames=3)
    run = simulate(problem, label, 10)
    np.testing.assert_allclose(run.positions[:, 0, 1], 200 - problem.ts**2 / 2, rtol=1e-12)
