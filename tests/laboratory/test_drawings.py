"""How problems are drawn: all of them, finite, in their own terms, with exact differences."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from ropeode import Problem, simulate
from ropeode.laboratory import drawing_of, finite_samples
from ropeode.problems import PROBLEMS, ROPES
from ropeode.progress import silent

# What each problem that was looked at is drawn as.
KINDS = {
    "rope": {"rope", "inextensible-rope", "oscillator", "linear-chain"},
    "orbit": {"kepler", "henon-heiles", "arenstorf", "pleiades"},
    "pendulum": {"pendulum", "double-pendulum"},
    "phase": {"forced", "van-der-pol", "lorenz", "robertson", "hires", "oregonator"},
}


@pytest.mark.parametrize("kind", PROBLEMS)
def test_each_problem_is_drawn_as_what_it_is(kind):
    problem = PROBLEMS[kind](frames=3)
    drawing = drawing_of(problem)
    # States near the first one, of a bad run too.
    draw = np.random.default_rng(4).normal(size=(4, *problem.y0.shape))
    states = problem.y0 + 1e-3 * problem.scale * draw
    points = drawing.points(problem.ts, states)
    assert kind in KINDS[drawing.kind]
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
    for problem, lengths in (
        (PROBLEMS["pendulum"](frames=4, length=3.0), [3.0]),
        (PROBLEMS["double-pendulum"](frames=4, lengths=[2.0, 0.5]), [2.0, 0.5]),
    ):
        run = simulate(problem, "rk4", 8, progress=silent)
        points = drawing_of(problem).points(run.times, run.states)
        rods = np.linalg.norm(np.diff(points, axis=1), axis=2)
        np.testing.assert_allclose(rods, np.broadcast_to(lengths, rods.shape))
        # Hanging down is down.
        still = drawing_of(problem).points(problem.ts[:1], np.zeros((1, *problem.y0.shape)))
        assert still[0, -1].tolist() == [0.0, -sum(lengths)]


def mechanical(x0):
    x0 = np.asarray(x0, float)
    return Problem.second_order(lambda t, x, v, args: -x, x0, 0.0 * x0 + 3.0, [0.0, 1.0])


def first_order(y0):
    return Problem(lambda t, y, args: -y, y0, [1.0, 2.0])


@pytest.mark.parametrize(
    ("problem", "axes", "drawn"),
    [
        (mechanical([[1, 4, 5], [2, 6, 7]]), ("x", "y"), [[1, 4], [2, 6]]),
        (mechanical([5, 6]), ("node", "position"), [[0, 5], [1, 6]]),
        (mechanical(2), ("x", "v"), [[2, 3]]),
        (first_order([5.0, 6.0, 7.0]), ("y0", "y1"), [[5, 6]]),
        (first_order([5.0]), ("time", "y0"), [[1, 5]]),
    ],
)
def test_problems_that_nobody_declared_are_drawn_by_their_shape(problem, axes, drawn):
    drawing = drawing_of(problem)
    assert (drawing.axes, drawing.links) == (axes, ())
    assert drawing.points(problem.ts[:1], problem.y0[None])[0].tolist() == drawn


def test_samples_that_float32_cannot_hold_are_cut_off():
    assert finite_samples(np.array([1.0, 1e30, 1e39, 2.0]), np.ones((4, 1))) == 2
    assert finite_samples(np.ones(2), np.array([[1.0], [np.nan]])) == 1
