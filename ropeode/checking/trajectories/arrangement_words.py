"""What is wrong with an arrangement of columns, in words."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

from ropeode.checking.trajectories.arrangement import Arrangement, Held
from ropeode.checking.trajectories.run_files import Run
from ropeode.validation import listed

# What columns hold, where there are no velocities beside them.
_NUMBERS = {"": "positions", "state": "numbers"}


class Mistake(NamedTuple):
    """One mistake, and how to mend it."""

    words: str
    fix: str


def mistakes_in(arrangement: Arrangement, run: Run) -> list[Mistake]:
    """The mistakes that make an arrangement of the columns of a run."""
    axes, names = run.layout.axes, run.problem.quantities
    positions, *others = arrangement.held
    if not others:
        return _alone(positions, axes, "" if run.layout.mechanical else "state")
    (velocities,) = others
    speeds = tuple(f"v{axis}" for axis in axes)
    leave_out = "write the velocities, or leave their columns out"
    if velocities.source is None:
        return [
            *_alone(positions, axes),
            Mistake("the velocities are zero", leave_out),
        ]
    if velocities.source == names[0] == positions.source:
        mistake = Mistake("the columns of the velocities hold positions", leave_out)
        return [*_alone(positions, axes), mistake]
    found = []
    if positions.source == names[1]:
        words = "the columns hold the velocities before the positions"
        found.append(Mistake(words, "write the positions before the velocities"))
        positions, velocities = velocities, positions
    if not _alike(positions, velocities):
        return [*found, *_alone(positions, axes), *_alone(velocities, speeds, "velocities")]
    found += [*_order_of_nodes(positions, ""), *_exchanged(positions, axes)]
    both = tuple(a or b for a, b in zip(positions.signs, velocities.signs, strict=True))
    found += _mirrored(both, axes)
    same = positions.power == velocities.power and positions.factor == velocities.factor
    if same and not velocities.weights:
        found += _scaled(positions, "all numbers")
    else:
        found += [*_scaled(positions, "positions"), *_scaled(velocities, "velocities")]
    return [*found, *_moved(positions, "positions")]


def _alone(held: Held, axes: Sequence[str], name: str = "") -> list[Mistake]:
    """The mistakes in one quantity; without its name if there is no other."""
    if name == "velocities" and all(sign <= 0 for sign in held.signs):
        sign = [Mistake("the velocities have the wrong sign", "write them with the other sign")]
    else:
        sign = _mirrored(held.signs, axes)
    return [
        *_order_of_nodes(held, name),
        *_exchanged(held, axes),
        *(sign if -1 in held.signs else []),
        *_scaled(held, _NUMBERS.get(name, name)),
        *_moved(held, _NUMBERS.get(name, name)),
    ]


def _alike(a: Held, b: Held) -> bool:
    """Whether positions and velocities have the same axes, signs and order of nodes."""
    signs = all(x == y or not x * y for x, y in zip(a.signs, b.signs, strict=True))
    return a.axes == b.axes and a.reverse == b.reverse and signs


def _order_of_nodes(held: Held, name: str) -> list[Mistake]:
    if not held.reverse:
        return []
    if name == "state":
        return [Mistake("the components are in reverse order", "write the first one first")]
    whose = f" of the {name}" if name else ""
    return [Mistake(f"the nodes{whose} are in reverse order", "number nodes from the other end")]


def _exchanged(held: Held, axes: Sequence[str]) -> list[Mistake]:
    moved = [(axes[k], axes[axis]) for k, axis in enumerate(held.axes) if k != axis]
    if not moved:
        return []
    words = [f"column {column} holds {axis}" for column, axis in moved]
    return [Mistake(listed(words), f"write {' before '.join(axes)}")]


def _mirrored(signs: Sequence[int], axes: Sequence[str]) -> list[Mistake]:
    fix = "let {} point in the direction of the spec"
    return [
        Mistake(f"{axis} points the other way", fix.format(axis))
        for axis, sign in zip(axes, signs, strict=True)
        if sign < 0
    ]


def _scaled(held: Held, what: str) -> list[Mistake]:
    if held.weights:
        words = f"{what} are multiplied by the masses"
        return [Mistake(words, "divide them by the masses"), *_scaled(_without(held), what)]
    if held.factor == 1.0 and held.power == 0:
        return []
    factor = "" if held.factor == 1.0 else f"{held.factor:.6g} "
    if held.power == 0:
        words, fix = f"{factor}times those of the problem", "write them in the problem's units"
    elif held.power == 1:
        words, fix = f"{factor}dt times those of the problem: per step", "divide them by dt"
    else:
        words, fix = f"{factor}1/dt times those of the problem", "multiply them by dt"
    return [Mistake(f"{what} are {words}", fix)]


def _without(held: Held) -> Held:
    return dataclasses.replace(held, weights=())


def _moved(held: Held, what: str) -> list[Mistake]:
    if not held.offset:
        return []
    words = f"{what} are shifted by ({', '.join(f'{each:.6g}' for each in held.offset)})"
    return [Mistake(words, "use the origin of the spec")]
