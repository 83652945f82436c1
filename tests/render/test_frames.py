"""Results as data frames and data sets, and references as files for other programs."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

from ropeode import Rope
from ropeode.analysis import error_series
from ropeode.errors import InputError
from ropeode.render import EXPORTS, write_export
from ropeode.simulation import simulate
from tests.exact_reference import rope_reference

PAGE = Path(__file__).parents[2] / "docs/howto/notebooks.md"


@pytest.fixture(scope="module")
def truth(small_rope):
    return rope_reference(small_rope)


@pytest.fixture(scope="module")
def run(truth):
    return simulate(truth.problem, "rk4", 16)


def test_runs_side_by_side_have_a_column_and_an_axis_of_members():
    ropes = Rope(num_nodes=4).ensemble(frames=3, damping=[0.0, 0.5])
    runs = simulate(ropes, "rk4", 16)
    frame, data = runs.to_dataframe(), runs.to_xarray()
    assert frame["member"].tolist() == [0] * 4 + [1] * 4
    assert dict(data.sizes) == {"member": 2, "time": 4, "node": 4, "component": 2}
    np.testing.assert_array_equal(frame["y3"][4:], runs[1].positions[:, 3, 1])
    np.testing.assert_array_equal(data["position"][1], runs[1].positions)


def test_a_frame_and_a_data_set_hold_each_number_of_the_states(truth, run):
    frame, data = truth.to_dataframe(), run.to_xarray()
    np.testing.assert_array_equal(frame["time"], truth.times)
    np.testing.assert_array_equal(frame["y3"], truth.positions[:, 3, 1])
    np.testing.assert_array_equal(frame["vx2"], truth.velocities[:, 2, 0])
    np.testing.assert_array_equal(frame["position_bound"], truth.bound())
    assert dict(data.sizes) == {"time": 4, "node": 4, "component": 2}
    np.testing.assert_array_equal(data["velocity"], run.velocities)
    assert truth.to_xarray()["position_bound"].dims == ("time",)


def read(path):
    if path.suffix == ".npz":
        return dict(np.load(path))
    if path.suffix == ".parquet":
        return pd.read_parquet(path)
    # Not by pandas, of which older versions round.
    return np.genfromtxt(path, delimiter="," if path.suffix == ".csv" else None, names=True)


@pytest.mark.parametrize("suffix", EXPORTS)
def test_an_export_is_read_back_to_the_last_bit(suffix, truth, tmp_path):
    back = read(write_export(truth, tmp_path / f"rope{suffix}"))
    for name, values in truth.to_dataframe().items():
        np.testing.assert_array_equal(back[name], values, err_msg=name)


@pytest.mark.slow
def test_the_program_of_the_documentation_reads_the_text(truth, tmp_path):
    (code,) = re.findall(r"```cpp\n(.*?)```", PAGE.read_text(), re.DOTALL)
    (tmp_path / "read.cpp").write_text(code)
    program = str(tmp_path / "read")
    subprocess.run(["g++", "-o", program, str(tmp_path / "read.cpp")], check=True)
    write_export(truth, tmp_path / "rope.txt")
    done = subprocess.run([program], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert [float(each) for each in done.stdout.split()] == truth.times.tolist()


def test_bare_states_and_what_scipy_returns_have_errors(truth, run):
    own = error_series(run, truth)
    for states in (run.states, run.states.tolist(), run.states.reshape(len(run.times), -1)):
        np.testing.assert_array_equal(error_series(states, truth).values, own.values)
    later = error_series(run.states[[1, 3]], truth, times=run.times[[1, 3]])
    np.testing.assert_array_equal(later.values, own.values[[0, 2]])
    found = solve_ivp(**truth.problem.to_scipy(), rtol=1e-6)
    assert 1e-6 < error_series(found, truth).max < 1.0


@pytest.mark.parametrize(
    ("states", "times", "field"),
    [
        (np.zeros((4, 3)), None, "trajectory"),
        (np.zeros((9, 2, 2, 4)), None, "trajectory"),
        (np.full((4, 2, 2, 4), np.nan), None, "trajectory"),
        (np.zeros((2, 2, 2, 4)), [2.0, 1.0], "times"),
        (np.zeros((2, 2, 2, 4)), [10.0, 11.0], "times"),
        # A run has times of its own.
        (None, [1.0], "times"),
    ],
)
def test_bare_states_that_cannot_be_used(states, times, field, truth, run):
    with pytest.raises(InputError, match=f"^{field}: "):
        error_series(run if states is None else states, truth, times=times)
