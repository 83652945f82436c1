"""The handwritten steppers by name: every class with a name in the files of the families."""

from __future__ import annotations

import dataclasses
import functools
import itertools
from types import ModuleType
from typing import get_args, get_type_hints

from ropeode.errors import InputError
from ropeode.steppers import (
    adams,
    beeman,
    constraint,
    dormand_prince,
    euler,
    implicit,
    nystrom,
    position_based,
    projective,
    runge_kutta_methods,
    splitting,
    verlet,
)
from ropeode.steppers.base import BuiltIn
from ropeode.validation import bad_value, unknown

# In the order in which they are listed.
_LEAVES: tuple[ModuleType, ...] = (
    euler,
    runge_kutta_methods,
    dormand_prince,
    nystrom,
    verlet,
    splitting,
    adams,
    beeman,
    implicit,
    position_based,
    projective,
    constraint,
)


def _named_in(leaf: ModuleType) -> list[type[BuiltIn]]:
    """The steppers that a file defines, in its order; without a name, it is a base of others."""
    return [
        each
        for each in vars(leaf).values()
        if isinstance(each, type)
        and issubclass(each, BuiltIn)
        and each.__module__ == leaf.__name__
        and each.name
    ]


STEPPERS: dict[str, type[BuiltIn]] = {
    stepper.name: stepper for leaf in _LEAVES for stepper in _named_in(leaf)
}


def by_family() -> dict[str, list[type[BuiltIn]]]:
    """The steppers of each family, in the order in which they are listed."""
    families: dict[str, list[type[BuiltIn]]] = {}
    for stepper in STEPPERS.values():
        families.setdefault(stepper.family, []).append(stepper)
    return families


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


def variants(cls: type[BuiltIn]) -> list[BuiltIn]:
    """A stepper with every combination of its options, the defaults first."""
    choices = options(cls)
    return [
        cls(**dict(zip(choices, chosen, strict=True)))
        for chosen in itertools.product(*choices.values())
    ]


# The annotations of a class take longer to read than a short run.
@functools.lru_cache(maxsize=256)
def registered_stepper(text: str) -> BuiltIn:
    """A stepper from its name with options, as in ``stormer-verlet:start=rest,damping=lagged``.

    Raises:
        InputError: there is no such stepper, option or choice.
    """
    name, _, tail = text.strip().partition(":")
    if name not in STEPPERS:
        raise InputError(unknown("stepper", name, STEPPERS))
    cls = STEPPERS[name]
    choices = options(cls)
    chosen: dict[str, str] = {}
    for part in filter(None, tail.split(",")):
        key, _, value = (word.strip() for word in part.partition("="))
        if key not in choices:
            if not choices:
                raise bad_value(name, part, "no options", f"write {name} without options")
            raise InputError(unknown(f"option of {name}", key, choices))
        if key in chosen:
            raise bad_value(f"{name}:{key}", part, "each option once", "drop one")
        chosen[key] = value
    return cls(**chosen)  # type: ignore[arg-type]
