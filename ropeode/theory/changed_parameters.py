"""The equation that a step solves, as the problem's own with other parameters."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import jax
import numpy as np
from scipy.optimize import least_squares

from ropeode.problems import Problem
from ropeode.theory.diagnosis import Diagnosis
from ropeode.theory.expansion import Expansion
from ropeode.theory.projection import Projection, projected
from ropeode.theory.step_samples import rates_of

# What may be left over of the difference from the right equation, as a part of the equation.
_EXPLAINED = 1e-6
# How closely parameters are found, as a part of each.
_CLOSE = 1e-14
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
    problem, size = expansion.problem, float(np.max(np.abs(expansion.slopes)))
    if (pace := common_pace([expansion])) is not None:
        factor = 1.0 + float(pace.coefficients[0])
        line = f"it is {factor:.8g} f, as if time ran so many times as fast"
        return Diagnosis("pace", line, {"pace": factor, "rest": pace.rest})
    some = parameters(problem)
    tried = [[each] for each in some] + ([some] if len(some) > 1 else [])
    for several in tried:
        change, rest = _changed(expansion, several)
        if rest <= _EXPLAINED * size:
            changed = zip(several, (1.0 + change).tolist(), strict=True)
            factors = [pair for pair in changed if abs(pair[1] - 1.0) > _EXPLAINED]
            words = ", ".join(each.times(factor) for each, factor in factors)
            evidence = {each.name: factor for each, factor in factors}
            line = f"it is f with {words}"
            return Diagnosis("parameters", line, {"factors": evidence, "rest": rest})
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


def common_pace(expansions: Sequence[Expansion]) -> Projection | None:
    """By which part of the right rates of change all others are off; None if they are so apart."""
    right = np.concatenate([each.slopes.ravel() for each in expansions])
    off = np.concatenate([each.rate(0).value.ravel() for each in expansions])
    found = projected(off, right[None])
    return found if found.rest <= _EXPLAINED * np.max(np.abs(right)) else None


def _changed(expansion: Expansion, several: list[Parameter]) -> tuple[np.ndarray, float]:
    """By which parts parameters are changed in the equation that a step solves, and the rest."""
    target = expansion.slopes + expansion.rate(0).value
    leaves, structure = jax.tree.flatten(expansion.problem.args)

    def away(change: np.ndarray) -> np.ndarray:
        values = list(leaves)
        for each, part in zip(several, change.tolist(), strict=True):
            values[each.index] = np.asarray(leaves[each.index]) * (1.0 + part)
        rates = rates_of(expansion.problem, jax.tree.unflatten(structure, values))
        return (rates(expansion.t, expansion.y) - target).ravel()

    none = np.zeros(len(several))
    found = least_squares(away, none, "3-point", ftol=_CLOSE, xtol=_CLOSE, gtol=_CLOSE)
    return found.x, float(np.max(np.abs(found.fun)))


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
