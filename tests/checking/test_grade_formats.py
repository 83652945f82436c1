"""The three formats give the same report, and damaged files are refused."""

from __future__ import annotations

import dataclasses

import h5netcdf
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from trajectory_writing import node_values, write_csv, write_netcdf, write_npz

from ropeode import grade
from ropeode.errors import InputError
from ropeode.simulation import simulate

STEPS = (16, 24, 32)
WRITERS = {".csv": write_csv, ".npz": write_npz, ".nc": write_netcdf}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("formats")


@pytest.fixture(scope="module")
def every_quarter(small_rope):
    """Runs with four samples in a frame, by steps per frame."""
    ts = np.arange(4 * small_rope.frames + 1) / 4
    problem = dataclasses.replace(small_rope, ts=ts)
    return {steps: simulate(problem, "velocity-verlet", steps // 4) for steps in STEPS}


@settings(max_examples=8, deadline=None)
@given(
    between=st.sampled_from([1, 2, 4]),
    velocities=st.booleans(),
    said=st.booleans(),
    block=st.sampled_from([1, 1000, 2**22]),
)
def test_the_report_is_the_same(folder, known, every_quarter, between, velocities, said, block):
    reports = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("ropeode.checking.trajectories.array_files._BLOCK", block)
        for suffix, write in WRITERS.items():
            files = []
            for steps in STEPS:
                run, shown = every_quarter[steps], slice(None, None, 4 // between)
                values = node_values(run.problem, run.states, velocities)[shown]
                dt = 1 / steps if said else None
                files.append(write(folder / f"{steps}{suffix}", run.times[shown], values, dt))
            dts = None if said else [1 / steps for steps in STEPS]
            reports.append(grade(files, known, dts, 2))
    assert reports[0].findings == reports[1].findings == reports[2].findings
    assert reports[0].passed
    orders = reports[0].findings[1].convergence.orders
    assert {*orders} == ({"position", "velocity"} if velocities else {"position"})
    assert all(order.observed == pytest.approx(2.0, abs=0.1) for order in orders.values())


def written(folder, write, name, **changed):
    times, values = np.arange(4.0), np.zeros((4, 4, 4))
    return write(folder / name, **{"times": times, "values": values, "dt": 0.5, **changed})


def complaint_of(path, problem):
    with pytest.raises(InputError) as caught:
        grade([path] * 3, problem)
    assert len({*caught.value.problems}) == 1
    return caught.value.problems[0]


@pytest.mark.parametrize(("write", "suffix"), [(write_npz, ".npz"), (write_netcdf, ".nc")])
class TestArrays:
    def test_not_a_number(self, folder, small_rope, write, suffix):
        values = np.zeros((4, 4, 4))
        values[0, 1, 3] = np.nan
        path = written(folder, write, f"nan{suffix}", values=values)
        others = [written(folder, write, f"{dt}{suffix}", dt=dt) for dt in (0.25, 0.125)]
        with pytest.raises(InputError, match=r"velocities\[0, 1, 1\]: nan given"):
            grade([path, *others], small_rope)

    def test_wrong_shapes(self, folder, small_rope, write, suffix):
        five = written(folder, write, f"five{suffix}", values=np.zeros((4, 5, 4)))
        assert "positions: (4, 5, 2) given; allowed: the shape (4, 4, 2)" in complaint_of(
            five, small_rope
        )

    def test_wrong_dt(self, folder, small_rope, write, suffix):
        path = written(folder, write, f"minus{suffix}", dt=-0.5)
        with pytest.raises(InputError, match="dt: '-0.5' given; allowed: a finite number > 0"):
            grade([path] * 3, small_rope)

    def test_damaged(self, folder, small_rope, write, suffix):
        path = written(folder, write, f"cut{suffix}")
        path.write_bytes(path.read_bytes()[:-200])
        assert "Fix: write it again" in complaint_of(path, small_rope)
        path.write_bytes(b"no such format")
        assert "Fix: write it again" in complaint_of(path, small_rope)
        path.unlink()
        assert "No such file" in complaint_of(path, small_rope)


def test_what_numpy_can_store_and_nobody_wants(folder, small_rope):
    path, right = (
        folder / "odd.npz",
        {"t": np.arange(4.0), "positions": np.zeros((4, 4, 2)), "dt": 1},
    )
    for changed, words in (
        ({"positions": np.array([[None]])}, "positions: 'objects' given"),
        ({"positions": np.zeros((2, 4, 4)).T}, "Fortran order"),
        ({"positions": np.zeros((4, 4, 2), dtype=complex)}, "complex128"),
        ({"t": np.array(3.0)}, "t: () given"),
        ({"dt": np.zeros(3)}, "dt: "),
    ):
        np.savez(path, **{**right, **changed})
        assert words in complaint_of(path, small_rope)
    np.savez(path, t=right["t"])
    assert "add the array 'positions'" in complaint_of(path, small_rope)


def test_numbers_that_are_declared_and_not_there(folder, small_rope):
    path = folder / "hollow.nc"
    with h5netcdf.File(path, "w") as file:
        file.dimensions = {"time": 10**12, "node": 4, "axis": 2}
        file.create_variable("t", ("time",), dtype="f8", chunks=(1000,))
        file.create_variable("positions", ("time", "node", "axis"), dtype="f8", chunks=(1000, 4, 2))
    assert "'numbers that are not in the file' given" in complaint_of(path, small_rope)


def test_files_that_are_none(folder, small_rope):
    (folder / "a.mat").touch()
    assert "ends in .csv, .npz, .nc" in complaint_of(folder / "a.mat", small_rope)
    (folder / "folder.csv").mkdir()
    assert "a file that can be read" in complaint_of(folder / "folder.csv", small_rope)
    with pytest.raises(InputError, match="files: 2 given; allowed: at least 3"):
        grade([folder / "a.mat", folder / "folder.csv"], small_rope)
    # A mistake in the name of a folder, or of one of few files.
    for none in (["class"], ["a.csv", folder / "a.mat"]):
        with pytest.raises(InputError, match=f"file: '{none[0]}' given; .*No such file"):
            grade(none, small_rope)
    with pytest.raises(InputError, match="put it into a list"):
        grade("a.csv", small_rope)
