"""Fitted numbers: as simple as their uncertainty allows, and in words."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from ropeode.checking.diagnosis.fit import Fit
from ropeode.checking.diagnosis.known_mistakes import Alike, Law, holding
from ropeode.checking.diagnosis.parameters import dimension, places, units
from ropeode.problems.problem import Problem

# A number that is known no better than this, of its size, is not taken for a simple one.
_KNOWN = 1e-2
_MOST_DIGITS = 6
_DIGITS_SHOWN = 4
_WORDS = {
    "gravity": "gravity",
    "damping": "damping",
    "stiffness": "stiffness",
    "mass": "mass",
    "rest_length": "rest length",
    "velocity": "initial velocity",
}


@dataclasses.dataclass(frozen=True)
class Number:
    """A parameter of a rope, as claimed and as found.

    Arguments:
        name: of the parameter.
        claimed: one number, or one for each component; 1 where it is a factor.
        found: likewise.
        spread: how far what was found may be off.
        factor: whether it multiplies what is claimed, because nodes or springs differ (or are
            the many components of initial velocities).
    """

    name: str
    claimed: np.ndarray
    found: np.ndarray
    spread: np.ndarray
    factor: bool

    @property
    def is_known(self) -> bool:
        """Whether it is known well enough to be taken for a simple number."""
        size = np.max(np.abs([self.claimed, self.found]))
        return bool(np.all(self.spread <= _KNOWN * size))

    @property
    def what(self) -> str:
        """The parameter in words."""
        return _WORDS[self.name]

    @property
    def words(self) -> str:
        """As part of a sentence."""
        what = self.what
        if not self.factor:
            about = "" if self.is_known else f" (give or take {np.max(self.spread):.1g})"
            return f"{what} {shown(self.found)}{about} instead of {shown(self.claimed)}"
        if np.all(self.found == 0.0):
            return f"{what} 0 instead of the given one"
        return f"{shown(self.found)} times the {what}"

    def as_json(self) -> dict[str, Any]:
        """As plain JSON values."""
        return {
            "claimed": plain(self.claimed),
            "found": plain(self.found),
            "spread": plain(self.spread),
            "factor": self.factor,
        }


def plain(values: np.ndarray) -> Any:
    """One number, or a list of them."""
    return float(values[0]) if len(values) == 1 else [float(value) for value in values]


def shown(values: np.ndarray) -> str:
    """One number, or several in parentheses; four digits are enough to recognise it."""
    texts = [f"{float(value) + 0.0:.{_DIGITS_SHOWN}g}" for value in values]
    return texts[0] if len(texts) == 1 else f"({', '.join(texts)})"


def numbers_of(problem: Problem, fit: Fit) -> tuple[Number, ...]:
    """The parameters that a fit changed.

    Arguments:
        problem: as it is claimed to be.
        fit: of it.
    """
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
    alike = bool(np.all(claimed == claimed[0]))
    if name == "damping":
        unit = np.ravel(units(problem).damping)[:1]
        if alike:
            return Number(name, claimed[:1], claimed[:1] + unit * change, unit * spread, False)
        ratio = float(np.max(units(problem).damping) / np.max(claimed))
        return Number(name, np.ones(1), 1.0 + ratio * change, ratio * spread, True)
    factor = 1.0 + change
    if name == "mass":
        factor, spread = 1.0 / factor, spread / factor**2
    own = claimed[:1] if alike else np.ones(1)
    return Number(name, own, own * factor, own * spread, not alike)


def simple(problem: Problem, number: Number) -> Number:
    """With what it may be exactly: what a known mistake makes of it, or a short decimal.

    Arguments:
        problem: as it is claimed to be.
        number: of it.
    """
    known = laws_that_hold(problem, number)
    if known:
        return dataclasses.replace(number, found=known[0].value(number.claimed, alike_in(problem)))
    return rounded(number)


def rounded(number: Number, part: float = 1.0) -> Number:
    """As the shortest decimal number that its spread allows.

    Arguments:
        number: any.
        part: of the spread, by which it may change.
    """
    pairs = zip(number.found, part * number.spread, strict=True)
    return dataclasses.replace(number, found=np.array([shortest(*pair) for pair in pairs]))


def shortest(value: float, spread: float) -> float:
    """The decimal number with the fewest digits that is no further away than the spread.

    Arguments:
        value: any.
        spread: how far it may be off.
    """
    if abs(value) <= spread:
        return 0.0
    texts = (f"{value:.{digits}e}" for digits in range(_MOST_DIGITS))
    return next((float(text) for text in texts if abs(float(text) - value) <= spread), value)


def laws_that_hold(problem: Problem, number: Number) -> tuple[Law, ...]:
    """The known mistakes that make of what is claimed what was found.

    Arguments:
        problem: as it is claimed to be.
        number: of it.
    """
    if not number.is_known:
        return ()
    return holding(number.name, number.claimed, number.found, number.spread, alike_in(problem))


def alike_in(problem: Problem) -> Alike:
    """The numbers that all nodes, or all springs, of a rope have."""

    def one(values: np.ndarray) -> float:
        return float(np.ravel(values)[0]) if np.all(values == np.ravel(values)[0]) else np.nan

    return Alike(one(problem.args.mass), one(problem.args.rest_length))


def with_found(problem: Problem, numbers: Sequence[Number]) -> Problem:
    """A rope with the numbers that were found.

    Arguments:
        problem: as it is claimed to be.
        numbers: of it, or of another one of the same numbers.
    """
    y0, args = problem.y0, {}
    for number in numbers:
        if number.name == "velocity":
            y0 = _with_velocity(problem, number)
            continue
        own = np.asarray(getattr(problem.args, number.name))
        if number.factor:
            args[number.name] = own * number.found[0]
        elif number.name == "gravity":
            args[number.name] = number.found.reshape(own.shape)
        else:
            args[number.name] = np.full(own.shape, number.found[0])
    args = problem.args._replace(**args)
    return problem.with_numbers(y0, args, problem.parameters)


def _with_velocity(problem: Problem, number: Number) -> np.ndarray:
    x0, v0 = problem.y0
    if number.factor:
        return np.stack([x0, number.found[0] * v0])
    unit = units(problem).velocity
    return np.stack([x0, np.tensordot(number.found, unit / np.max(np.abs(unit)), 1)])
