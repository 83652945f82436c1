"""Fitted terms as numbers of the rope: as simple as their uncertainty allows, and in words."""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import numpy as np

from ropeode.checking.diagnosis.fitted_terms import Fit, Group
from ropeode.checking.simple_numbers import shortest
from ropeode.problems import Problem
from ropeode.theory.terms import FACTORS, MISTAKES, TERMS, KnownMistake, known_mistakes
from ropeode.validation import listed

# A larger spread than this part of a number is too much to guess what the number is exactly.
_LARGEST_SPREAD = 1e-2
_DIGITS_SHOWN = 4
_WORDS = {"rest_length": "rest length", "velocity": "initial velocity"}
# The terms in which a mistake looks like another parameter.
_KINDS = {"stiffness": "spring", "rest_length": "rest"}


@dataclasses.dataclass(frozen=True)
class Number:
    """A number of a rope, as claimed and as fitted.

    Arguments:
        group: the terms that it stands for.
        claimed: one number, or one for each component; 1 for a factor, 0 for what is not there.
        fitted: likewise.
        spread: how far the fitted number may be off.
        factor: whether it multiplies the claimed values, because they differ among nodes or
            springs (or are the many components of initial velocities).
    """

    group: Group
    claimed: np.ndarray
    fitted: np.ndarray
    spread: np.ndarray
    factor: bool

    @property
    def name(self) -> str:
        """The name of its group."""
        return self.group.name

    @property
    def is_precise(self) -> bool:
        """Whether the spread is small enough to guess the exact number."""
        size = np.max(np.abs([self.claimed, self.fitted]))
        return bool(np.all(self.spread <= _LARGEST_SPREAD * size))

    @property
    def is_parameter(self) -> bool:
        """Whether it is a number of the problem, and not one of a term that a program may have."""
        return self.name in _WORDS or self.name in MISTAKES or self.name in _KINDS

    @property
    def words(self) -> str:
        """As part of a sentence."""
        shown = _shown(self.fitted, self.spread)
        about = "" if self.is_precise else f" (± {np.max(self.spread):.1g})"
        if not self.is_parameter:
            what = TERMS[self.group.terms[0]].name
            if not self.factor:
                return f"{what}, of coefficient {shown}{about}"
            if np.all(self.fitted == 0.0):
                return f"no {what.removeprefix('the ')}"
            return f"{shown}{about} times {what}"
        what = _WORDS.get(self.name, self.name)
        if not self.factor:
            return f"{what} {shown}{about} instead of {_shown(self.claimed)}"
        if np.all(self.fitted == 0.0):
            return f"{what} 0 instead of the problem's"
        return f"{shown}{about} times the {what}"

    @property
    def digits(self) -> int:
        """How many digits it takes to say it."""
        return sum(
            len(f"{abs(value):.{_DIGITS_SHOWN - 1}e}".split("e")[0].rstrip("0."))
            for value in self.fitted
        )

    def values(self) -> dict[str, float]:
        """The terms that it stands for."""
        if TERMS[self.group.terms[0]].expected == 0.0:
            values = self.fitted - self.claimed
        elif self.name == "mass":
            values = self.claimed / self.fitted
        else:
            values = self.fitted / self.claimed
        return dict(zip(self.group.terms, values.tolist(), strict=True))

    def as_json(self) -> dict[str, Any]:
        """As plain JSON values."""
        return {
            "claimed": _plain(self.claimed),
            "found": _plain(self.fitted),
            "spread": _plain(self.spread),
            "factor": self.factor,
        }


def _plain(values: np.ndarray) -> Any:
    """One number, or a list of them."""
    return values.item() if len(values) == 1 else values.tolist()


def _shown(values: np.ndarray, spread: np.ndarray | None = None) -> str:
    """One number, or several in parentheses, to the digits that are known, at most four."""
    if spread is not None:
        places = -np.floor(np.log10(np.maximum(spread, 1e-300))).astype(int)
        values = np.array(
            [round(*each) for each in zip(values.tolist(), places.tolist(), strict=True)]
        )
    texts = [f"{float(value) + 0.0:.{_DIGITS_SHOWN}g}" for value in values]
    return texts[0] if len(texts) == 1 else f"({', '.join(texts)})"


def numbers_of(problem: Problem, fit: Fit) -> tuple[Number, ...]:
    """The numbers that a fit changed."""
    values, spread = fit.values(), iter(fit.spread)
    return tuple(
        _number(
            problem,
            group,
            np.array([values[name] for name in group.terms]),
            group.unit * np.array([next(spread) for _ in group.terms]),
        )
        for group in fit.groups
    )


def _number(problem: Problem, group: Group, values: np.ndarray, spread: np.ndarray) -> Number:
    own = np.ravel(getattr(problem.args, group.name, np.zeros(0)))
    if group.name == "gravity":
        return Number(group, own, own + values, spread, False)
    if TERMS[group.terms[0]].expected == 0.0:
        return Number(group, np.zeros(len(values)), values, spread, False)
    if group.name == "mass":
        values, spread = 1.0 / values, spread / values**2
    uniform = len(own) > 0 and bool(np.all(own == own[0]))
    own = own[:1] if uniform else np.ones(1)
    return Number(group, own, own * values, own * spread, not uniform)


def simplified(problem: Problem, number: Number) -> Number:
    """With the exact value that a known mistake gives, or else the shortest decimal."""
    if named := named_mistakes(problem, number):
        return dataclasses.replace(number, fitted=named[0].value)
    return rounded(number)


def rounded(number: Number, part: float = 1.0) -> Number:
    """As the shortest decimal number that its spread allows."""
    pairs = zip(number.fitted, part * number.spread, strict=True)
    return dataclasses.replace(number, fitted=np.array([shortest(*pair) for pair in pairs]))


class NamedMistake(NamedTuple):
    """A known mistake that gives a fitted number.

    Fields:
        words: that say it.
        remedy: what is right.
        value: the number that it gives exactly.
    """

    words: str
    remedy: str
    value: np.ndarray


def named_mistakes(problem: Problem, number: Number) -> list[NamedMistake]:
    """The known mistakes that turn the claimed number into the fitted one, to its spread.

    A mistake multiplies terms of the acceleration. It is one of a parameter if it multiplies those
    of all nodes, or springs, by the same factor.
    """
    claimed, fitted, spread = number.claimed, number.fitted, number.spread
    off = np.abs(claimed - fitted) > spread
    if not number.is_precise or not np.any(off):
        return []
    kind, found = _KINDS.get(number.name, number.name), []
    of_start = [KnownMistake("velocity", words, {}, factor) for words, factor in FACTORS.items()]
    for mistake in (*known_mistakes(problem.args), *of_start):
        if mistake.kind != kind or mistake.number is None:
            continue
        # All forces are divided by the mass.
        factor = mistake.number if kind != "mass" else 1.0 / (mistake.number or np.nan)
        value = claimed * factor
        subject = TERMS[kind].name
        if kind == "gravity" and not np.all(off[claimed != 0.0]):
            subject = (
                f"the {listed('xyz'[axis] for axis in np.flatnonzero(off))} component of gravity"
            )
            value = np.where(off, value, claimed)
        if np.all(np.abs(value - fitted) <= spread):
            found.append(NamedMistake(f"{subject} {mistake.words}", TERMS[kind].remedy, value))
    return found
