"""Step sizes go by the names of files where these hold the steps per frame, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from trajectory_writing import node_values, write_csv, write_runs

from ropeode import grade
from ropeode.checking import read_runs
from ropeode.errors import InputError


def written(folder, problem, names):
    """Files of these names without step sizes, of which only the first sample is right."""
    state = node_values(problem, problem.y0[None])
    values = np.repeat(state, len(problem.ts), axis=0)
    return [write_csv(folder / f"{name}.csv", problem.ts, values) for name in names.split()]


# Names of files, step sizes that are given beside them, and the steps per frame; None: refused.
NAMES = [
    ("128 32 64", None, [128, 32, 64]),
    ("run_032 run_064 run_128", None, [32, 64, 128]),
    ("verlet2-20-1024steps verlet2-20-512steps verlet2-20-9steps", None, [1024, 512, 9]),
    ("10 20 30", None, [10, 20, 30]),
    ("1 2 3", None, None),
    ("a16-1 a32-2 a64-3", None, None),
    ("euler-32 verlet-64 verlet-16", None, None),
    ("dt0.1 dt0.05 dt0.02", None, None),
    ("1e-2 1e-4 1e-6", None, None),
    ("0 32 64", None, None),
    # With few digits, and in another order.
    ("128 32 64", [0.03125, 0.01562, 0.00781], [128, 32, 64]),
    # The names mean something else, or are dt itself in another unit.
    ("128 32 64", [0.1, 0.05, 0.02], [10, 20, 50]),
    ("128 32 64", [0.128, 0.032, 0.064], [1 / 0.128, 1 / 0.032, 1 / 0.064]),
    # In seconds, of which a frame is a 24th, and in another order.
    ("128 32 64", [1 / 768, 1 / 1536, 1 / 3072], [3072, 768, 1536]),
    ("128 256 32 64", [0.32, 0.16, 0.08, 0.04], [12.5, 25, 3.125, 6.25]),
]


@pytest.mark.parametrize(("names", "dts", "found"), NAMES)
def test_which_number_of_names_counts_the_steps(tmp_path, small_rope, names, dts, found):
    made = written(tmp_path, small_rope, names)
    # Names say nothing where the frames differ in length.
    uneven = small_rope.changed(ts=[0.0, 1.0, 3.0], exact=None)
    for problem in [uneven] if found else [small_rope, uneven]:
        with pytest.raises(InputError, match="dt: .*names that differ in a single number"):
            read_runs(made, problem)
    if found is None:
        return
    runs = read_runs(made, small_rope, dts)
    wanted = dict(zip(names.split(), found, strict=True))
    assert {run.path.stem: 1 / run.dt for run in runs} == pytest.approx(wanted, rel=1e-3)


@pytest.mark.parametrize("order", [None, (32, 64, 128), (128, 32, 64)])
def test_files_are_graded_by_their_names(tmp_path, small_rope, known, order):
    for file in write_runs(tmp_path, small_rope, "velocity-verlet", (128, 32, 64), ".csv"):
        head, rest = file.read_text().split("\n", 1)
        assert head.startswith("# dt")
        (tmp_path / f"run_{file.name}").write_text(rest)
    files = [tmp_path / f"run_{n}.csv" for n in (128, 32, 64)]
    report = grade(files, known, None if order is None else [1 / n for n in order], 2)
    assert report.passed
    words = "steps per frame go by the file names: 32 in run_32.csv, 64 in run_64.csv, 128"
    # Not where they are given in the order of the files.
    assert [words in note for note in report.notes] == [True] * (order != (128, 32, 64))


def test_what_is_in_the_files_counts_before_their_names(tmp_path, small_rope):
    made = write_runs(tmp_path, small_rope, "velocity-verlet", (32, 64, 128), ".csv")
    renamed = [file.rename(tmp_path / f"{n}.csv") for n, file in zip((1, 2, 4), made, strict=True)]
    runs = read_runs(renamed, small_rope)
    assert [1 / run.dt for run in runs] == [32, 64, 128]
    assert not any(run.named for run in runs)
