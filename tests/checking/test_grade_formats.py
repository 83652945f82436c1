"""The three formats give the same report, and what is no trajectory is refused."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from trajectory_writing import WRITERS, finding, node_values, write_csv, write_runs

from ropeode import grade
from ropeode.checking import read_runs
from ropeode.errors import InputError
from ropeode.problems import Rope
from ropeode.simulation import simulate

STEPS = (16, 24, 32)


@pytest.mark.parametrize(
    ("between", "velocities", "said"), [(1, True, True), (2, False, True), (4, True, False)]
)
def test_the_report_is_the_same(tmp_path, small_rope, known, between, velocities, said):
    """With samples between the frames or without, and dt in the files or beside them."""
    ts = np.arange(between * small_rope.frames + 1) / between
    often = dataclasses.replace(small_rope, ts=ts)
    reports = []
    for suffix, write in WRITERS.items():
        files = []
        for n in STEPS:
            run = simulate(often, "velocity-verlet", n // between)
            values = node_values(often, run.states, velocities)
            path = tmp_path / f"{n}{suffix}"
            files.append(write(path, run.times, values, 1 / n if said else None))
        reports.append(grade(files, known, None if said else [1 / n for n in STEPS], 2))
    assert reports[0].findings == reports[1].findings == reports[2].findings
    assert reports[0].passed
    orders = finding(reports[0]).convergence.orders
    assert {*orders} == ({"position", "velocity"} if velocities else {"position"})
    assert all(order.observed == pytest.approx(2.0, abs=0.1) for order in orders.values())


@pytest.mark.parametrize("suffix", WRITERS)
def test_files_of_many_megabytes(tmp_path, small_rope, suffix):
    """All samples but those at the sample times are passed over."""
    steps = 3_900 if suffix == ".csv" else 12_000
    times = np.arange(steps * small_rope.frames + 1) / steps
    values = np.random.default_rng(1).normal(size=(len(times), 4, 4))
    path = WRITERS[suffix](tmp_path / f"it{suffix}", times, values, 1 / steps)
    assert path.stat().st_size > 2**22
    (run,) = read_runs([path], small_rope, fewest=1)
    assert np.array_equal(run.values, values[::steps])


def complaint_of(paths, problem, dts=None):
    with pytest.raises(InputError) as caught:
        grade(paths, problem, dts)
    return "\n".join(dict.fromkeys(caught.value.problems))


NAN = np.zeros((4, 4, 4))
NAN[0, 1, 3] = np.nan
ARRAYS = {
    "velocities[0, 1, 1]: nan given": {"values": NAN},
    "positions: (4, 5, 2) given; allowed: the shape (4, 4, 2)": {"values": np.zeros((4, 5, 4))},
    "dt: '-0.5' given; allowed: a finite number > 0": {"dt": -0.5},
}


@pytest.mark.parametrize("suffix", [".npz", ".nc"])
@pytest.mark.parametrize("words", ARRAYS)
def test_wrong_arrays(tmp_path, small_rope, suffix, words):
    arrays = {"times": np.arange(4.0), "values": np.zeros((4, 4, 4)), "dt": 0.5, **ARRAYS[words]}
    made = [
        WRITERS[suffix](tmp_path / f"{part}{suffix}", **{**arrays, "dt": arrays["dt"] / part})
        for part in (1, 2, 4)
    ]
    assert words in complaint_of(made, small_rope)


def test_what_numpy_can_store_and_nobody_wants(tmp_path, small_rope):
    usual = {"t": np.arange(4.0), "positions": np.zeros((4, 4, 2))}
    for changed, words in (
        ({"positions": np.array([[None]])}, "Object arrays cannot be loaded"),
        ({"positions": np.zeros((2, 4, 3)).T}, "positions: (3, 4, 2) given"),
        ({"positions": np.zeros((4, 4, 2), dtype=complex)}, "complex128"),
        ({"t": np.array(3.0)}, "t: () given"),
        ({"dt": np.zeros(3)}, "dt: "),
    ):
        made = [tmp_path / f"{steps}.npz" for steps in (1, 2, 4)]
        for steps, path in zip((1, 2, 4), made, strict=True):
            np.savez(path, **{**usual, "dt": 1 / steps, **changed})
        assert words in complaint_of(made, small_rope)
    np.savez(tmp_path / "odd.npz", t=usual["t"])
    assert "add the array 'positions'" in complaint_of([tmp_path / "odd.npz"] * 3, small_rope)


def test_files_that_are_none_or_do_not_go_together(tmp_path, small_rope, known):
    mat, no_dt, long = (tmp_path / name for name in ("a.mat", "without.csv", "long.csv"))
    mat.touch()
    for path, dt in ((no_dt, None), (long, 1.5)):
        write_csv(path, small_rope.ts, np.zeros((4, 4, 4)), dt)
    made, no_velocities, other = (
        write_runs(tmp_path, problem, "velocity-verlet", steps, ".csv", velocities=velocities)
        for problem, steps, velocities in (
            (small_rope, STEPS, True),
            (small_rope, (20,), False),
            (Rope(num_nodes=4, end=(-300.0, 200.0)).problem(frames=3), (64,), True),
        )
    )
    for files, dts, words in (
        ([mat] * 3, None, "ends in .csv, .npz, .nc"),
        ([mat, mat], None, "files: 2 given; allowed: at least 3"),
        # A mistake in the name of a folder, or of one of few files.
        (["class"], None, "file: 'class' given"),
        (["a.csv", mat], None, "file: 'a.csv' given"),
        ("a.csv", None, "put it into a list"),
        (made, [0.5] * 4, "dt: 4 given; allowed: one for each of the 3 files"),
        (made, [0.5] * 3, "0.5 given; allowed: 0.0625, the dt in the file"),
        (made, ["abc", -1, float("nan")], "'abc' is not a number"),
        ([*made, made[0]], None, "has this one too"),
        ([*made, no_dt], None, "without.csv, dt: 'none' given"),
        ([*made, long], None, "dt: 1.5 given; allowed: at most 1, the time between"),
        ([*made, *no_velocities], None, "velocities in all files, or in none"),
        ([*made, *other], None, "64.csv, initial state, node 1 (x): -100.0 given"),
    ):
        assert words in complaint_of(files, known, dts), words
