"""The figures of the published rope report: their settings, and what is claimed of them."""

from __future__ import annotations

import dataclasses
import functools
import tomllib
from collections.abc import Sequence
from importlib import resources
from typing import Any, Literal

from ropeode.errors import InputError
from ropeode.problems.inextensible_rope import InextensibleRope
from ropeode.problems.problem import Problem
from ropeode.problems.rope import Rope
from ropeode.validation import complaint, whole_number

Claim = Literal[
    "drawn", "swings", "diverges", "settles", "settles_without_swinging", "never_settles"
]
Measure = Literal[
    "diverges_later", "rests_sooner", "swings_slower", "falls_slower", "at_least_as_well"
]
Meaning = Literal["words", "listing"]

# What the report calls its steppers, and how they are run here. Both of its Verlet programs
# start with x(-dt) = x(0) and damp by a factor for each step.
STEPPERS = {
    "explicit_euler": "explicit-euler",
    "semi_implicit_euler": "semi-implicit-euler",
    "constraint_verlet": "constraint-verlet:start=rest,damping=per-step",
    "force_verlet": "stormer-verlet:start=rest,damping=per-step",
}
# The rope is drawn to the left of its pin and to the right.
ENDS = ((-400.0, 200.0), (400.0, 200.0))


@dataclasses.dataclass(frozen=True)
class Figure:
    """One figure of the report.

    Arguments:
        figure: its number.
        stepper: what the report calls it; `none` where nothing moves.
        steps_per_frame: steps in each frame.
        damping: damping coefficient; of the Verlet programs, the factor for each step is one
            less this.
        num_nodes: nodes of the rope.
        claim: what is seen in it, as one word.
        words: what is seen in it.
    """

    figure: int
    stepper: str
    steps_per_frame: int
    damping: float
    num_nodes: int
    claim: Claim
    words: str

    @property
    def run_as(self) -> str | None:
        """The stepper with its options, as this package names it; None where nothing moves."""
        return STEPPERS.get(self.stepper)

    @property
    def meanings(self) -> tuple[Meaning, ...]:
        """The ways to read it: the report's words, and its program where that does otherwise.

        The printed force Verlet never updates the velocity that its damping force is made
        from, so that nothing is damped.
        """
        return ("words", "listing") if self.stepper == "force_verlet" else ("words",)

    def problem(self, meaning: Meaning, end: Sequence[float], frames: int) -> Problem:
        """The rope of this figure.

        Arguments:
            meaning: as the words or as the printed listing has it.
            end: one of `ENDS`.
            frames: to solve.
        """
        shared = {
            "end": tuple(end),
            "num_nodes": self.num_nodes,
            "damping": 0.0 if meaning == "listing" else self.damping,
        }
        if self.stepper == "constraint_verlet":
            return InextensibleRope(**shared).problem(frames)
        return Rope(**shared).problem(frames)


@dataclasses.dataclass(frozen=True)
class Comparison:
    """A claim about several figures, in the order in which they are named.

    Arguments:
        figures: their numbers.
        measure: what is compared.
        claim: in words.
    """

    figures: tuple[int, ...]
    measure: Measure
    claim: str


@functools.cache
def _contents() -> dict[str, Any]:
    return tomllib.loads(
        resources.files("ropeode.case_studies").joinpath("figures.toml").read_text("utf-8")
    )


@functools.cache
def all_figures() -> dict[int, Figure]:
    """The figures by number."""
    return {entry["figure"]: Figure(**entry) for entry in _contents()["figures"]}


@functools.cache
def all_comparisons() -> tuple[Comparison, ...]:
    """The claims about several figures."""
    return tuple(
        Comparison(**{**entry, "figures": tuple(entry["figures"])})
        for entry in _contents()["comparisons"]
    )


def check_figures(given: Sequence[Any] | None) -> list[Figure]:
    """Figures by their numbers; all of them where none are given.

    Raises:
        InputError: there is no such figure.
    """
    figures = all_figures()
    if given is None:
        return list(figures.values())
    chosen = []
    for number in given:
        try:
            chosen.append(figures[whole_number(number, at_least=1)])
        except (KeyError, ValueError):
            allowed = f"whole numbers from 1 to {max(figures)}"
            raise InputError(complaint("figure", number, allowed, "for example 8")) from None
    if not chosen:
        raise InputError(complaint("figure", [], "at least one figure", "for example 8"))
    return sorted(set(chosen), key=lambda figure: figure.figure)
