"""Every stepper with every option, numbers included."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any, get_type_hints

import pytest

from ropeode.steppers import STEPPERS, BuiltIn, variants


def number_options(cls: type[BuiltIn]) -> list[str]:
    """The options that are a whole number."""
    hints = get_type_hints(cls)
    return [option.name for option in dataclasses.fields(cls) if hints[option.name] is int]


def with_other_numbers(cls: type[BuiltIn]) -> list[BuiltIn]:
    """The stepper with each of its numbers raised by two, all else being the default."""
    return [
        dataclasses.replace(cls(), **{option: getattr(cls(), option) + 2})
        for option in number_options(cls)
    ]


EVERY_VARIANT = [
    each for cls in STEPPERS.values() for each in (*variants(cls), *with_other_numbers(cls))
]


# Methods that differ in their coefficients alone share a step: the first of them stands for all.
_BY_CODE = {cls.step: cls for cls in reversed(STEPPERS.values())}
REPRESENTATIVES = [cls.name for cls in STEPPERS.values() if _BY_CODE[cls.step] is cls]
# Each option is code of its own: two of them together do what each of them does. Damping is the
# same code in both Verlet steppers, a single iteration in all implicit ones, and
# test_position_based.py has sweeps.
_AS_OTHERS = (
    *("constraint-verlet:damping=lagged", "constraint-verlet:sweeps=3"),
    *("trapezium:newton=1", "bdf2:newton=1"),
)
SINGLE_OPTIONS = [
    each
    for each in EVERY_VARIANT
    if each.name in REPRESENTATIVES and "," not in each.label and each.label not in _AS_OTHERS
]


# On any rope, and at any step size: rounding grows to the size of the rope.
UNSTABLE = ("pbd:sweep=jacobi",)


def slow_if(slow: Callable[[BuiltIn], bool]) -> list[Any]:
    """Every variant, as test parameters; those outside SINGLE_OPTIONS are marked `slow`.

    Arguments:
        slow: marks others as well: what is special about them is tested elsewhere.
    """
    return [
        pytest.param(
            each,
            id=each.label,
            marks=[pytest.mark.slow] if slow(each) or each not in SINGLE_OPTIONS else [],
        )
        for each in EVERY_VARIANT
    ]


EVERY_PARAMETER = slow_if(lambda each: False)
