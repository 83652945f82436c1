"""The list of steppers by family, and all of one."""

from __future__ import annotations

import itertools

from ropeode.render.docstrings import argument_words, description, source
from ropeode.render.text_layout import columns, hanging, wrapped
from ropeode.steppers import (
    STEPPERS,
    BuiltIn,
    ProblemClass,
    Stepper,
    by_family,
    options,
)

# Of problems, as the columns of declared orders name them.
_KINDS = {
    "undamped, at rest": ProblemClass(damped=False, at_rest=True),
    "undamped, moving": ProblemClass(damped=False, at_rest=False),
    "damped, at rest": ProblemClass(damped=True, at_rest=True),
    "damped, moving": ProblemClass(damped=True, at_rest=False),
}


def variants(cls: type[BuiltIn]) -> list[BuiltIn]:
    """A stepper with every combination of its options, the defaults first."""
    choices = options(cls)
    return [
        cls(**dict(zip(choices, chosen, strict=True)))
        for chosen in itertools.product(*choices.values())
    ]


def list_steppers() -> str:
    """A line for each stepper, by family: its order, and what it is."""
    lines = []
    for family, steppers in by_family().items():
        lines.append(family)
        for cls in steppers:
            head = f"  {cls.name:<20}{_orders_in_short(cls()):>6}  "
            lines += hanging(head, _plain(description(cls)[0]))
        lines.append("")
    return "\n".join(
        [
            *lines,
            *wrapped(
                "The numbers are declared orders of convergence: a second one is that with "
                "damping and motion at the start, where it differs; 0 stands for another "
                "solution, or none. Those of steppers that take springs for rigid links hold on "
                "ropes with such links."
            ),
            "",
            *wrapped(
                "`ropeode steppers NAME` shows all of one: its options, its orders with each, its "
                "source. FILE.py:NAME, diffrax:NAME and scipy:NAME are steppers too."
            ),
            "",
        ]
    )


def describe_stepper(stepper: Stepper) -> str:
    """What a stepper is, what it runs on, its options and orders, its source."""
    # Others are classes around what the user or a library has written.
    built_in = next((cls for cls in STEPPERS.values() if cls is type(stepper)), None)
    lines = [stepper.label, ""]
    for paragraph in description(built_in) if built_in else ():
        lines += [*wrapped(_plain(paragraph)), ""]
    facts = {
        "family": stepper.family,
        "runs on": stepper.needs + (", frames of equal length" if stepper.equal_frames else ""),
        "symplectic": {True: "on problems without damping", False: "no", None: "nothing claimed"}[
            stepper.symplectic
        ],
        "source": _plain(source(built_in)) if built_in else stepper.source,
    }
    for name, words in facts.items():
        if words:
            lines += hanging(f"{name + ':':<12}", words)
    lines.append("")
    if built_in and (choices := options(built_in)):
        words = argument_words(built_in)
        lines += ["Options, the default first", ""]
        for option, values in choices.items():
            lines += [f"  {option} = {' | '.join(values)}"]
            lines += hanging(" " * 6, _plain(words[option]))
        lines.append("")
    shown = variants(built_in) if built_in else [stepper]
    rows = [
        [
            each.label.removeprefix(f"{stepper.name}:"),
            *(_order(each, kind) for kind in _KINDS.values()),
        ]
        for each in shown
    ]
    lines += ["Declared orders of convergence (0: to another solution, or none)", ""]
    lines += _orders_table(rows)
    return "\n".join([*lines, ""])


def _orders_table(rows: list[list[str]]) -> list[str]:
    """The orders on each kind of problem, whose names take two lines of headers."""
    above, below = zip(*(kind.split(", ") for kind in _KINDS), strict=True)
    return columns([["", *(f"{each}," for each in above)], ["", *below], *rows])


def _orders_in_short(stepper: BuiltIn) -> str:
    """The order at its best and, where it is another one, at its worst."""
    best, *_, worst = (_order(stepper, kind) for kind in _KINDS.values())
    return best if best == worst else f"{best} ({worst})"


def _order(stepper: Stepper, kind: ProblemClass) -> str:
    """The order on the problems that the stepper is for."""
    meant = kind if stepper.solves(kind) else kind._replace(rigid=True)
    order = stepper.order(meant)
    return "-" if order is None else str(order)


def _plain(text: str) -> str:
    """Words of a docstring without the marks of code."""
    return text.replace("``", "")
