"""Why a step that solves the right equation is of order 1: which terms of dt^2 are off."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ropeode.checking.report import Diagnosis
from ropeode.precision import in_float64
from ropeode.problems import Acceleration, compiled
from ropeode.theory import Expansion, projected

# What may be left over of the local error, and how close coefficients must be.
_EXPLAINED, _CLOSE = 1e-4, 1e-3
# The terms of x'' and of v'' in the equation: the whole acceleration and what damping adds to it;
# what the force's time, its own node's position, its neighbours' positions before and behind it in
# the row, and the velocity change in it.
_OF_X = ("force", "damping")
_OF_V = ("time", "own position", "node before", "node behind", "velocity")
# What is said of several terms at once if they have the same factor; the first that fits is.
_TAKEN = {
    "the force is taken": _OF_V,
    "the force takes the positions": _OF_V[1:4],
    **{f"the force takes the {name}": (name,) for name in _OF_V[:4]},
    "the damping takes the velocity": ("velocity",),
}
_POSITIONS = {
    0.0: "the half of dt^2 a is missing in the positions",
    1.0: "the positions contain dt^2 a in place of dt^2/2 a, as x + dt v_new does",
}
_TIMES = {0.0: "of the beginning of the step alone", 1.0: "of the end of the step alone"}
_OF_POSITIONS = "x_new = x + dt * v + dt**2 / 2 * a"
_OF_FORCES = "v_new = v + dt / 2 * (a(t, x, v) + a(t + dt, x_new, v_new))"
# The causes of which one term alone is wrong, and the line that mends it.
_ALONE: dict[tuple[str, ...], tuple[str, str]] = {
    ("velocity",): ("lagged-damping", "damping force: -damping * (v + v_new) / 2"),
    ("time",): ("stage-time", _OF_FORCES),
}
_STAGES = (
    "let each stage have a time, positions and velocities of its own, and take forces of these: "
    "k2 = f(t + c * dt, y + c * dt * k1), with y = (x, v)"
)


def diagnose_order_1(expansions: Sequence[Expansion], expected: int) -> Diagnosis | None:
    """Which terms of dt^2 are off, by the coefficients that they have in place of 1/2.

    Arguments:
        expansions: of a step of order 1.
        expected: the order that is claimed; the lines of a method of order 2 mend no higher one.

    Returns:
        None if they are off in no way that is known.
    """
    terms = [_terms(each) for each in expansions]
    found: dict[str, dict[str, float]] = {}
    for half, (quantity, names) in enumerate((("positions", _OF_X), ("velocities", _OF_V))):
        target = np.concatenate([each.rate(1).value[:, half].ravel() for each in expansions])
        fields = np.concatenate([each[half] for each in terms], axis=1)
        projection = projected(target, fields)
        if projection.rest > _EXPLAINED * float(np.max(np.abs(fields))):
            return None
        found[quantity] = {
            name: 0.5 + float(value)
            for name, value, field in zip(names, projection.coefficients, fields, strict=True)
            if np.any(field)
        }
    named = _in_words(found)
    if named is None or expected <= 2 or named.cause == "in-place":
        return named
    return dataclasses.replace(named, remedy=_STAGES)


def _in_words(found: dict[str, dict[str, float]]) -> Diagnosis | None:
    x, v = found["positions"], found["velocities"]
    evidence = {"terms": found}
    before, behind = v.get("node before", 0.5), v.get("node behind", 0.5)
    wrong = tuple(name for name, value in v.items() if not _is(value, 0.5))
    right_positions = _is(_common(x), 0.5)
    if not _is(before, behind) and not (right_positions and wrong in _ALONE):
        return Diagnosis(
            "in-place",
            "nodes are updated in place: the neighbour before a node in the row has moved when "
            f"its force is computed, the one behind has not (their terms of dt^2 have the factors "
            f"{before:.3f} and {behind:.3f}; 1/2 is right)",
            evidence,
            "compute the forces on all nodes before the first one moves",
        )
    parts = [] if right_positions else [_of_positions(x)]
    left = {name: v[name] for name in wrong}
    for words, names in _TAKEN.items():
        those = {name: left[name] for name in names if name in left}
        if those and those.keys() == {*names} & v.keys() and (share := _common(those)) is not None:
            parts.append(f"{words} {_when(share)}")
            left = {name: value for name, value in left.items() if name not in those}
    if not parts:
        return None
    cause, mended = "order", _OF_FORCES
    if right_positions and wrong in _ALONE:
        cause, mended = _ALONE[wrong]
        parts.append("all else is right")
    remedies = [*([] if right_positions else [_OF_POSITIONS]), *([mended] if wrong else [])]
    return Diagnosis(cause, "; ".join(parts), evidence, "; ".join(remedies))


def _of_positions(x: dict[str, float]) -> str:
    common = _common(x)
    if common is None:
        return f"damping enters the positions with {x['damping']:.4g} dt^2 in place of 1/2 dt^2"
    known = (words for value, words in _POSITIONS.items() if _is(common, value))
    return next(known, f"the positions contain {common:.4g} dt^2 a in place of dt^2/2 a")


def _when(share: float) -> str:
    """The time at which something is taken, from its factor of dt^2 in the velocities."""
    known = (words for value, words in _TIMES.items() if _is(share, value))
    other = f"on average {share:.4g} dt after the beginning of the step, in place of dt/2"
    return next(known, other)


def _common(values: dict[str, float]) -> float | None:
    """The one value of all; None if they differ."""
    first, *others = values.values()
    return first if all(_is(value, first) for value in others) else None


def _is(value: float | None, other: float) -> bool:
    return value is not None and abs(value - other) <= _CLOSE


@in_float64
def _terms(expansion: Expansion) -> tuple[np.ndarray, np.ndarray]:
    """The terms of x'' and of v'' at all states, ``(terms, components)`` each."""
    problem = expansion.problem
    every = compiled(_both_terms, problem.require_mechanics("problem").acceleration)
    x, v = expansion.y[:, 0], expansion.y[:, 1]
    of_x, of_v = (np.moveaxis(each, 1, 0) for each in every(expansion.t, x, v, problem.args))
    return of_x.reshape(len(_OF_X), -1), of_v.reshape(len(_OF_V), -1)


def _both_terms(acceleration: Acceleration) -> Callable:
    """`_OF_X` and `_OF_V` of many states: ``(states, terms, nodes, dim)`` each."""

    def terms(t: Any, x: Any, v: Any, args: Any) -> Any:
        a, still = acceleration(t, x, v, args), acceleration(t, x, 0.0 * v, args)
        by_time = jax.jvp(lambda t: acceleration(t, x, v, args), (t,), (1.0,))[1]
        by_velocity = jax.jvp(lambda v: acceleration(t, x, v, args), (v,), (a,))[1]
        # What moves: the nodes before each node in the row, itself, and those behind it.
        row, jacobian = jnp.ones((len(x), len(x))), jax.jacfwd(acceleration, 1)(t, x, v, args)
        moving = jnp.stack([jnp.tril(row, -1), jnp.eye(len(x)), jnp.triu(row, 1)])
        before, own, behind = jnp.einsum("idjk,jk,mij->mid", jacobian, v, moving)
        return jnp.stack([still, a - still]), jnp.stack([by_time, own, before, behind, by_velocity])

    return jax.vmap(terms, in_axes=(0, 0, 0, None))
