"""Every stepper is registered, and its name leads back to it."""

from __future__ import annotations

import dataclasses
import importlib
import pkgutil

import pytest

import ropeode.steppers
from ropeode.errors import InputError
from ropeode.problems.rope import Rope
from ropeode.render.stepper_list import variants
from ropeode.steppers import STEPPERS, options, stepper
from ropeode.steppers.base import ProblemClass, Stepper

VARIANTS = [each for cls in STEPPERS.values() for each in variants(cls)]


def test_no_stepper_escapes_the_registry():
    for module in pkgutil.iter_modules(ropeode.steppers.__path__, "ropeode.steppers."):
        importlib.import_module(module.name)
    defined = {cls for cls in Stepper.__subclasses__() if cls.__module__.startswith("ropeode.")}
    assert set(STEPPERS.values()) == defined


@pytest.mark.parametrize("each", VARIANTS, ids=lambda each: each.label)
def test_label_round_trip(each):
    assert stepper(each.label) == each
    assert stepper(each) is each
    assert hash(stepper(each.label)) == hash(each)


@pytest.mark.parametrize("cls", STEPPERS.values(), ids=STEPPERS)
def test_declared_facts(cls):
    assert cls.source
    assert "Source:" in (cls.__doc__ or "")
    assert dataclasses.is_dataclass(cls)
    assert all(
        default == choices[0] for choices in options(cls).values() for default in choices[:1]
    )
    for damped in (False, True):
        for at_rest in (False, True):
            assert cls().order(ProblemClass(damped, at_rest)) >= 1


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("eulr", "did you mean 'explicit-euler'"),
        ("RK4", "did you mean 'rk4'"),
        ("", "allowed: explicit-euler"),
        ("rk4:start=rest", "no options"),
        ("stormer-verlet:strat=rest", "did you mean 'start'"),
        ("stormer-verlet:start=rset", "did you mean 'rest'"),
        ("stormer-verlet:start", "allowed: taylor, rest"),
        ("stormer-verlet:start=rest,start=taylor", "each option once"),
        (4, "a name or a Stepper"),
    ],
)
def test_bad_names(text, words):
    with pytest.raises(InputError, match=words):
        stepper(text)


def test_spaces_do_not_matter():
    assert stepper(" stormer-verlet: start=rest , damping = lagged ").label == (
        "stormer-verlet:start=rest,damping=lagged"
    )


def test_refusals_name_the_stepper_and_a_way_out(driven_pendulum):
    rope = Rope(num_nodes=3).problem(frames=2)
    assert all(each.refusal(rope) is None for each in VARIANTS)
    uneven = dataclasses.replace(driven_pendulum, ts=driven_pendulum.ts**2)
    for each in VARIANTS:
        refusal = each.refusal(uneven)
        assert (refusal is not None) == each.equal_frames
        assert refusal is None or (each.label in refusal and "Fix:" in refusal)
