"""The list of steppers and what they declare."""

from __future__ import annotations

import itertools

from tabulate import tabulate

from ropeode.steppers import STEPPERS, option_value, options
from ropeode.steppers.base import ProblemClass, Stepper

HEADERS = ("stepper", "order", "damped", "moving", "symplectic")


def variants(cls: type[Stepper]) -> list[Stepper]:
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
            _order(each, ProblemClass(damped=False, at_rest=True)),
            _order(each, ProblemClass(damped=True, at_rest=True)),
            _order(each, ProblemClass(damped=True, at_rest=False)),
            "yes" if each.symplectic else "no",
        )
        for cls in STEPPERS.values()
        for each in variants(cls)
    ]
    notes = [
        f"{cls.name}\n    runs on: {cls.needs}\n    source: {cls.source}"
        for cls in STEPPERS.values()
    ]
    return "\n".join(
        [
            tabulate([HEADERS, *rows], tablefmt="plain", disable_numparse=True),
            "",
            "Declared orders of convergence: undamped and at rest at the start; damped;",
            "damped and moving at the start. 0: it converges to another solution.",
            "Symplectic: on problems without damping.",
            "",
            *notes,
            "",
        ]
    )


def _order(stepper: Stepper, problem_class: ProblemClass) -> str:
    return str(stepper.order(problem_class))
