"""Every stepper is registered, and its name leads back to it."""

from __future__ import annotations

import dataclasses
import importlib
import itertools
import pkgutil

import numpy as np
import pytest

import ropeode.steppers
from ropeode.errors import InputError
from ropeode.problems import InextensibleRope, Rope
from ropeode.steppers import STEPPERS, BuiltIn, ProblemClass, as_stepper, by_family
from tests.steppers.every_variant import EVERY_VARIANT, number_options


def test_no_stepper_escapes_the_registry():
    modules = pkgutil.iter_modules(ropeode.steppers.__path__, "ropeode.steppers.")
    imported = {importlib.import_module(module.name).__name__ for module in modules}
    defined = {each for each in _below(BuiltIn) if each.name}
    assert set(STEPPERS.values()) == {each for each in defined if each.__module__ in imported}
    assert all(name == each.name for name, each in STEPPERS.items())
    in_families = [each.name for steppers in by_family().values() for each in steppers]
    assert sorted(in_families) == sorted(STEPPERS)
    assert "your own" not in by_family()


def _below(cls: type) -> set[type]:
    return {each for own in cls.__subclasses__() for each in ({own} | _below(own))}


def test_each_has_its_name_and_tells_what_it_solves():
    for each in EVERY_VARIANT:
        assert as_stepper(each.label) == as_stepper(each) == each
        assert hash(as_stepper(each.label)) == hash(each)
        for declared in itertools.product((False, True), repeat=3):
            problem_class = ProblemClass(*declared)
            solves, order = each.solves(problem_class), each.order(problem_class)
            assert solves or order == 0
            if each == type(each)():
                assert solves == (problem_class.rigid or not each.keeps_lengths)
                assert not solves or order >= 1


NUMBERS = [(cls, option) for cls in STEPPERS.values() for option in number_options(cls)]


@pytest.mark.parametrize(("cls", "option"), NUMBERS)
def test_any_whole_number_from_one_on(cls, option):
    """As text, and in Python too."""
    name = f"{cls.name}:{option}"
    found = as_stepper(f"{name}=1000")
    assert (getattr(found, option), found.label) == (1000, f"{name}=1000")
    assert type(getattr(found, option)) is int
    assert cls(**{option: np.int64(1000)}) == found
    assert as_stepper(f"{name}={getattr(cls(), option)}").label == cls.name
    wrong = {"0": "0 is below 1", "1.5": "'1.5' is not whole", "x": "'x' is not a number"}
    wrong |= {"": "'' is not a number", "inf": "inf is not finite"}
    wrong |= {0: "0 is below 1", 2.5: "2.5 is not whole", None: "None is not a number"}
    for given, why in wrong.items():
        with pytest.raises(InputError) as caught:
            as_stepper(f"{name}={given}") if isinstance(given, str) else cls(**{option: given})
        (line,) = caught.value.problems
        assert line.startswith(f"{name}: ")
        assert f"given; allowed: a whole number >= 1 ({why}). Fix: for example {name}=" in line


def test_options_in_python_are_those_on_the_command_line():
    """A number as one; and nothing that would run as another choice under its own name."""
    spaced = as_stepper(" stormer-verlet: start=rest , damping = lagged ")
    assert spaced == STEPPERS["stormer-verlet"](start="rest", damping="lagged")
    assert STEPPERS["implicit-euler"](newton=1) == as_stepper("implicit-euler:newton=1")
    for given in ("0", None, True, 2):
        with pytest.raises(InputError, match="implicit-euler:newton: .* allowed: converged, 1"):
            STEPPERS["implicit-euler"](newton=given)


def test_refusals_name_the_stepper_and_a_way_out(driven_pendulum):
    rope, rigid = (kind(num_nodes=3).problem(frames=2) for kind in (Rope, InextensibleRope))
    uneven = dataclasses.replace(driven_pendulum, ts=driven_pendulum.ts**2)
    for each in EVERY_VARIANT:
        # Its links are no springs, and their tensions depend on the velocities, and not by linear
        # damping.
        refused = {
            rope: False,
            rigid: each.needs in ("second order, linear damping", "springs in a row"),
            driven_pendulum: each.moves_links,
            uneven: each.moves_links or each.equal_frames,
        }
        for problem, expected in refused.items():
            refusal = each.refusal(problem)
            assert (refusal is not None) == expected
            assert refusal is None or (each.label in refusal and "Fix:" in refusal)
