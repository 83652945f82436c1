"""Steppers that are not ropeode's own, in the worker processes of a sweep."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from ropeode.sweep import load_sweep, run_sweep

PROBLEM = """
import numpy as np

from ropeode import LinearDamping, Problem


def acceleration(t, x, v, rate):
    return -x - rate * v


def oscillator(rate=0.1, frames=2):
    return Problem.second_order(
        acceleration,
        x0=[1.0],
        v0=[0.0],
        ts=np.arange(frames + 1.0),
        args=rate,
        damping=lambda rate: LinearDamping(rate=rate, coefficient=rate),
        name="oscillator",
    )
"""
STEPS = """
import numpy as np


def in_place(acceleration, t, x, v, dt, args):
    x, v = np.array(x), np.array(v)
    v += dt * np.asarray(acceleration(t, x, v, args))
    x += dt * v
    return x, v
"""
STEPPERS = {"steps.py:in_place": 1, "diffrax:Heun": 2, "scipy:RK23": 3}
SPEC = f"""
problem = "problem.py:oscillator"
steppers = {list(STEPPERS)}
steps_per_frame = [32, 64]
order_factors = []
[grid]
rate = [0.1, 0.3]
"""


def without_seconds(path):
    rows = pq.read_table(path)
    return rows.drop_columns([name for name in rows.column_names if name == "seconds"])


@pytest.mark.slow
def test_workers_compute_what_this_process_computes(tmp_path, cache, monkeypatch):
    """Functions in NumPy and solvers of libraries are found again by their names."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", cache)
    for name, text in (("problem.py", PROBLEM), ("steps.py", STEPS), ("spec.toml", SPEC)):
        Path(name).write_text(text)
    for folder, workers in (("here", None), ("local", 1)):
        summary = run_sweep("spec.toml", folder, workers=workers)
        assert dict(summary.statuses) == {"ok": 12}
    here, local = (sorted(Path(each).glob("rows-*/*")) for each in ("here", "local"))
    assert [os.path.basename(each) for each in here] == [os.path.basename(each) for each in local]
    # All but the time that they took.
    assert [without_seconds(each) for each in here] == [without_seconds(each) for each in local]
    rows = load_sweep("local")
    for stepper, order in STEPPERS.items():
        own = rows[rows["stepper"] == stepper]
        errors = own.pivot_table("error_max", "rate", "steps_per_frame")
        np.testing.assert_allclose(np.log2(errors[32] / errors[64]), order, atol=0.1)
