"""Several ropes in one run are what each of them is alone."""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from ropeode.errors import InputError
from ropeode.problems.inextensible_rope import InextensibleRope
from ropeode.problems.library import PROBLEMS, ROPES
from ropeode.problems.problem import Problem
from ropeode.problems.rope import Rope
from ropeode.simulation import simulate, simulate_side_by_side
from tests.steppers.every_variant import EVERY_VARIANT


def ropes(kind, frames=4, **given):
    """Three ropes that differ in all that ropes of one family may differ in."""
    numbers = {
        "num_nodes": 5,
        "start": (0, 0, 1),
        "end": (3, -1, 0.5),
        "initial_velocity": np.outer((0.5, 0, 0, 0.4, -0.2), (1, 3, 0)),
        **given,
    }
    more = [
        {"pinned": (1, 2), "damping": 0.1},
        {"pinned": (2,), "node_mass": (1, 2, 0.5, 1.5, 0.7), "end": (6, -2, 3)},
        {"pinned": (1,), "damping": (0.1, 0.2, 0.3, 0, 0.5), "gravity": (0.3, -2, 0)},
    ]
    if kind is Rope:
        more = [
            {**each, "stiffness": k} for each, k in zip(more, (3, 5, (1, 2, 3, 4)), strict=True)
        ]
    for each in more:
        v = np.array(numbers["initial_velocity"], dtype=float)
        if kind is InextensibleRope:
            # Across the rope, and still where it is pinned.
            along = np.subtract(each.get("end", numbers["end"]), numbers["start"])
            v = np.outer(v[:, 0], np.cross(along, (0.3, 0.2, 1)))
        v[list(each["pinned"])] = 0.0
        each["initial_velocity"] = v
    return [kind(**{**numbers, **each}).problem(frames) for each in more]


def assert_same(found, alone, ulps=0):
    """The same run but for the seconds; states within rounding units of their largest value."""
    assert found.problem is alone.problem
    assert (found.status, found.diverged_at) == (alone.status, alone.diverged_at)
    assert (found.stepper, found.steps_per_frame) == (alone.stepper, alone.steps_per_frame)
    assert found.dt == alone.dt
    assert found.rhs_evaluations == alone.rhs_evaluations
    assert np.array_equal(found.times, alone.times)
    assert found.states.shape == alone.states.shape
    allowed = ulps * np.finfo(np.float64).eps * np.max(np.abs(alone.states))
    assert np.max(np.abs(found.states - alone.states)) <= allowed


# How a stepper starts and damps is the same code on all ropes.
ON_ONE_KIND = [
    each for each in EVERY_VARIANT if each.label.count("=") and "sweeps" not in each.label
]
PAIRS = [
    *((each, Rope) for each in EVERY_VARIANT),
    *((each, InextensibleRope) for each in EVERY_VARIANT if each not in ON_ONE_KIND),
]


@pytest.mark.parametrize(
    ("stepper", "kind"), PAIRS, ids=[f"{each.label}-{kind.__name__}" for each, kind in PAIRS]
)
def test_every_stepper_on_every_kind_of_rope(stepper, kind):
    problems = ropes(kind)
    if refusal := stepper.refusal(problems[0]):
        with pytest.raises(InputError) as caught:
            simulate_side_by_side(problems, stepper, 16)
        assert caught.value.problems == (refusal,)
        return
    found = simulate_side_by_side(problems, stepper, 16)
    assert len(found) == 3
    for each, problem in zip(found, problems, strict=True):
        assert each.status == "ok"
        # To the bit; but all ropes make as many of Newton's iterations as the slowest needs,
        # and rounding makes each of them another last digit, which 64 steps may let grow.
        ulps = 100 if stepper.name == "rattle" else 0
        assert_same(each, simulate(problem, stepper, 16), ulps=ulps)
    assert len({each.states.tobytes() for each in found}) == 3


@pytest.mark.parametrize("frames", [103, 200])
@pytest.mark.parametrize("stepper", ["semi-implicit-euler", "stormer-verlet"])
def test_any_number_of_frames(frames, stepper):
    """Two-step methods carry their last positions over the frames where a run is looked at."""
    problems = [
        Rope(num_nodes=4, stiffness=k, damping=0.5).problem(frames=frames) for k in (50, 100, 3)
    ]
    seen = []
    found = simulate_side_by_side(problems, stepper, 20, progress=seen.append)
    for each, problem in zip(found, problems, strict=True):
        assert_same(each, simulate(problem, stepper, 20), ulps=1e5)
        assert len(each.times) == frames + 1
    assert seen == pytest.approx([100 / frames, 1.0])


def test_one_rope_that_diverges_leaves_the_others_alone():
    """Explicit Euler multiplies velocities by 1 - damping dt, here -5.7 and -2."""
    problems = [
        Rope(
            start=(0, 0), end=(3, 0), num_nodes=4, stiffness=k, damping=d, initial_velocity=(0, 1)
        ).problem(frames=250)
        for k, d in ((1, 0.5), (3, 200), (2, 0.6), (1, 90))
    ]
    seen = []
    found = simulate_side_by_side(problems, "explicit-euler", 30, progress=seen.append)
    alone = [simulate(problem, "explicit-euler", 30) for problem in problems]
    assert [each.status for each in alone] == ["ok", "diverged", "ok", "diverged"]
    # From 1 to 1.8e308, by 5.7 or 2 in each of the 30 steps of a frame.
    for each, factor in ((alone[1], 17 / 3), (alone[3], 2)):
        frame = np.log(np.finfo(np.float64).max) / np.log(factor) / 30
        assert each.diverged_at == pytest.approx(frame, abs=1.5)
    for each, other in zip(found, alone, strict=True):
        assert (each.status, each.diverged_at) == (other.status, other.diverged_at)
        assert each.rhs_evaluations == other.rhs_evaluations
        assert np.all(np.isfinite(each.states))
        assert each.states.shape == other.states.shape
    for rope in (0, 2):
        assert_same(found[rope], alone[rope], ulps=2000)
    assert seen == pytest.approx([0.4, 0.8, 1.0])


@pytest.mark.parametrize("stepper", ["rattle", "constraint-verlet", "rk4"])
def test_one_inextensible_rope_that_diverges_leaves_the_others_alone(stepper):
    """Its step is too long for the lengths to be kept; that of the others is not."""
    problems = [
        InextensibleRope(
            start=(0, 0), end=(3, 0), num_nodes=4, gravity=(0, -g), damping=0.5
        ).problem(frames=5)
        for g in (1.0, 1e5, 0.5)
    ]
    found = simulate_side_by_side(problems, stepper, 20)
    alone = [simulate(problem, stepper, 20) for problem in problems]
    assert [alone[0].status, alone[2].status] == ["ok", "ok"]
    assert stepper != "rattle" or alone[1].status == "diverged"
    for each, other in zip(found, alone, strict=True):
        assert (each.status, each.diverged_at) == (other.status, other.diverged_at)
    for rope in (0, 2):
        assert_same(found[rope], alone[rope], ulps=2000)


def test_a_run_in_which_all_diverge_stops_early():
    problems = [
        Rope(start=(0, 0), end=(3, 0), num_nodes=4, damping=d, initial_velocity=(0, 1)).problem(
            frames=10_000
        )
        for d in (200, 90)
    ]
    seen = []
    found = simulate_side_by_side(problems, "explicit-euler", 30, progress=seen.append)
    for each, problem in zip(found, problems, strict=True):
        alone = simulate(problem, "explicit-euler", 30)
        assert each.status == alone.status == "diverged"
        assert each.diverged_at == alone.diverged_at < 50
        assert each.rhs_evaluations == alone.rhs_evaluations
    # Looked at every hundred frames, it stops within the one where the last diverged.
    assert len(seen) == 1


@pytest.mark.parametrize("kind", ROPES.values(), ids=ROPES)
@pytest.mark.parametrize("stepper", ["rk4", "constraint-verlet", "rattle"])
def test_one_rope_alone_is_the_same_to_the_bit(kind, stepper):
    problem = ropes(kind)[0]
    (found,) = simulate_side_by_side([problem], stepper, 16)
    assert_same(found, simulate(problem, stepper, 16))


@pytest.mark.parametrize("kind", ROPES.values(), ids=ROPES)
@pytest.mark.parametrize("stepper", ["rk4", "constraint-verlet", "rattle"])
@pytest.mark.parametrize("nodes", [1, 2])
def test_very_short_ropes(kind, stepper, nodes):
    problems = [
        kind(
            start=(0, 0), end=(1, 0), num_nodes=nodes, pinned=list(range(nodes - 1)), damping=d
        ).problem(frames=2)
        for d in (0.0, 0.4)
    ]
    found = simulate_side_by_side(problems, stepper, 16)
    for each, problem in zip(found, problems, strict=True):
        assert_same(each, simulate(problem, stepper, 16), ulps=100)


def test_as_many_ropes_as_nodes():
    """No axis is taken for another where they are equally long."""
    problems = [
        Rope(num_nodes=3, start=(0, 0, 0), end=(1, 2, 3), stiffness=k, pinned=(pin,)).problem(2)
        for k, pin in ((3, 0), (4, 1), (5, 2))
    ]
    for each, problem in zip(simulate_side_by_side(problems, "rk4", 8), problems, strict=True):
        assert_same(each, simulate(problem, "rk4", 8), ulps=100)


def test_progress_rises_to_one():
    problems = [Rope(num_nodes=3, damping=0.5).problem(frames=250)] * 2
    seen = []
    simulate_side_by_side(problems, "semi-implicit-euler", 16, progress=seen.append)
    assert seen == pytest.approx([0.4, 0.8, 1.0])


def test_seconds_are_shared():
    problems = [Rope(num_nodes=3, damping=d).problem(frames=3) for d in (0.1, 0.2, 0.3)]
    simulate_side_by_side(problems, "rk4", 16)
    found = simulate_side_by_side(problems, "rk4", 16)
    assert len({each.seconds for each in found}) == 1
    assert found[0].seconds > 0
    assert [each.compile_seconds for each in found] == [0.0] * 3


@pytest.mark.parametrize(
    "other",
    [
        InextensibleRope(num_nodes=4).problem(frames=3),
        Rope(num_nodes=5).problem(frames=3),
        Rope(num_nodes=4).problem(frames=4),
        Rope(num_nodes=4, start=(0, 0, 0), end=(1, 2, 3)).problem(frames=3),
        *[make(frames=3) for name, make in PROBLEMS.items() if name not in ROPES],
    ],
    ids=lambda problem: f"{problem.name} {problem.y0.shape} {problem.frames}",
)
def test_mixed_families_are_refused(other):
    rope = Rope(num_nodes=4).problem(frames=3)
    for problems in ([rope, other], [other, rope]):
        with pytest.raises(InputError, match="problems: .* ropes of one kind") as caught:
            simulate_side_by_side(problems, "rk4", 16)
        (line,) = caught.value.problems
        assert other.name in line
        assert "as many nodes and the same sample times" in line
        assert "Fix: run them one by one with simulate" in line


def test_other_sample_times_are_refused():
    rope = Rope(num_nodes=4).problem(frames=3)
    later = dataclasses.replace(rope, ts=rope.ts + 0.5)
    with pytest.raises(InputError, match="the same sample times"):
        simulate_side_by_side([rope, later], "rk4", 16)


def test_what_is_no_row_of_nodes_is_refused(driven_pendulum):
    nodes = Problem.second_order(
        lambda t, x, v, args: -x, np.ones((2, 3)), np.zeros((2, 3)), [0.0, 1.0], node_axis=1
    )
    first_order = Problem(lambda t, y, args: -y * jnp.ones(2), [1.0, 2.0], [0.0, 1.0])
    for problem in (driven_pendulum, nodes, first_order):
        for problems in ([problem], [problem, problem]):
            with pytest.raises(InputError, match="problems: .* ropes of one kind"):
                simulate_side_by_side(problems, "rk4", 16)


def test_bad_input():
    rope = Rope(num_nodes=4).problem(frames=3)
    with pytest.raises(InputError, match="problems: .* at least one problem"):
        simulate_side_by_side([], "rk4", 16)
    with pytest.raises(InputError, match="stepper: 'rk5' given"):
        simulate_side_by_side([rope], "rk5", 16)
    with pytest.raises(InputError, match="steps_per_frame: 0 given"):
        simulate_side_by_side([rope], "rk4", 0)
    inextensible = InextensibleRope(num_nodes=4).problem(frames=3)
    with pytest.raises(InputError, match="depends on the velocity") as caught:
        simulate_side_by_side([inextensible] * 3, "stormer-verlet", 16)
    assert len(caught.value.problems) == 1
