"""The equation that a step solves, as the problem's own with other parameters."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

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
    for several in [*([name] for name in some), *([[*some]] if len(some) > 1 else [])]:
        change, rest = _changed(expansion, [some[name][0] for name in several])
        if rest <= _EXPLAINED * size:
            changed = zip(several, (1.0 + change).tolist(), strict=True)
            factors = {name: factor for name, factor in changed if abs(factor - 1.0) > _EXPLAINED}
            words = (_multiplied(name, some[name][1], factor) for name, factor in factors.items())
            line = f"it is f with {', '.join(words)}"
            return Diagnosis("parameters", line, {"factors": factors, "rest": rest})
    return _by_component(expansion, size)


def parameters(problem: Problem) -> dict[str, tuple[int, np.ndarray]]:
    """Those of a problem that are numbers other than 0, or arrays of such, by name.

    Each with its place among the leaves of `Problem.args`.
    """
    found = {}
    for index, (path, leaf) in enumerate(jax.tree_util.tree_flatten_with_path(problem.args)[0]):
        value = np.asarray(leaf)
        if np.issubdtype(value.dtype, np.floating) and np.any(value):
            name = jax.tree_util.keystr(path, simple=True, separator=".")
            found[name or "args"] = index, value
    return found


def _multiplied(name: str, value: np.ndarray, factor: float) -> str:
    if value.size > 1:
        return f"{name} multiplied by {factor:.8g}"
    return f"{name} = {factor * value.item():.8g} in place of {value.item():.8g}"


def common_pace(expansions: Sequence[Expansion]) -> Projection | None:
    """By which part of the right rates of change all others are off; None if they are so apart."""
    right = np.concatenate([each.slopes.ravel() for each in expansions])
    off = np.concatenate([each.rate(0).value.ravel() for each in expansions])
    found = projected(off, right[None])
    return found if found.rest <= _EXPLAINED * np.max(np.abs(right)) else None


def _changed(expansion: Expansion, several: list[int]) -> tuple[np.ndarray, float]:
    """By which parts parameters are changed in the equation that a step solves, and the rest."""
    target = expansion.slopes + expansion.rate(0).value
    leaves, structure = jax.tree.flatten(expansion.problem.args)

    def away(change: np.ndarray) -> np.ndarray:
        values = list(leaves)
        for index, part in zip(several, change.tolist(), strict=True):
            values[index] = np.asarray(leaves[index]) * (1.0 + part)
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
