"""A sweep as a whole: the same rows wherever they are computed, however often it is interrupted."""

from __future__ import annotations

import json
import os
import shutil
import signal
import time
from pathlib import Path
from unittest import mock

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from ropeode.errors import InputError
from ropeode.sweep import load_sweep, run_sweep
from tests.cli.conftest import environment, started
from tests.results import check_result
from tests.time_limit import HANGS_AFTER_S

__all__ = ["environment", "started"]

STEPS = """
import time
from pathlib import Path
import numpy as np
def in_place(acceleration, t, x, v, dt, args):
    x, v = np.array(x), np.array(v)
    # Not when the spec is checked, for which no two values after the first are combined.
    while len(x) == 5 and args.damping[1] == 0.3 and Path(__file__).with_name("hold").exists():
        time.sleep(0.01)
    v += dt * np.asarray(acceleration(t, x, v, args))
    x += dt * v
    return x, v
"""
# Functions in NumPy and solvers of libraries, which other processes find again by their names.
STEPPERS = {"steps.py:in_place": 1, "diffrax:Heun": 2, "scipy:RK23": 3}
# Each number of nodes has a task of its own.
SPEC = """
steppers = {steppers}
steps_per_frame = {steps}
order_factors = []
frames = 2
rope = {{ stiffness = 4.0 }}
[grid]
num_nodes = {nodes}
damping = {rates}
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Where a stepper and sweeps are."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "steps.py").write_text(STEPS)
    return tmp_path


def spec(nodes=(2, 3), rates=(0.1, 0.3), steppers=("velocity-verlet",), steps=(4, 8)):
    """The name of a file with a spec."""
    lists = {"nodes": nodes, "rates": rates, "steppers": steppers, "steps": steps}
    text = SPEC.format(**{name: [*values] for name, values in lists.items()})
    path = Path(f"{len(nodes)}-{len(rates)}.toml")
    path.write_text(text)
    return path


def rows_of(folder) -> dict[str, pa.Table]:
    """The rows of a finished sweep by file, without their seconds, which differ each time."""
    [rows] = folder.glob("rows-*")
    return {path.name: pq.read_table(path).drop_columns(["seconds"]) for path in rows.iterdir()}


@pytest.fixture(scope="session", autouse=True)
def shared_programs(cache):
    """Processes with that cache folder use the programs that this process has compiled."""
    folder = Path(cache) / "ropeode"
    folder.mkdir(exist_ok=True)
    if not (folder / "compiled").exists():
        (folder / "compiled").symlink_to(os.environ["JAX_COMPILATION_CACHE_DIR"])


@pytest.mark.slow
def test_all_engines_make_the_same_files(folder, cache, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", cache)
    path = spec(steppers=STEPPERS, steps=(32, 64))
    summary = run_sweep(path, "here")
    assert (summary.done, summary.total, dict(summary.statuses)) == (24, 24, {"ok": 24})
    check_result(summary)
    frame = load_sweep("here")
    for stepper, order in STEPPERS.items():
        own = frame[frame["stepper"] == stepper]
        errors = own.pivot_table("error_max", ["damping", "num_nodes"], "steps_per_frame")
        np.testing.assert_allclose(np.log2(errors[32] / errors[64]), order, atol=0.1)
    run_sweep(path, "local", workers=1)
    distributed = pytest.importorskip("distributed")
    shown = {"dashboard_address": ":0", "silence_logs": 60}
    with distributed.LocalCluster(n_workers=1, threads_per_worker=2, **shown) as cluster:
        run_sweep(path, "dask", scheduler=cluster.scheduler_address)
    rows = rows_of(folder / "here")
    assert list(rows) == ["000000.parquet"]
    assert rows == rows_of(folder / "local") == rows_of(folder / "dask")
    here, local = (
        {path.name: path.read_bytes() for path in (folder / out).glob("references/*/*.npz")}
        for out in ("here", "local")
    )
    assert here == local != {}


@pytest.mark.slow
def test_a_command_that_ends_early_says_how_and_is_resumed(folder, started):
    """After Ctrl-C and after SIGKILL; while it runs nobody else may write."""
    path, out = spec([2, 3, 5], steppers=["velocity-verlet", "steps.py:in_place"]), folder / "out"
    # As long as this file exists, a rope of five nodes never moves.
    hold = folder / "hold"
    hold.touch()

    def ended(number, *more):
        """Standard error and the exit code, after a signal when two tasks are done."""
        process = started("sweep", str(path), "-o", str(out), *more)
        while process.poll() is None and len([*out.glob("rows-1/*/*.parquet")]) < 2:
            time.sleep(0.005)
        with pytest.raises(InputError, match=r"no other run .*process \d+, host"):
            run_sweep(path, out)
        process.send_signal(number)
        return process.communicate(timeout=HANGS_AFTER_S)[1], process.returncode

    said = "ropeode: interrupted; finished cases are kept; run the same command to resume.\n"
    assert ended(signal.SIGINT, "--workers", "1") == (said, 130)
    shutil.rmtree(out)
    assert ended(signal.SIGKILL) == ("", -signal.SIGKILL)
    assert len(load_sweep(out)) == 16
    hold.unlink()
    told = []
    assert run_sweep(path, out, progress=lambda *each: told.append(each)).done == 24
    assert told[0] == ("16 of 24 cases", 16 / 24)
    run_sweep(path, "undisturbed")
    assert rows_of(out) == rows_of(folder / "undisturbed")


def test_what_was_interrupted_and_extended_equals_a_sweep_made_at_once(folder, monkeypatch):
    """Also where the extension was killed midway. Another sweep and other software are refused."""
    small, large = spec([2]), spec([3, 2], [0.05, 0.1, 0.3])
    # The lock of a dead process is none, even if its number belongs to another one by now.
    grown = folder / "grown"
    grown.mkdir()
    (grown / "lock").touch()
    (grown / "lock.json").write_text(json.dumps({"process": os.getpid(), "host": "here"}))
    run_sweep(small, "grown")
    seen, told = [load_sweep("grown")], []
    with pytest.raises(InputError, match=r"num_nodes: \[3\] added; grid.damping: \[0.05\] added"):
        run_sweep(large, "grown")
    with monkeypatch.context() as patch:
        # The rows of the smaller sweep are to be removed, after those of the larger are there.
        patch.setattr(shutil, "rmtree", mock.Mock(side_effect=KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            run_sweep(large, "grown", extend=True)
    assert len([*grown.glob("rows-*")]) == 2
    assert set(load_sweep("grown")["key"]) == set(seen[0]["key"])

    def interrupted(text, fraction):
        """While it runs nobody else may write, and what is read is a part of the whole."""
        told.append((text.partition(",")[0], fraction))
        seen.append(load_sweep("grown"))
        with pytest.raises(InputError, match=rf"no other run .*process {os.getpid()}"):
            run_sweep(large, "grown")
        if fraction > 4 / 12:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_sweep(large, "grown", progress=interrupted)
    summary = run_sweep(large, "grown", progress=lambda *each: told.append(each))
    assert (summary.done, dict(summary.statuses)) == (12, {"ok": 12})
    assert [fraction for _, fraction in told] == [4 / 12, 10 / 12, 10 / 12, 1.0]
    assert told[0][0] == "4 of 12 cases"
    whole = load_sweep("grown").set_index("key")
    for part in seen:
        pd.testing.assert_frame_equal(part.set_index("key"), whole.loc[part["key"]])
    # Once more is no extension, and a smaller sweep is none either.
    assert run_sweep(large, "grown", extend=True).done == 12
    there = sorted(path.name for path in grown.iterdir())
    assert there == ["index.json", "lock", "references", "rows-2"]
    with pytest.raises(InputError, match=r"8 of its rows do not .*damping: \[0.05\] removed"):
        run_sweep(small, "grown", extend=True)
    run_sweep(large, "at_once")
    assert rows_of(grown) == rows_of(folder / "at_once")
    values = json.loads((grown / "index.json").read_text())
    values["software"]["jax"] = "0.0.1"
    (grown / "index.json").write_text(json.dumps(values))
    with pytest.raises(InputError, match=r"software.jax: was '0.0.1', now '"):
        run_sweep(large, "grown")


@pytest.mark.slow
def test_a_table_as_pandas_and_as_xarray(folder):
    run_sweep(spec(), "out")
    frame = load_sweep("out")
    assert list(frame.index) == list(range(8))
    assert list(frame["damping"][::2]) == [0.1, 0.3, 0.1, 0.3]
    assert frame["diverged_at"].isna().all()
    assert frame["steps_per_frame"].dtype == "Int64"
    pd.testing.assert_frame_equal(load_sweep("out", columns=["error_max"]), frame[["error_max"]])
    cube = load_sweep("out", columns=["error_max"], form="xarray")
    assert dict(cube.sizes) == {"steps_per_frame": 2, "num_nodes": 2, "damping": 2}
    for row in frame.itertuples():
        at = {name: getattr(row, name) for name in cube.sizes}
        assert cube["error_max"].sel(at) == row.error_max
    for named, words in (
        ({"columns": ["eror_max"]}, "did you mean 'error_max'"),
        ({"form": "numpy"}, "allowed: pandas, xarray"),
    ):
        with pytest.raises(InputError, match=words):
            load_sweep("out", **named)


@pytest.mark.parametrize(
    ("out", "named", "words"),
    [
        ("none/out", {}, "folder: .*Fix: create 'none'"),
        ("steps.py", {}, "folder: .*allowed: a folder"),
        (".", {}, "folder: .*a sweep's folder, an empty one, or a new one"),
        ("damaged", {}, "folder: .*allowed: a sweep's folder"),
        ("out", {"workers": 0}, "workers: 0 given; allowed: a whole number >= 1"),
        ("out", {"workers": 2, "scheduler": "tcp://a:1"}, "workers: 2 given; allowed: none with"),
    ],
)
def test_what_a_sweep_cannot_be_run_into(out, named, words, folder):
    path = spec()
    (folder / "damaged").mkdir()
    (folder / "damaged/index.json").write_text("{")
    with pytest.raises(InputError, match=f"^{words}"):
        run_sweep(path, out, **named)
    assert not (folder / "out").exists()
    with pytest.raises(InputError, match="a folder of `ropeode sweep`"):
        load_sweep("out")
