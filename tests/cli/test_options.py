"""How the text of an option is split."""

from __future__ import annotations

from pathlib import Path

import pytest

from ropeode.cli.job import job_from
from ropeode.cli.options import ROPE, TABLE


@pytest.mark.parametrize(
    ("text", "steppers"),
    [
        ("rk4,velocity-verlet", ["rk4", "velocity-verlet"]),
        (
            "stormer-verlet:start=rest,damping=lagged,rk4",
            ["stormer-verlet:start=rest,damping=lagged", "rk4"],
        ),
        (
            "constraint-verlet:sweeps=2,stormer-verlet:start=rest",
            ["constraint-verlet:sweeps=2", "stormer-verlet:start=rest"],
        ),
        ("rk4,steps.py:verlet,diffrax:Heun", ["rk4", "steps.py:verlet", "diffrax:Heun"]),
    ],
)
def test_steppers_are_apart_and_their_options_together(text, steppers):
    assert TABLE["steppers"].read(text) == steppers


def test_one_velocity_for_all_or_one_for_each_node():
    read = ROPE["initial_velocity"].read
    assert read("1,2") == ["1", "2"]
    assert read("1,2;3,4") == [["1", "2"], ["3", "4"]]


def test_a_reference_is_looked_for_where_it_was_typed(tmp_path, monkeypatch):
    """And not beside the spec, which may have a file of the same name."""
    (tmp_path / "specs").mkdir()
    for file in ("specs/spec.toml", "specs/rope.nc", "rope.nc"):
        (tmp_path / file).touch()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("ropeode.study.spec.TableJob", lambda values, folder: values)
    values = job_from(Path("specs/spec.toml"), {"reference": "rope.nc"})
    assert values == {"reference": str(tmp_path / "rope.nc")}
    assert job_from(None, {"reference": "kepler"}) == {"reference": "kepler"}
