"""Fitted parameters: as simple as their uncertainty allows, and in words."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ropeode.checking.diagnosis.parameter_fit import Fit
from ropeode.checking.diagnosis.parameters import dimension, places, units
from ropeode.checking.simple_numbers import shortest
from ropeode.problems import Problem
from ropeode.theory import TermPlace
from ropeode.theory.known_mistakes import MISTAKES, NUMBERS, RIGHT, SUBJECTS
from ropeode.validation import listed

# A larger spread than this part of a number is too much to guess what the number is exactly.
_LARGEST_SPREAD = 1e-2
_DIGITS_SHOWN = 4
# How closely factors at several places are the same.
_SAME = 1e-12
_WORDS = {"rest_length": "rest length", "velocity": "initial velocity"}
# The terms in which a mistake looks like another parameter.
_KINDS = {"stiffness": "spring", "rest_length": "rest"}


@dataclasses.dataclass(frozen=True)
class Number:
    """A parameter of a rope, as claimed and as fitted.

    Arguments:
        name: of the parameter.
        claimed: one number, or one for each component; 1 for a factor.
        fitted: likewise.
        spread: how far the fitted number may be off.
        factor: whether it multiplies the claimed values, because they differ among nodes or
            springs (or are the many components of initial velocities).
    """

    name: str
    claimed: np.ndarray
    fitted: np.ndarray
    spread: np.ndarray
    factor: bool

    @property
    def is_precise(self) -> bool:
        """Whether the spread is small enough to guess the exact number."""
        size = np.max(np.abs([self.claimed, self.fitted]))
        return bool(np.all(self.spread <= _LARGEST_SPREAD * size))

    @property
    def what(self) -> str:
        """The parameter in words."""
        return _WORDS.get(self.name, self.name)

    @property
    def words(self) -> str:
        """As part of a sentence."""
        if not self.factor:
            about = "" if self.is_precise else f" (± {np.max(self.spread):.1g})"
            return f"{self.what} {_shown(self.fitted)}{about} instead of {_shown(self.claimed)}"
        if np.all(self.fitted == 0.0):
            return f"{self.what} 0 instead of the problem's"
        return f"{_shown(self.fitted)} times the {self.what}"

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


def _shown(values: np.ndarray) -> str:
    """One number, or several in parentheses; four digits are enough to recognise it."""
    texts = [f"{float(value) + 0.0:.{_DIGITS_SHOWN}g}" for value in values]
    return texts[0] if len(texts) == 1 else f"({', '.join(texts)})"


def numbers_of(problem: Problem, fit: Fit) -> tuple[Number, ...]:
    """The parameters that a fit changed."""
    return tuple(_number(problem, fit, name) for name in fit.names)


def _number(problem: Problem, fit: Fit, name: str) -> Number:
    place = places(dimension(problem))[name]
    change, spread = fit.changes[place], fit.spread[place]
    if name == "gravity":
        unit = float(units(problem).gravity)
        claimed = np.ravel(problem.args.gravity)
        return Number(name, claimed, claimed + unit * change, unit * spread, False)
    if name == "velocity":
        if np.any(problem.y0[1]):
            return Number(name, np.ones(1), 1.0 + change[:1], spread[:1], True)
        unit = np.max(np.abs(units(problem).velocity))
        return Number(name, np.zeros(len(change)), unit * change, unit * spread, False)
    claimed = np.ravel(getattr(problem.args, name))
    uniform = bool(np.all(claimed == claimed[0]))
    if name == "damping":
        unit = np.ravel(units(problem).damping)[:1]
        if uniform:
            return Number(name, claimed[:1], claimed[:1] + unit * change, unit * spread, False)
        ratio = float(np.max(units(problem).damping) / np.max(claimed))
        return Number(name, np.ones(1), 1.0 + ratio * change, ratio * spread, True)
    factor = 1.0 + change
    if name == "mass":
        factor, spread = 1.0 / factor, spread / factor**2
    own = claimed[:1] if uniform else np.ones(1)
    return Number(name, own, own * factor, own * spread, not uniform)


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
    kind = _KINDS.get(number.name, number.name)
    found = []
    for mistake in (*MISTAKES[kind], *NUMBERS):
        factors = [mistake.factor(place) for place in _places(problem, kind)]
        if not np.allclose(factors, factors[0], rtol=_SAME, atol=0.0):
            continue
        # All forces are divided by the mass.
        factor = factors[0] if number.name != "mass" else 1.0 / (factors[0] or np.nan)
        value = claimed * factor
        subject = SUBJECTS[kind]
        if number.name == "gravity" and not np.all(off[claimed != 0.0]):
            subject = (
                f"the {listed('xyz'[axis] for axis in np.flatnonzero(off))} component of gravity"
            )
            value = np.where(off, value, claimed)
        if np.all(np.abs(value - fitted) <= spread):
            found.append(NamedMistake(f"{subject} {mistake.words}", RIGHT[kind], value))
    return found


def _places(problem: Problem, kind: str) -> list[TermPlace]:
    """Where the terms of a kind stand."""
    args = problem.args
    nodes = np.flatnonzero(args.free)
    if kind not in ("spring", "rest"):
        return [TermPlace(args, int(node), int(node)) for node in nodes]
    last = len(args.stiffness) - 1
    return [
        TermPlace(args, int(node), int(spring))
        for node in nodes
        for spring in (node - 1, node)
        if 0 <= spring <= last
    ]


def with_fitted(problem: Problem, numbers: Sequence[Number]) -> Problem:
    """A rope with the fitted numbers."""
    y0, args = problem.y0, {}
    for number in numbers:
        if number.name == "velocity":
            y0 = _with_velocity(problem, number)
            continue
        own = np.asarray(getattr(problem.args, number.name))
        if number.factor:
            args[number.name] = own * number.fitted[0]
        elif number.name == "gravity":
            args[number.name] = number.fitted.reshape(own.shape)
        else:
            args[number.name] = np.full(own.shape, number.fitted[0])
    args = problem.args._replace(**args)
    return problem.with_numbers(y0, args, problem.parameters)


def _with_velocity(problem: Problem, number: Number) -> np.ndarray:
    x0, v0 = problem.y0
    if number.factor:
        return np.stack([x0, number.fitted[0] * v0])
    unit = units(problem).velocity
    return np.stack([x0, np.tensordot(number.fitted, unit / np.max(np.abs(unit)), 1)])
