"""How problems are drawn: all of them, finite, in their own terms, with exact differences."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from ropeode import Problem, simulate
from ropeode.laboratory import drawing_of, finite_samples
from ropeode.problems import PROBLEMS, ROPES
from ropeode.progress import silent

ROPE_LIKE = {"rope", "inextensible-rope", "oscillator", "linear-chain"}
# What each problem that was looked at is drawn as.
KINDS = {
    **dict.fromkeys(ROPE_LIKE, "rope"),
    **dict.fromkeys(("kepler", "henon-heiles", "arenstorf", "pleiades"), "orbit"),
    **dict.fromkeys(("pendulum", "double-pendulum"), "pendulum"),
    **dict.fromkeys(("forced", "van-der-pol", "lorenz"), "phase"),
    **dict.fromkeys(("robertson", "hires", "oregonator"), "phase"),
}


@pytest.mark.parametrize("kind", PROBLEMS)
def test_each_problem_is_drawn_as_what_it_is(kind):
    problem = PROBLEMS[kind](frames=3)
    drawing = drawing_of(problem)
    # States near the first one, of a bad run too.
    draw = np.random.default_rng(4).normal(size=(4, *problem.y0.shape))
    states = problem.y0 + 1e-3 * problem.scale * draw
    points = drawing.points(problem.ts, states)
    assert drawing.kind == KINDS[kind]
    count, fixed = len(drawing.nodes), list(drawing.fixed)
    assert (points.dtype, points.shape) == (np.float64, (4, count, 2))
    assert np.all(np.isfinite(points))
    assert drawing.axes[0]
    assert {*itertools.chain(*drawing.links), *fixed} <= {*range(count)}
    if kind in ROPES:
        assert (drawing.nodes, drawing.fixed) == (tuple(range(16)), (0,))
        return
    # What is fixed stays where it is, and what is not is a node.
    assert np.all(points[:, fixed] == points[0, fixed])
    if drawing.kind != "phase":
        assert [i for i, node in enumerate(drawing.nodes) if node is None] == fixed
        moved = drawing.points(problem.ts, states + problem.scale * draw)
        free = [i for i in range(count) if i not in fixed]
        assert np.all(np.any(moved[:, free] != points[:, free], axis=(0, 2)))


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
