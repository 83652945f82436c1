"""The list of steppers, and all of one."""

from __future__ import annotations

import inspect

from ropeode.render import describe_stepper, list_steppers
from ropeode.steppers import STEPPERS, as_stepper, options


def test_every_stepper_is_in_the_list():
    for name, cls in STEPPERS.items():
        assert f"\n  {name} " in list_steppers()
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


def test_all_of_one_stepper_gives_orders_on_the_problems_that_it_is_for():
    def orders(stepper):
        lines = describe_stepper(as_stepper(stepper)).split("\n\n")[-1].splitlines()
        return {line.split()[0]: line.split()[1:] for line in lines[2:]}

    assert orders("rattle") == {"rattle": ["2"] * 4}
    assert orders("constraint-verlet")["start=rest"] == ["1", "0", "1", "0"]
    assert orders("stormer-verlet")["damping=per-step"] == ["2", "2", "0", "0"]
    assert orders("diffrax:Heun") == {"diffrax:Heun": ["2"] * 4}
    assert orders(lambda rhs, t, y, dt, args: y) == {"<lambda>": ["-"] * 4}


def test_a_tableau_of_a_users_is_shown(tmp_path):
    (tmp_path / "own.toml").write_text("A = [[], [1]]\nb = [0.5, 0.5]\nname = 'mine'")
    text = describe_stepper(as_stepper("runge-kutta:own.toml", folder=tmp_path))
    assert text.startswith("mine\n")
    assert "family:     Runge-Kutta" in text
    assert "mine  2          2          2        2" in text
