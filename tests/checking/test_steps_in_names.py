"""Step sizes go by the names of files where these hold the steps per frame, and nothing else."""

from __future__ import annotations

from pathlib import Path

import pytest
from trajectory_writing import node_values, write_csv

from ropeode import grade
from ropeode.checking import read_runs
from ropeode.checking.trajectories.steps_in_names import by_names, steps_in_names
from ropeode.errors import InputError
from ropeode.simulation import simulate


@pytest.mark.parametrize(
    ("names", "found"),
    [
        ("128 32 64", [128, 32, 64]),
        ("run_032 run_064", [32, 64]),
        ("verlet2-20-1024steps verlet2-20-512steps", [1024, 512]),
        ("10 20 30", [10, 20, 30]),
        ("1 2 3", "1 to 3 in the names may number the files"),
        ("a16-1 a32-2 a64-3", "differ in more than one number"),
        ("euler-32 verlet-64", "differ in more than a number"),
        ("dt0.1 dt0.05", "0.1 in a name is no number of steps"),
        ("1e-2 1e-4", "1e-2 in a name is no number of steps"),
        ("0 32", "0 in a name is no number of steps"),
        ("32", "no number tells the names apart"),
    ],
)
def test_which_number_of_names_counts_the_steps(names, found):
    files = [Path(f"folder7/{name}.csv") for name in names.split()]
    if isinstance(found, list):
        assert steps_in_names(files) == found
    else:
        with pytest.raises(ValueError, match=found):
            steps_in_names(files)


@pytest.mark.parametrize(
    ("dts", "found"),
    [
        ([0.00391, 0.01563, 0.00781], [0.00391, 0.01563, 0.00781]),  # with few digits
        ([0.1, 0.05, 0.02], None),  # the names mean something else
        ([12.8, 3.2, 6.4], None),  # dt itself, in another unit
    ],
)
def test_step_sizes_by_the_names(dts, found):
    assert by_names([128, 32, 64], dts, 0.5) == found
    with pytest.raises(ValueError, match="proportional to one over the number"):
        by_names([128, 256, 32, 64], [3.2, 1.6, 0.8, 0.4], 0.5)


@pytest.fixture
def files(tmp_path, small_rope):
    """In the order of the shell, without step sizes."""
    runs = {n: simulate(small_rope, "velocity-verlet", n) for n in (128, 32, 64)}
    return [
        write_csv(tmp_path / f"run_{n}.csv", run.times, node_values(small_rope, run.states))
        for n, run in runs.items()
    ]


@pytest.mark.parametrize(
    ("dts", "noted"),
    [
        (None, True),
        ([1 / 32, 1 / 64, 1 / 128], True),
        # In the order of the files.
        ([1 / 128, 1 / 32, 1 / 64], False),
    ],
)
def test_files_are_graded_by_their_names(files, known, dts, noted):
    report = grade(files, known, dts, expected_order=2)
    assert report.passed
    words = "steps per frame are those of the file names: 32 in run_32.csv, 64 in run_64.csv, 128"
    assert [words in note for note in report.notes] == [True] * noted


def test_what_is_in_the_files_counts_before_their_names(tmp_path, small_rope):
    names = {1: 32, 2: 64, 4: 128}
    for name, steps in names.items():
        run = simulate(small_rope, "velocity-verlet", steps)
        values = node_values(small_rope, run.states)
        write_csv(tmp_path / f"{name}.csv", run.times, values, run.dt)
    runs = read_runs([tmp_path / f"{name}.csv" for name in names], small_rope)
    assert [1 / run.dt for run in runs] == [*names.values()]
    assert not any(run.named for run in runs)


def test_names_that_do_not_say_it_are_refused(tmp_path, files, small_rope):
    # In seconds, of which a frame is a 24th, and in another order.
    with pytest.raises(InputError, match=r"dt: .* in the order of the files run_128.csv, run_32"):
        read_runs(files, small_rope, [1 / 24 / n for n in (32, 64, 128)])
    numbered = [file.rename(tmp_path / f"{i}.csv") for i, file in enumerate(files, 1)]
    with pytest.raises(InputError, match=r"dt: 'none' given; .* \(1 to 3 in the names may number"):
        read_runs(numbered, small_rope)
    uneven = small_rope.changed(ts=[0.0, 1.0, 3.0], exact=None)
    with pytest.raises(InputError, match="the frames of the problem differ in length"):
        read_runs(numbered, uneven)
