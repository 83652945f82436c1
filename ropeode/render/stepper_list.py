"""The list of steppers by family, and all of one."""

from __future__ import annotations

from ropeode.render.docstrings import argument_words, description, source
from ropeode.render.markup import Block, Grid, Heading, Paragraph, Section, plain
from ropeode.steppers import (
    STEPPERS,
    BuiltIn,
    ProblemClass,
    Stepper,
    by_family,
    options,
    variants,
)

# Of problems, as the columns of declared orders name them.
_KINDS = {
    ProblemClass(damped=False, at_rest=True): "at rest",
    ProblemClass(damped=False, at_rest=False): "moving",
    ProblemClass(damped=True, at_rest=True): "damped at rest",
    ProblemClass(damped=True, at_rest=False): "damped moving",
}
_LEFT, _LONG = frozenset({0, 2}), frozenset({2})


def list_steppers() -> str:
    """A line for each stepper, by family: its order, and what it is."""
    families: list[Block] = [Heading("Steppers, with their orders of convergence")]
    for family, steppers in by_family().items():
        rows = [(cls.name, _in_short(cls()), _plain(description(cls)[0])) for cls in steppers]
        families += [Section(family), Grid(("", "", ""), rows, left=_LEFT, long=_LONG)]
    return plain(
        [
            *families,
            Paragraph(
                "The numbers are declared orders of convergence: a second one is that with "
                "damping and motion at the start, where it differs; 0 stands for another "
                "solution, or none. Those of steppers that take springs for rigid links hold on "
                "ropes with such links."
            ),
            Paragraph(
                "`ropeode steppers NAME` shows all of one: its options, its orders with each, its "
                "source. FILE.py:NAME, diffrax:NAME and scipy:NAME are steppers too."
            ),
        ]
    )


def describe_stepper(stepper: Stepper) -> str:
    """What a stepper is, what it runs on, its options and orders, its source."""
    # Others are classes around what the user or a library has written.
    built_in = next((cls for cls in STEPPERS.values() if cls is type(stepper)), None)
    facts = {
        "family": stepper.family,
        "runs on": stepper.needs + (", frames of equal length" if stepper.equal_frames else ""),
        "symplectic": {True: "on problems without damping", False: "no", None: "nothing claimed"}[
            stepper.symplectic
        ],
        "source": _plain(source(built_in)) if built_in else stepper.source,
    }
    said = [(f"{name}:", words) for name, words in facts.items() if words]
    parts: list[Block] = [
        Heading(stepper.label),
        *(Paragraph(_plain(each)) for each in (description(built_in) if built_in else ())),
        Grid(("", ""), said, left=frozenset({0, 1}), long=frozenset({1})),
    ]
    if built_in and (choices := options(built_in)):
        words = argument_words(built_in)
        parts.append(Section("Options, the default first"))
        for option, values in choices.items():
            meaning = f"{option} = {' | '.join(values)}\n{_plain(words[option])}"
            parts.append(Paragraph(meaning))
    orders = [
        (each.label.removeprefix(f"{stepper.name}:"), *(_order(each, kind) for kind in _KINDS))
        for each in (variants(built_in) if built_in else [stepper])
    ]
    parts += [
        Section("Declared orders of convergence (0: to another solution, or none)"),
        Grid(("stepper", *_KINDS.values()), orders, left=frozenset({0})),
    ]
    return plain(parts)


def _in_short(stepper: BuiltIn) -> str:
    """The order at its best and, where it is another one, at its worst."""
    best, *_, worst = (_order(stepper, kind) for kind in _KINDS)
    return best if best == worst else f"{best} ({worst})"


def _order(stepper: Stepper, kind: ProblemClass) -> str:
    """The order on the problems that the stepper is for."""
    meant = kind if stepper.solves(kind) else kind._replace(rigid=True)
    order = stepper.order(meant)
    return "-" if order is None else str(order)


def _plain(text: str) -> str:
    """Words of a docstring without the marks of code."""
    return text.replace("``", "")
