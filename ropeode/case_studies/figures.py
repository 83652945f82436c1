"""The figures of the published rope report: their settings and their claims."""

from __future__ import annotations

import dataclasses
import functools
import tomllib
from collections.abc import Sequence
from importlib import resources
from typing import Any, Literal

from ropeode.problems import InextensibleRope, Problem
from ropeode.problems.rope import Rope
from ropeode.validation import bad_value, whole_number

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
class Setting:
    """A rope and how it is stepped; several figures may show the same one.

    Arguments:
        rope: with rigid links or with springs.
        num_nodes: nodes of the rope.
        stepper: name with options.
        steps_per_frame: steps in each frame.
        damping: damping coefficient.
    """

    rope: type[InextensibleRope] | type[Rope]
    num_nodes: int
    stepper: str
    steps_per_frame: int
    damping: float

    def problem(self, end: Sequence[float], frames: int) -> Problem:
        """The rope, drawn to one of `ENDS`."""
        rope = self.rope(end=tuple(end), num_nodes=self.num_nodes, damping=self.damping)
        return rope.problem(frames)


@dataclasses.dataclass(frozen=True)
class Figure:
    """One figure of the report.

    Arguments:
        figure: its number.
        stepper: what the report calls it; `none` where nothing moves.
        steps_per_frame: steps in each frame.
        damping: damping coefficient; the Verlet programs multiply by one minus this in each
            step.
        num_nodes: nodes of the rope.
        claim: what the report sees in it, as one word: those of `motion`, `swings` or `drawn`.
        words: what the report sees in it.
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

        The printed force Verlet computes its damping force from a velocity that it never
        updates, so that it damps nothing. No way where nothing moves.
        """
        if self.run_as is None:
            return ()
        return ("words", "listing") if self.stepper == "force_verlet" else ("words",)

    def setting(self, meaning: Meaning) -> Setting:
        """What is run for one of `meanings`."""
        assert self.run_as is not None
        return Setting(
            rope=InextensibleRope if self.stepper == "constraint_verlet" else Rope,
            num_nodes=self.num_nodes,
            stepper=self.run_as,
            steps_per_frame=self.steps_per_frame,
            damping=0.0 if meaning == "listing" else self.damping,
        )


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


def check_figures(numbers: Sequence[Any] | None) -> list[Figure]:
    """Figures by their numbers, each once and in order; None stands for all of them.

    Raises:
        InputError: there is no such figure.
    """
    figures = all_figures()
    if numbers is None:
        return list(figures.values())
    allowed = f"whole numbers from 1 to {max(figures)}"
    chosen = []
    try:
        numbers = list(numbers)
    except TypeError:
        raise bad_value("figures", numbers, allowed, "for example [8, 9]") from None
    for number in numbers:
        try:
            chosen.append(figures[whole_number(number, at_least=1)])
        except (KeyError, ValueError):
            raise bad_value("figures", number, allowed, "for example 8") from None
    if not chosen:
        raise bad_value("figures", [], "at least one figure", "for example 8")
    return sorted(set(chosen), key=lambda figure: figure.figure)
