"""Fitted parameters: as simple as their uncertainty allows, and in words."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from ropeode.checking.diagnosis.known_mistakes import MISTAKES, Mistake, Uniform
from ropeode.checking.diagnosis.parameter_fit import Fit
from ropeode.checking.diagnosis.parameters import dimension, places, units
from ropeode.checking.simple_numbers import shortest
from ropeode.problems.problem import Problem

# A larger spread than this part of a number is too much to guess what the number is exactly.
_LARGEST_SPREAD = 1e-2
_DIGITS_SHOWN = 4
_WORDS = {"rest_length": "rest length", "velocity": "initial velocity"}


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
    mistakes = matching_mistakes(problem, number)
    if mistakes:
        exact = mistakes[0].value(number.claimed, _uniform(problem))
        return dataclasses.replace(number, fitted=exact)
    return rounded(number)


def rounded(number: Number, part: float = 1.0) -> Number:
    """As the shortest decimal number that its spread allows."""
    pairs = zip(number.fitted, part * number.spread, strict=True)
    return dataclasses.replace(number, fitted=np.array([shortest(*pair) for pair in pairs]))


def matching_mistakes(problem: Problem, number: Number) -> tuple[Mistake, ...]:
    """The known mistakes that turn the claimed number into the fitted one, to its spread."""
    claimed, fitted, spread = number.claimed, number.fitted, number.spread
    if not number.is_precise or np.all(np.abs(claimed - fitted) <= spread):
        return ()
    rope = _uniform(problem)
    return tuple(
        mistake
        for mistake in MISTAKES[number.name]
        if np.all(np.abs(mistake.value(claimed, rope) - fitted) <= spread)
    )


def _uniform(problem: Problem) -> Uniform:
    def one(values: np.ndarray) -> float:
        return float(np.ravel(values)[0]) if np.all(values == np.ravel(values)[0]) else np.nan

    return Uniform(one(problem.args.mass), one(problem.args.rest_length))


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
