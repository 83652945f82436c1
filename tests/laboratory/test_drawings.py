"""How problems are drawn: all of them, finite, in their own terms, with exact differences."""

from __future__ import annotations

import numpy as np
import pytest

from ropeode import Problem, simulate
from ropeode.laboratory import drawing_of, finite_samples
from ropeode.problems import PICTURES, PROBLEMS, ROPES
from ropeode.progress import silent

# Each kind of picture that a problem of the library has.
KINDS = {
    "rope": "rope",
    "inextensible-rope": "rope",
    "oscillator": "rope",
    "linear-chain": "rope",
    "kepler": "orbit",
    "forced": "phase",
    "pendulum": "pendulum",
    "double-pendulum": "pendulum",
    "henon-heiles": "orbit",
    "arenstorf": "orbit",
    "pleiades": "orbit",
    "van-der-pol": "phase",
    "lorenz": "phase",
    "robertson": "phase",
    "hires": "phase",
    "oregonator": "phase",
}


def test_every_problem_of_the_library_has_a_picture_that_was_looked_at():
    assert set(KINDS) == set(PROBLEMS)
    assert set(PICTURES) <= set(PROBLEMS)


@pytest.mark.parametrize("kind", PROBLEMS)
def test_each_problem_is_drawn_as_what_it_is(kind):
    problem = PROBLEMS[kind](frames=3)
    drawing = drawing_of(problem)
    # States near the first one, of a bad run too.
    draw = np.random.default_rng(4).normal(size=(4, *problem.y0.shape))
    states = problem.y0 + 1e-3 * problem.scale * draw
    points = drawing.points(problem.ts, states)
    assert drawing.kind == KINDS[kind]
    assert points.dtype == np.float64
    count = len(drawing.nodes)
    assert points.shape == (4, count, 2)
    assert np.all(np.isfinite(points))
    assert all(drawing.axes[:1])
    assert all(0 <= i < count for pair in drawing.links for i in pair)
    assert all(0 <= i < count for i in drawing.fixed)
    if kind not in ROPES:
        # What is fixed stays where it is, and what is not is a node.
        assert np.all(points[:, list(drawing.fixed)] == points[0, list(drawing.fixed)])
        if drawing.kind != "phase":
            assert [i for i, node in enumerate(drawing.nodes) if node is None] == [*drawing.fixed]
            moved = drawing.points(problem.ts, states + problem.scale * draw)
            free = [i for i in range(count) if i not in drawing.fixed]
            assert np.all(np.any(moved[:, free] != points[:, free], axis=(0, 2)))
    elif kind in ROPES:
        assert drawing.nodes == tuple(range(16))
        assert drawing.fixed == (0,)


def test_rods_keep_their_lengths():
    for kind, lengths in (("pendulum", [3.0]), ("double-pendulum", [2.0, 0.5])):
        given = {"length": 3.0} if kind == "pendulum" else {"lengths": lengths}
        problem = PROBLEMS[kind](frames=4, **given)
        run = simulate(problem, "rk4", 8, progress=silent)
        points = drawing_of(problem).points(run.times, run.states)
        rods = np.linalg.norm(np.diff(points, axis=1), axis=2)
        np.testing.assert_allclose(rods, np.broadcast_to(lengths, rods.shape))
        # Hanging down is down.
        still = drawing_of(problem).points(problem.ts[:1], np.zeros((1, *problem.y0.shape)))
        assert still[0, -1].tolist() == [0.0, -sum(lengths)]


def test_problems_that_nobody_declared_are_drawn_by_their_shape():
    times = [0.0, 1.0, 2.0]
    free = {"acceleration": lambda t, x, v, args: -x, "ts": times}
    bodies = Problem.second_order(x0=np.ones((3, 2)), v0=np.zeros((3, 2)), **free)
    assert drawing_of(bodies).kind == "orbit"
    assert drawing_of(bodies).nodes == (0, 1, 2)
    line = Problem.second_order(x0=np.ones(5), v0=np.zeros(5), **free)
    drawn = drawing_of(line).points(line.ts[:1], line.y0[None])
    assert drawn[0].tolist() == [[0, 1], [1, 1], [2, 1], [3, 1], [4, 1]]
    one = Problem.second_order(x0=2.0, v0=3.0, **free)
    assert drawing_of(one).points(one.ts[:1], one.y0[None]).tolist() == [[[2.0, 3.0]]]
    decay = Problem(lambda t, y, args: -y, [1.0], times)
    states = np.array([[1.0], [0.5]])
    assert drawing_of(decay).points(decay.ts[:2], states)[:, 0].tolist() == [[0, 1.0], [1.0, 0.5]]
    assert drawing_of(decay).axes == ("time", "y0")


def test_samples_that_float32_cannot_hold_are_cut_off():
    values = np.array([1.0, 1e30, 1e39, 2.0])
    assert finite_samples(values) == 2
    assert finite_samples(values[:2], np.array([[1.0], [np.nan]])) == 1
