"""The list of steppers and what they declare."""

from __future__ import annotations

import dataclasses
import itertools

from ropeode.render.text_layout import columns
from ropeode.steppers.base import BuiltIn, ProblemClass
from ropeode.steppers.registry import STEPPERS, option_value, options

HEADERS = ("stepper", "order", "damped", "moving", "symplectic")


def variants(cls: type[BuiltIn]) -> list[BuiltIn]:
    """A stepper with every combination of its options, the defaults first."""
    choices = options(cls)
    return [
        cls(
            **{
                option: option_value(cls, option, text)
                for option, text in zip(choices, chosen, strict=True)
            }
        )
        for chosen in itertools.product(*choices.values())
    ]


def as_text() -> str:
    """A table of declared orders, and for each stepper what it needs and its source."""
    rows = [
        (
            each.label,
            _order(each, damped=False, at_rest=True),
            _order(each, damped=True, at_rest=True),
            _order(each, damped=True, at_rest=False),
            "yes" if each.symplectic else "no",
        )
        for cls in STEPPERS.values()
        for each in variants(cls)
    ]
    return "\n".join(
        [
            *columns([HEADERS, *rows]),
            "",
            "Declared orders of convergence: undamped and at rest at the start; damped;",
            "damped and moving at the start. 0: it converges to another solution. Those of",
            "steppers that run on nodes in a row are for ropes with rigid links; a rope with",
            "springs they take for one. Symplectic: on problems without damping.",
            "",
            *(_note(cls) for cls in STEPPERS.values()),
            "",
        ]
    )


def _order(stepper: BuiltIn, *, damped: bool, at_rest: bool) -> str:
    """The order on the problems that the stepper is for."""
    classes = [ProblemClass(damped, at_rest, rigid) for rigid in (False, True)]
    return str(next(stepper.order(each) for each in classes if stepper.solves(each)))


def _note(cls: type[BuiltIn]) -> str:
    lines = [cls.name, f"    runs on: {cls.needs}", f"    source: {cls.source}"]
    numbers = {field.name for field in dataclasses.fields(cls) if field.type == "int"}
    for option, choices in options(cls).items():
        words = f"{choices[0]}, or more" if option in numbers else ", ".join(choices)
        lines.append(f"    {option}: {words}")
    return "\n".join(lines)
