"""How the text of an option is split."""

from __future__ import annotations

import pytest

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
    assert TABLE["steppers"][1](text) == steppers


def test_one_velocity_for_all_or_one_for_each_node():
    read = ROPE["initial_velocity"][0]
    assert read("1,2") == ["1", "2"]
    assert read("1,2;3,4") == [["1", "2"], ["3", "4"]]
