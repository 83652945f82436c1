"""The list of steppers, and all of one."""

from __future__ import annotations

import inspect

from ropeode.render import describe_stepper, list_steppers
from ropeode.steppers import STEPPERS, as_stepper, options
from tests.golden import check_golden


def test_every_stepper_is_in_the_list():
    for name, cls in STEPPERS.items():
        assert f"\n{name} " in list_steppers()
        assert cls.family in list_steppers().splitlines()
        # Line breaks aside, its description and its source.
        words = "".join(describe_stepper(cls()).split())
        documented = str(inspect.getdoc(cls))
        source = documented.partition("Source: ")[2].partition("\n\n")[0]
        for part in (documented.splitlines()[0], source):
            assert part
            assert "".join(part.replace("``", "").split()) in words
        for option, values in options(cls).items():
            assert f"{option}={'|'.join(values)}" in words
        assert max(map(len, describe_stepper(cls()).splitlines())) <= 80
    assert max(map(len, list_steppers().splitlines())) <= 80


def test_all_of_one_stepper_is_that_of_its_file(tmp_path):
    check_golden("stormer-verlet.txt", describe_stepper(as_stepper("stormer-verlet")))
    (tmp_path / "own.toml").write_text("A = [[], [1]]\nb = [0.5, 0.5]\nname = 'mine'")
    own = as_stepper("runge-kutta:own.toml", folder=tmp_path)
    check_golden("own-tableau.txt", describe_stepper(own))


def test_orders_are_those_on_the_problems_that_a_stepper_is_for():
    for stepper, orders in (
        ("rattle", ["2"] * 4),
        ("diffrax:Heun", ["2"] * 4),
        (lambda rhs, t, y, dt, args: y, ["-"] * 4),
    ):
        lines = describe_stepper(as_stepper(stepper)).splitlines()
        assert lines[-1].split()[1:] == orders
