"""The equation that a step solves, as the problem's own with other parameters."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import jax
import numpy as np

from ropeode.problems import Problem
from ropeode.theory.diagnosis import Diagnosis
from ropeode.theory.expansion import Expansion
from ropeode.theory.projection import projected
from ropeode.theory.step_samples import rates_of

# What may be left over of the difference from the right equation, as a part of the equation.
_EXPLAINED = 1e-6
# Newton's method for the parameters: iterations, and the difference quotients' part of each.
_ITERATIONS, _PART = 8, 1e-4
# What the rate of change of a quantity is.
_WHOLE = {"position": "the velocity", "velocity": "the acceleration"}


class Parameter(NamedTuple):
    """A number, or an array of numbers, that a right-hand side depends on.

    Fields:
        name: of its place in `Problem.args`.
        index: among the leaves of these.
        value: that the problem gives.
    """

    name: str
    index: int
    value: np.ndarray

    def times(self, factor: float) -> str:
        """In words, that the parameter is multiplied by a factor."""
        if self.value.size == 1:
            given = float(self.value.ravel()[0])
            return f"{self.name} = {factor * given:.8g} in place of {given:.8g}"
        return f"{self.name} multiplied by {factor:.8g}"


def diagnose_parameters(expansion: Expansion) -> Diagnosis | None:
    """What a step solves in place of a problem's equation, if that is so simple.

    It may be the same equation at another pace, or with one other parameter, or with several; or
    with each component of the rate of change multiplied by a number.

    Arguments:
        expansion: of the step; its rate of change differs from the right-hand side.

    Returns:
        None where no such change makes up the difference.
    """
    problem, right, off = expansion.problem, expansion.slopes, expansion.rate(0).value
    size = float(np.max(np.abs(right)))
    pace = projected(off.ravel(), right.reshape(1, -1))
    if pace.rest <= _EXPLAINED * size:
        factor = 1.0 + float(pace.coefficients[0])
        line = f"it is {factor:.8g} f, as if time ran so many times as fast"
        return Diagnosis("pace", line, {"pace": factor, "rest": pace.rest})
    some = parameters(problem)
    tried = [[each] for each in some] + ([some] if len(some) > 1 else [])
    for several in tried:
        found = _factors(expansion, several)
        if found is not None and found.rest <= _EXPLAINED * size:
            changed = zip(several, (1.0 + found.coefficients).tolist(), strict=True)
            factors = [pair for pair in changed if abs(pair[1] - 1.0) > _EXPLAINED]
            words = ", ".join(each.times(factor) for each, factor in factors)
            evidence = {each.name: factor for each, factor in factors}
            line = f"it is f with {words}"
            return Diagnosis("parameters", line, {"factors": evidence, "rest": found.rest})
    return _by_component(expansion, size)


def parameters(problem: Problem) -> list[Parameter]:
    """The parameters of a problem that are numbers other than 0, or arrays of such."""
    leaves = jax.tree_util.tree_flatten_with_path(problem.args)[0]
    found = []
    for index, (path, leaf) in enumerate(leaves):
        value = np.asarray(leaf)
        if np.issubdtype(value.dtype, np.floating) and np.any(value):
            name = jax.tree_util.keystr(path, simple=True, separator=".")
            found.append(Parameter(name or "args", index, value))
    return found


class _Found(NamedTuple):
    coefficients: np.ndarray
    rest: float


def _factors(expansion: Expansion, several: list[Parameter]) -> _Found | None:
    """By which parts parameters are changed in the equation that a step solves; Newton's method."""
    t, y = expansion.t, expansion.y
    target = expansion.slopes + expansion.rate(0).value
    change = np.zeros(len(several))
    for _ in range(_ITERATIONS):
        own = _rates(expansion, several, change)(t, y)
        near = [
            [_rates(expansion, several, change + sign * _PART * unit)(t, y) for sign in (1, -1)]
            for unit in np.eye(len(several))
        ]
        slopes = np.stack([(up - down).ravel() / (2.0 * _PART) for up, down in near])
        away = (target - own).ravel()
        if not (np.all(np.isfinite(slopes)) and np.all(np.isfinite(away))):
            return None
        moved = projected(away, slopes).coefficients
        change = change + moved
        if np.max(np.abs(moved)) <= 1e-12:
            break
    rest = np.max(np.abs(target - _rates(expansion, several, change)(t, y)))
    return _Found(change, float(rest)) if np.isfinite(rest) else None


def _rates(expansion: Expansion, several: list[Parameter], change: np.ndarray) -> Any:
    """The right-hand side with changed parameters."""
    leaves, structure = jax.tree.flatten(expansion.problem.args)
    for each, part in zip(several, change.tolist(), strict=True):
        leaves[each.index] = np.asarray(leaves[each.index]) * (1.0 + part)
    return rates_of(expansion.problem, jax.tree.unflatten(structure, leaves))


def _by_component(expansion: Expansion, size: float) -> Diagnosis | None:
    """The rate of change of each component, multiplied by a number."""
    count = len(expansion.t)
    right, off = (each.reshape(count, -1).T for each in (expansion.slopes, expansion.rate(0).value))
    found = [projected(b, a[None]) for a, b in zip(right, off, strict=True)]
    factors = [1.0 + float(each.coefficients[0]) for each in found]
    rest = max(each.rest for each in found)
    if rest > _EXPLAINED * size:
        return None
    line = "it is f with " + " and ".join(_component_words(expansion.problem, factors))
    return Diagnosis("components", line, {"factors": factors, "rest": rest})


def _component_words(problem: Problem, factors: list[float]) -> Iterator[str]:
    for quantity, of_it in zip(
        problem.quantities, np.split(np.array(factors), len(problem.quantities)), strict=True
    ):
        whole = _WHOLE.get(quantity)
        if whole and np.ptp(of_it) <= _EXPLAINED < abs(of_it[0] - 1.0):
            yield f"{whole} multiplied by {of_it[0]:.8g}"
            continue
        for i in np.flatnonzero(np.abs(of_it - 1.0) > _EXPLAINED):
            of = f" of {whole}" if whole else ""
            yield f"component {i}{of} multiplied by {of_it[i]:.8g}"
