"""Steppers that keep lengths: against the assignment's program, and what they promise."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest

from ropeode.problems import Ensemble, InextensibleRope, Rope
from ropeode.simulation import simulate
from tests.verification.extrapolation import EPS, inextensible_rope_solution

SLOW = pytest.mark.slow
UNIT = np.finfo(np.float64).eps


def one_sweep(x, rest, pinned, mass=None):
    """The assignment's loop: each spring put back in turn; ``x`` is a list of points."""
    x = [list(point) for point in x]
    for i in range(len(x) - 1):
        a, b = x[i], x[i + 1]
        length = sum((q - p) ** 2 for p, q in zip(a, b, strict=True)) ** 0.5
        if pinned[i] and pinned[i + 1]:
            of_a = of_b = 0.0
        elif pinned[i]:
            of_a, of_b = 0.0, 1.0
        elif pinned[i + 1]:
            of_a, of_b = 1.0, 0.0
        elif mass is None:
            of_a = of_b = 0.5
        else:
            of_a, of_b = mass[i + 1] / (mass[i] + mass[i + 1]), mass[i] / (mass[i] + mass[i + 1])
        for c in range(len(a)):
            along = (b[c] - a[c]) / length
            excess = length - rest[i]
            a[c], b[c] = a[c] + of_a * excess * along, b[c] - of_b * excess * along
    return x


def assignments_program(rope, steps, frames, sweeps=1):
    """The report's program with constraints: sweep, then move; the last position is the swept.

    Equal masses, of a rope at rest at the start.
    """
    start, end = np.array(rope.start), np.array(rope.end)
    x = [start + (end - start) * i / (rope.num_nodes - 1) for i in range(rope.num_nodes)]
    rest = [np.linalg.norm(b - a) for a, b in itertools.pairwise(x)]
    return program_from(x, rest, rope, steps, frames, sweeps)


def program_from(x, rest, rope, steps, frames, sweeps, mass=None):
    """That program from any positions, with links of any lengths."""
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


@pytest.mark.parametrize(
    ("kind", "sweeps"),
    [
        (InextensibleRope, 1),
        (Rope, 3),
        *(pytest.param(*each, marks=SLOW) for each in ((Rope, 1), (InextensibleRope, 3))),
    ],
)
def test_constraint_verlet_is_the_assignments_program(kind, sweeps):
    rope = kind(num_nodes=4)
    stepper = f"constraint-verlet:sweeps={sweeps},start=rest,damping=per-step"
    found = simulate(rope.problem(frames=10), stepper, 30)
    expected = assignments_program(rope, 30, 10, sweeps)
    # 300 steps with some rounding units of 400 (1e-13) in each; their growth is not known.
    np.testing.assert_allclose(found.positions, expected, rtol=0, atol=1e-9)
    assert np.max(np.abs(expected[-1] - expected[0])) > 20


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("own_masses", [False, True])
@pytest.mark.parametrize("pins", [(), (0,), (2,), (0, 5), (1, 2), (0, 1, 3), (0, 1, 2, 3, 4, 5)])
def test_a_step_from_anywhere_is_the_assignments_program(dim, own_masses, pins):
    random = np.random.default_rng([dim, len(pins)])
    x, rest = random.normal(size=(6, dim)) * 5, random.uniform(10, 20, 5)
    mass = random.uniform(0.2, 5, 6) if own_masses else np.ones(6)
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
    expected = program_from(x, rest, rope, 1, 1, 1, mass)
    # Each of the five links is put back by a handful of roundings, of moves up to 30 long.
    np.testing.assert_allclose(found, expected, rtol=0, atol=64 * UNIT * 30)
    assert np.array_equal(found[1, list(pins)], x[list(pins)])


def test_velocities_are_differences_of_swept_positions():
    rope = InextensibleRope(num_nodes=4)
    stepper = "constraint-verlet:start=rest,damping=per-step"
    fine = simulate(rope.problem(frames=10), stepper, 8)
    dt, rest = 1 / 8, rope.lengths()
    pinned = [True, False, False, False]
    positions = assignments_program(
        InextensibleRope(num_nodes=4, gravity=(0, -1 / 64), damping=0.01), 1, 25
    )
    before, after = (np.array(one_sweep(positions[n], rest, pinned)) for n in (23, 25))
    np.testing.assert_allclose(positions[24], fine.positions[3], rtol=0, atol=1e-10)
    np.testing.assert_allclose(fine.velocities[3], (after - before) / (2 * dt), atol=1e-9)


def moving(**given):
    """A rope in space with its own mass for each node, whose velocities stretch no link."""
    along = np.array([3.0, -1.0, -0.5])
    across = np.cross(along, [(0.1, 0.2, 0.3), (1, -1, 0.4)])
    v = np.outer((0, 0.4, -0.2, 0.3, 0.1), across[0]) + np.outer((0, -0.1, 0.2, 0, 0.3), across[1])
    pinned = given.get("pinned", (0,))
    v[list(pinned)] = 0.0
    return InextensibleRope(
        **{
            "start": (0, 0, 1),
            "end": (3, -1, 0.5),
            "num_nodes": 5,
            "node_mass": (1, 2, 0.5, 1.5, 0.7),
            "gravity": (0.3, -1, 0.2),
            "damping": (0.1, 0.2, 0.3, 0, 0.5),
            "initial_velocity": v,
            **given,
        }
    )


@pytest.mark.parametrize("pinned", [(0,), (2,), (0, 1), ()])
@pytest.mark.parametrize("steps", [16, 64])
def test_rattle_keeps_lengths_and_rates(pinned, steps):
    problem = moving(pinned=pinned).problem(frames=4)
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


@pytest.mark.skipif(EPS > 2e-19, reason="np.longdouble is no wider than float64 here")
@pytest.mark.parametrize(
    ("label", "order"),
    [
        ("rattle", 2),
        ("constraint-verlet", 1),
        pytest.param("constraint-verlet:sweeps=2", 1, marks=SLOW),
    ],
)
@pytest.mark.parametrize("pinned", [(0,), pytest.param((0, 1), marks=SLOW)])
def test_orders_in_positions_and_velocities(label, order, pinned):
    problem = moving(pinned=pinned).problem(frames=3)
    truth = inextensible_rope_solution(problem).astype(np.float64)
    wrong = []
    for steps in (400, 800):
        states = simulate(problem, label, steps).states
        wrong.append(np.max(np.abs(states - truth), axis=(0, 2, 3)))
    # The next term of the error is smaller by a factor of the order of the step size.
    np.testing.assert_allclose(np.log2(wrong[0] / wrong[1]), order, atol=0.1)
    assert np.max(wrong[1]) < 0.1


def test_rattle_is_time_reversible():
    problem = moving(damping=0.0).problem(frames=3)
    there = simulate(problem, "rattle", 50).states
    turned = dataclasses.replace(problem, y0=there[-1] * np.array([1, -1]).reshape(2, 1, 1))
    back = simulate(turned, "rattle", 50).states
    np.testing.assert_allclose(back[::-1, 0], there[:, 0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(back[::-1, 1], -there[:, 1], rtol=0, atol=1e-9)
    assert np.max(np.abs(there[-1] - there[0])) > 0.5


@SLOW
def test_rattle_keeps_its_energy_for_long():
    """A symplectic method's energy error does not grow; it falls with the step size's square."""
    problem = moving(damping=0.0).problem(frames=400)
    worst = {}
    for steps in (50, 100):
        energies = problem.energies(simulate(problem, "rattle", steps).states)
        off = np.abs(energies - energies[0])
        worst[steps] = np.max(off)
        assert np.max(off[300:]) < 3 * np.max(off[:100])
    assert worst[50] / worst[100] == pytest.approx(4, rel=0.5)
    kinetic = 0.5 * np.sum(problem.args.mass * np.sum(problem.y0[1] ** 2, axis=0))
    assert worst[100] < 0.01 * kinetic


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


def test_of_ropes_side_by_side_the_one_whose_lengths_are_lost_is_unsolved():
    problems = [
        InextensibleRope(start=(0, 0), end=(1, 0), num_nodes=4, gravity=(0.3, -g)).problem(frames=2)
        for g in (1.0, 1e3, 0.5)
    ]
    found = simulate(Ensemble.of(problems), "rattle", 8)
    assert [run.status for run in found] == ["ok", "unsolved", "ok"]
    assert found[1].diverged_at == 1
    for run, problem in zip(found, problems, strict=True):
        alone = simulate(problem, "rattle", 8)
        assert (run.status, run.diverged_at) == (alone.status, alone.diverged_at)
        np.testing.assert_allclose(run.states, alone.states, rtol=0, atol=1e-11)


@pytest.mark.parametrize("sweeps", [3, pytest.param(1, marks=SLOW)])
def test_nodes_that_coincide_are_finite(sweeps):
    problem = Rope(num_nodes=4, start=(0, 0), end=(3, 0)).problem(frames=10)
    y0 = problem.y0.copy()
    y0[0, :, 2] = y0[0, :, 1]
    collapsed = dataclasses.replace(problem, y0=y0)
    stepper = f"constraint-verlet:sweeps={sweeps},start=rest,damping=per-step"
    assert simulate(collapsed, stepper, 16).status == "ok"
    everything = dataclasses.replace(problem, y0=np.zeros_like(y0))
    assert simulate(everything, stepper, 16).status == "ok"


@pytest.mark.parametrize(
    "label",
    ["constraint-verlet", "rattle", pytest.param("constraint-verlet:sweeps=3", marks=SLOW)],
)
def test_one_free_node_falls(label):
    """There is no link to sweep over or to keep."""
    problem = InextensibleRope(num_nodes=1, pinned=(), damping=0.0).problem(frames=3)
    run = simulate(problem, label, 10)
    np.testing.assert_allclose(run.positions[:, 0, 1], 200 - problem.ts**2 / 2, rtol=1e-12)
