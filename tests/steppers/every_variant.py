"""Every stepper with every option, numbers included."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any, get_type_hints

import pytest

from ropeode.render.stepper_list import variants
from ropeode.steppers import STEPPERS
from ropeode.steppers.base import Stepper


def number_options(cls: type[Stepper]) -> list[str]:
    """The options that are a whole number."""
    hints = get_type_hints(cls)
    return [option.name for option in dataclasses.fields(cls) if hints[option.name] is int]


def with_other_numbers(cls: type[Stepper]) -> list[Stepper]:
    """The stepper with each of its numbers raised by two, all else being the default."""
    return [
        dataclasses.replace(cls(), **{option: getattr(cls(), option) + 2})
        for option in number_options(cls)
    ]


EVERY_VARIANT = [
    each for cls in STEPPERS.values() for each in (*variants(cls), *with_other_numbers(cls))
]


def slow_if(slow: Callable[[Stepper], bool]) -> list[Any]:
    """Every stepper, as test parameters; those of which it is said by `make test-all` only.

    Arguments:
        slow: whether what is special about it is tested by the others, or elsewhere.
    """
    return [
        pytest.param(each, id=each.label, marks=[pytest.mark.slow] if slow(each) else [])
        for each in EVERY_VARIANT
    ]
