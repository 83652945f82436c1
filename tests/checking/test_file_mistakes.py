"""Right samples that are written wrongly: the mistake is named, and nothing else is."""

from __future__ import annotations

import re

import numpy as np
import pytest
from trajectory_writing import WRITERS, node_values, write_npz, write_runs

from ropeode import grade
from ropeode.errors import InputError
from ropeode.problems import Rope
from ropeode.simulation import simulate
from tests.exact_reference import rope_reference
from tests.sampled import sampled

STEPS = (24, 48, 96)
FRAMES = 3


@pytest.fixture(scope="module")
def runs(small_rope):
    """Right samples: at the frames and one more, and at each step of the coarsest run."""
    longer = Rope(num_nodes=4).problem(FRAMES + 1)
    return {n: node_values(longer, simulate(longer, "velocity-verlet", n).states) for n in STEPS}


def written(folder, runs, change, suffix=".npz", **how):
    """Files of what a change makes of the times, values and step size of a run."""
    paths = []
    for n in STEPS:
        times, values, dt = change(np.arange(FRAMES + 1.0), runs[n], 1 / n)
        paths.append(WRITERS[suffix](folder / f"{n}{suffix}", times, values, dt, **how))
    return paths


def mistake(made, problem):
    """What a grade says of the files: of samples that begin elsewhere it is a refusal."""
    try:
        (diagnosis,) = grade(made, problem).diagnosis
    except InputError as error:
        return str(error)
    return diagnosis.line


def numbers(change):
    """A change of the numbers alone."""
    return lambda t, v, dt: (t, change(v[:-1], dt), dt)


def after(first, rest):
    return np.concatenate([first, rest])


COLUMNS = {
    "column vx holds vy and column vy holds vx": lambda v, dt: v[..., [0, 1, 3, 2]],
    "column x holds y and column y holds x": lambda v, dt: v[..., [1, 0, 3, 2]],
    "x points the other way": lambda v, dt: v * [-1, 1, -1, 1],
    "the velocities have the wrong sign": lambda v, dt: v * [1, 1, -1, -1],
    "the columns hold the velocities before the positions": lambda v, dt: v[..., [2, 3, 0, 1]],
    "the columns of the velocities hold positions": lambda v, dt: v[..., [0, 1, 0, 1]],
    "the velocities are zero": lambda v, dt: v * [1, 1, 0, 0],
    "the nodes of the velocities are in reverse order": lambda v, dt: np.dstack(
        [v[..., :2], v[:, ::-1, 2:]]
    ),
    "velocities are dt times those of the problem: per step": lambda v, dt: v * [1, 1, dt, dt],
    "velocities are 24 times those of the problem": lambda v, dt: v * [1, 1, 24, 24],
    "all numbers are 100 times those of the problem": lambda v, dt: 100.0 * v,
    "the nodes are in reverse order": lambda v, dt: v[:, ::-1],
    "positions are shifted by (1, 2)": lambda v, dt: v + np.array([1, 2, 0, 0]),
    # As where the initial state is written by other lines than the rest.
    "after the first row, x points the other way": lambda v, dt: after(
        v[:1], v[1:] * [-1, 1, -1, 1]
    ),
    "after the first row, the nodes are in reverse order": lambda v, dt: after(v[:1], v[1:, ::-1]),
}


TIMES = {
    "each row is one frame late: the first, at t = 0, holds the state at t = 1": lambda t, v, dt: (
        (t, v[1:], dt)
    ),
    "each row is one frame early: the initial state is written at t = 1 once more": (
        lambda t, v, dt: (t, v[[0, 0, 1, 2]], dt)
    ),
    "the initial state is missing: the first row is that at t = 1": lambda t, v, dt: (
        (t[1:], v[1:-1], dt)
    ),
    "the initial state is written at t = 1, and each row as much too late": lambda t, v, dt: (
        (t + 1, v[:-1], dt)
    ),
    "one unit of t in the files is 24 of the problem's, and velocities are 24 times those of the "
    "problem": lambda t, v, dt: (t / 24, v[:-1] * [1, 1, 24, 24], dt / 24),
    "the initial state is written at t = dt, and each row as much": lambda t, v, dt: (
        (t + dt, v[:-1], dt)
    ),
    "t counts steps": lambda t, v, dt: (t / dt, v[:-1], dt),
}


MISTAKES = {**{words: numbers(change) for words, change in COLUMNS.items()}, **TIMES}


def one_step(dt):
    """The state after the first step of velocity Verlet."""
    problem = Rope(num_nodes=4).problem(1).changed(ts=np.array([0.0, dt]))
    return node_values(problem, simulate(problem, "velocity-verlet", 1).states)[1:]


FEW_DIGITS = {
    # In seconds with four decimals, a frame is 0.0417.
    "one unit of t in the files is 24 of the problem's": lambda t, v, dt: (
        (np.round(t / 24, 4), v[:-1], dt / 24)
    ),
    # What is mirrored at 480 has no more digits than the file.
    "y points the other way and positions are shifted by (0, 480)": numbers(
        lambda v, dt: v * [1, -1, 1, -1] + [0, 480, 0, 0]
    ),
}
# Of these nobody can say that the rest is right.
STARTS = {
    "the nodes are placed at i/4 of the way in place of i/3: 4 nodes have 3 gaps": numbers(
        lambda v, dt: after(v[:1, :1] + 0.75 * (v[:1] - v[:1, :1]), v[1:])
    ),
    "the nodes are placed at (i + 1)/5 of the way": numbers(
        lambda v, dt: after(
            v[:1, :1] + 0.6 * (v[:1] - v[:1, :1]) + 0.2 * (v[:1, -1:] - v[:1, :1]), v[1:]
        )
    ),
    "; it is right in single precision. Fix: compute it in double": numbers(
        lambda v, dt: after(v[:1].astype(np.float32), v[1:])
    ),
    "the first row is the state after the first step": numbers(
        lambda v, dt: after(one_step(dt), v[1:])
    ),
    "Fix: start from the initial state": numbers(lambda v, dt: v + np.arange(4.0)[:, None]),
    "all rows of a file are the same. Fix: write a copy": numbers(lambda v, dt: v[[3, 3, 3, 3]]),
}


# They take longest, and differ from others by when they begin alone.
LONG = {
    "after the first row, x points the other way",
    "each row is one frame early: the initial state is written at t = 1 once more",
}
EVERY = {**MISTAKES, **FEW_DIGITS, **STARTS}


@pytest.mark.parametrize("words", sampled(EVERY, fast={*EVERY} - LONG))
def test_a_mistake_is_named_and_so_read_the_runs_are_right(tmp_path, known, runs, words):
    change = EVERY[words]
    how = {"suffix": ".csv", "digits": "%.7g"} if words in FEW_DIGITS else {}
    found = mistake(written(tmp_path, runs, change, **how), known)
    assert words in found
    assert ("positions order 2.0" in found) == (words in MISTAKES)


def test_momenta(tmp_path):
    masses = np.array([1.0, 2.0, 0.5, 3.0])
    rope = Rope(num_nodes=4, node_mass=masses.tolist()).problem(FRAMES)
    own = {n: node_values(rope, simulate(rope, "velocity-verlet", n).states) for n in STEPS}
    times = after(np.ones((2, 4)), np.stack([masses, masses])).T
    files = written(tmp_path, own, lambda t, v, dt: (t, v * times, dt))
    assert "velocities are multiplied by the masses" in mistake(files, rope_reference(rope))


def test_the_report_names_the_mistake_once(tmp_path, known, runs):
    made = written(tmp_path, runs, MISTAKES["velocities are 24 times those of the problem"])
    (diagnosis,) = grade(made, known, expected_order=2).diagnosis
    assert (diagnosis.cause, diagnosis.remedy) == ("columns", "write them in the problem's units")
    found = mistake(written(tmp_path, runs, MISTAKES["x points the other way"]), known)
    assert "24.npz, initial state, node 1 (x): 133.3" in found
    assert found.endswith("Fix: let x point in the direction of the spec. So in 48.npz and 96.npz.")
    found = mistake(written(tmp_path, runs, MISTAKES["t counts steps"], ".csv"), known)
    assert re.search("24.csv, 48.csv, 96.csv: .*t counts steps; read so", found)


def test_a_method_that_is_known_confirms_a_mistake_where_runs_are_too_coarse(tmp_path, known):
    """Without an order: each row is that of the frame before."""
    made = []
    for n in (8, 12, 16):
        values = node_values(known.problem, simulate(known.problem, "midpoint", n).states)
        made.append(write_npz(tmp_path / f"{n}.npz", known.problem.ts, values[[0, 0, 1, 2]], 1 / n))
    (diagnosis,) = grade(made, known, expected_order=2).diagnosis
    assert diagnosis.line.startswith("each row is one frame early")
    assert "read so, the positions and velocities are those of midpoint" in diagnosis.line


def test_three_mistakes_at_once(tmp_path, known, runs):
    three = numbers(lambda v, dt: 100.0 * (v * [1, -1, 1, -1])[..., [1, 0, 3, 2]])
    found = mistake(written(tmp_path, runs, three), known)
    for words in ("column x holds y", "points the other way", "numbers are 100 times", "order 2.0"):
        assert words in found


@pytest.mark.slow
def test_both_are_said(tmp_path):
    """A rope at y = 0 whose y, mirrored, moves as if gravity had the wrong sign."""
    ends = {"num_nodes": 4, "start": (0, 0), "end": (-400, 0)}
    other = Rope(**ends, gravity=(0, 1)).problem(FRAMES)
    made = write_runs(tmp_path, other, "velocity-verlet", STEPS)
    (diagnosis,) = grade(made, Rope(**ends).problem(FRAMES)).diagnosis
    assert diagnosis.cause == "parameters"
    assert diagnosis.line.startswith("gravity has the wrong sign. ")
    assert "; or, which is the same in the files" in diagnosis.line
    assert "y points the other way; read so, positions order 2.0" in diagnosis.line


def test_right_runs_that_are_coarse_have_no_mistake(tmp_path, known, runs):
    """A rope that is nearly symmetric looks the same from its other end."""
    report = grade(written(tmp_path, runs, numbers(lambda v, dt: v)), known)
    assert (report.passed, report.diagnosis, report.notes) == (True, (), ())
