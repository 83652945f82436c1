"""The handwritten steppers by name: every subclass of `BuiltIn` in this folder."""

from __future__ import annotations

import dataclasses
from typing import Any, get_args, get_type_hints

from ropeode.errors import InputError
from ropeode.steppers.base import BuiltIn
from ropeode.steppers.constraint import ConstraintVerlet, Rattle
from ropeode.steppers.euler import ExplicitEuler, SemiImplicitEuler
from ropeode.steppers.runge_kutta import RungeKutta4
from ropeode.steppers.verlet import StormerVerlet, VelocityVerlet
from ropeode.validation import bad_value, check_whole, unknown

STEPPERS: dict[str, type[BuiltIn]] = {
    stepper.name: stepper
    for stepper in (
        ExplicitEuler,
        SemiImplicitEuler,
        StormerVerlet,
        VelocityVerlet,
        RungeKutta4,
        ConstraintVerlet,
        Rattle,
    )
}


def options(stepper: type[BuiltIn]) -> dict[str, tuple[str, ...]]:
    """The options of a stepper and the choices of each, the default first.

    An option that is a number has its default for its only choice; any whole number from 1 on
    may be given.
    """
    hints = get_type_hints(stepper)
    return {
        option.name: (
            str(option.default),
            *(choice for choice in get_args(hints[option.name]) if choice != option.default),
        )
        for option in dataclasses.fields(stepper)
    }


def option_value(stepper: type[BuiltIn], option: str, text: str) -> str | int:
    """The value of an option, from its text.

    Raises:
        InputError: it is none of the choices, or no whole number from 1 on.
    """
    name = f"{stepper.name}:{option}"
    if get_type_hints(stepper)[option] is int:
        return check_whole(name, text, at_least=1, example="4")
    choices = options(stepper)[option]
    if text not in choices:
        raise InputError(unknown(name, text, choices))
    return text


def registered(text: str) -> BuiltIn:
    """A stepper from its name with options, as in ``stormer-verlet:start=rest,damping=lagged``.

    Raises:
        InputError: there is no such stepper, option or choice.
    """
    name, _, tail = text.strip().partition(":")
    if name not in STEPPERS:
        raise InputError(unknown("stepper", name, STEPPERS))
    cls = STEPPERS[name]
    choices = options(cls)
    chosen: dict[str, Any] = {}
    for part in filter(None, tail.split(",")):
        key, _, value = (word.strip() for word in part.partition("="))
        if key not in choices:
            if not choices:
                raise bad_value(name, part, "no options", f"write {name} without options")
            raise InputError(unknown(f"option of {name}", key, choices))
        if key in chosen:
            raise bad_value(f"{name}:{key}", part, "each option once", "drop one")
        chosen[key] = option_value(cls, key, value)
    return cls(**chosen)
