"""The terms of a rope's acceleration, and of those that people write in its place."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from ropeode.problems import Problem

_ARGUMENTS = {"mass", "stiffness", "rest_length", "free", "gravity", "damping"}


def is_rope(problem: Problem) -> bool:
    """Whether a problem is one rope, whose acceleration is made of the terms of this module."""
    return (
        problem.mechanics is not None
        and problem.y0.ndim == 3
        and {*getattr(problem.args, "_fields", ())} >= _ARGUMENTS
        and np.ndim(problem.args.mass) == 1
    )


class TermPlace(NamedTuple):
    """Where a term stands in the equations of a rope.

    Fields:
        args: of the rope.
        node: whose acceleration it is part of.
        element: a spring for `spring`, `rest` and other forces of springs, an axis for `gravity`
            and `drive`, and which of its parts for another force on a node.
    """

    args: Any
    node: int
    element: int


class RopeTerm(NamedTuple):
    """One term of the acceleration of one node.

    Fields:
        kind: `gravity`, `spring`, `rest`, `damping` or `drive`; `spring` is a force proportional
            to the length, and `rest` the constant one that is taken off it. Others are not terms
            of a rope.
        place: where it stands.
        values: at each of several states, ``(states, dim)``.
    """

    kind: str
    place: TermPlace
    values: np.ndarray


class Motion(NamedTuple):
    """States of a rope, with `args` as `RopeArgs` or `CheckArgs` name them.

    Fields:
        args: of the rope.
        t: times, ``(states,)``.
        x: positions, ``(states, nodes, dim)``.
        v: velocities, likewise.
    """

    args: Any
    t: np.ndarray
    x: np.ndarray
    v: np.ndarray

    def springs(self, node: int) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
        """Each spring at a node: its index, the vector to the other end, and that end's motion."""
        for spring, other in ((node - 1, node - 1), (node, node + 1)):
            if 0 <= other < self.x.shape[1]:
                yield spring, self.x[:, other] - self.x[:, node], self.v[:, other] - self.v[:, node]


def own_terms(motion: Motion, node: int) -> list[RopeTerm]:
    """The terms whose sum is the acceleration of a free node, as far as they are not zero."""
    args, mass, v = motion.args, motion.args.mass[node], motion.v[:, node]
    pushes = {"gravity": args.gravity.ravel() * np.ones(v.shape)}
    if hasattr(args, "drive"):
        pushes["drive"] = args.drive * np.cos(args.frequency * motion.t)[:, None]
    terms = [
        RopeTerm(kind, TermPlace(args, node, axis), push * along)
        for kind, push in pushes.items()
        for axis, along in enumerate(np.eye(v.shape[1]))
    ]
    for spring, d, _ in motion.springs(node):
        place, pull = TermPlace(args, node, spring), args.stiffness[spring] / mass * d
        terms.append(RopeTerm("spring", place, pull))
        terms.append(RopeTerm("rest", place, -args.rest_length[spring] / _length(d) * pull))
    damping = -args.damping[node] / mass * v
    terms.append(RopeTerm("damping", TermPlace(args, node, node), damping))
    return [term for term in terms if np.any(term.values)]


def _length(d: np.ndarray) -> np.ndarray:
    return np.linalg.norm(d, axis=-1, keepdims=True)


class Law(NamedTuple):
    """Another law that people write for a term, with the same coefficient.

    Fields:
        kind: of the term.
        words: what follows its name.
        factor: by which it multiplies the right term: of the length and stretch of springs, or of
            the velocity, whose second axis is that of components.
    """

    kind: str
    words: str
    factor: Callable[..., np.ndarray]


def _speed(v: np.ndarray) -> np.ndarray:
    return np.sqrt(np.sum(v * v, axis=1, keepdims=True))


def _rest(length: np.ndarray, stretch: np.ndarray) -> np.ndarray:
    return np.maximum(length - stretch, np.finfo(float).tiny)


LAWS = {
    "undivided": Law(
        "spring",
        "is not divided by the length: its direction is no unit vector",
        lambda length, stretch: length,
    ),
    "squared_stretch": Law(
        "spring", "grows with the square of the stretch", lambda length, stretch: np.abs(stretch)
    ),
    "pulling_square": Law(
        "spring",
        "grows with the square of the stretch, and pulls where a spring is pressed",
        lambda length, stretch: stretch,
    ),
    "squared_strain": Law(
        "spring",
        "grows with the square of the stretch over the rest length, and pulls where a spring is "
        "pressed",
        lambda length, stretch: stretch / _rest(length, stretch) ** 2,
    ),
    "squares": Law(
        "spring",
        "grows with the squared length less the squared rest length",
        lambda length, stretch: length + _rest(length, stretch),
    ),
    "pulls_only": Law(
        "spring",
        "is left out where a spring is shorter than its rest length",
        lambda length, stretch: np.where(stretch > 0.0, 1.0, 0.0),
    ),
    "squared_speed": Law("damping", "grows with the square of the speed", _speed),
    "squared_components": Law(
        "damping",
        "grows with the square of each component of the velocity",
        lambda v: np.abs(v),
    ),
    "unsigned": Law(
        "damping",
        "takes each component of the velocity without its sign",
        lambda v: np.sign(v),
    ),
    "unsigned_square": Law(
        "damping",
        "takes the square of each component of the velocity, without its sign",
        lambda v: v,
    ),
    "no_speed": Law(
        "damping",
        "does not depend on the speed",
        lambda v: 1.0 / np.maximum(_speed(v), np.finfo(float).tiny),
    ),
}


# What people write that is no term of a rope: for a node and one of its springs, the vector to the
# other end and that end's relative velocity give a force; for a node alone its motion does.
SpringLaw = Callable[[Motion, int, np.ndarray, np.ndarray], np.ndarray]
NodeLaw = Callable[[Motion, int], np.ndarray]


class OtherLaw(NamedTuple):
    """A force, or an acceleration, that people write and that is no term of a rope.

    Fields:
        parts: whose sum it is, with a coefficient each; of springs in turn, if it is their force.
        of_springs: whether it is.
        replaces: the term that must be left out for `words` to be true; a key of `TERMS` or empty.
        words: a sentence for it if it has a certain coefficient; empty if there is none.
        coefficient: this one.
    """

    parts: tuple[Callable[..., np.ndarray], ...]
    of_springs: bool = False
    replaces: str = ""
    words: str = ""
    coefficient: str = "1"


def _force(motion: Motion, spring: int, d: np.ndarray, w: np.ndarray) -> np.ndarray:
    return motion.args.stiffness[spring] * (1.0 - _slack(motion, spring, d)) * d


def _slack(motion: Motion, spring: int, d: np.ndarray) -> np.ndarray:
    """Rest length over length: above 1 where the spring is slack."""
    return motion.args.rest_length[spring] / _length(d)


def _springs(*parts: SpringLaw, **instead: str) -> OtherLaw:
    return OtherLaw(parts, True, **instead)


def _spring_law(law: Law) -> OtherLaw:
    def force(motion: Motion, spring: int, d: np.ndarray, w: np.ndarray) -> np.ndarray:
        length = _length(d)
        stretch = length - motion.args.rest_length[spring]
        return _force(motion, spring, d, w) * law.factor(length=length, stretch=stretch)

    return _springs(force, replaces="spring", words=f"the spring force {law.words}")


def _along(axis: int) -> OtherLaw:
    return _springs(
        lambda motion, spring, d, w: _force(motion, spring, d, w) * np.eye(3)[axis, : d.shape[1]],
        words=f"the spring force along {'xyz'[axis]} is left out",
        coefficient="-1",
    )


def _direction(words: str, length: Callable[[np.ndarray], np.ndarray]) -> OtherLaw:
    """The constant part of a spring's force, in a direction that is divided by another length."""

    def law(motion: Motion, spring: int, d: np.ndarray, w: np.ndarray) -> np.ndarray:
        args = motion.args
        return -args.stiffness[spring] * args.rest_length[spring] * d / length(d)

    return _springs(law, replaces="rest", words=f"the rest length's direction is {words}")


def _in_plane(d: np.ndarray, plane: str) -> np.ndarray:
    """The length of what lies in a plane, as far as there are such axes."""
    return _length(
        d[:, [axis for axis in map("xyz".index, plane.split(" and ")) if axis < d.shape[1]]]
    )


def _to_node(other: int, power: int) -> NodeLaw:
    """A force towards a node that no spring joins to this one; none to its neighbours."""

    def law(motion: Motion, node: int) -> np.ndarray:
        if other >= motion.x.shape[1] or abs(other - node) < 2:
            return np.zeros(motion.x[:, node].shape)
        d = motion.x[:, other] - motion.x[:, node]
        return d / _length(d) ** power

    return law


def _drive(words: str, factor: Callable[[np.ndarray, float], np.ndarray]) -> OtherLaw:
    """The drive with another function of time and frequency."""

    def law(motion: Motion, node: int) -> np.ndarray:
        args = motion.args
        if not hasattr(args, "drive"):
            return np.zeros(motion.x[:, node].shape)
        return factor(motion.t, float(args.frequency))[:, None] * args.drive

    return OtherLaw((law,), replaces="drive", words=f"the driving force is the one {words}")


def _drag(law: Law) -> OtherLaw:
    return OtherLaw(
        (lambda motion, node: law.factor(v=motion.v[:, node]) * motion.v[:, node],),
        replaces="damping",
        words=f"the damping {law.words}",
        coefficient=f"-1{PER_DAMPING}",
    )


# How a coefficient is written that is a multiple of a node's damping rate.
PER_DAMPING = " * damping / mass"
NOT_JOINED = "a force between nodes that no spring joins"
OF_ZERO = "a driving force of t = 0"
OTHER_LAWS: dict[str, OtherLaw] = {
    **{f"drag that {law.words}": _drag(law) for law in LAWS.values() if law.kind == "damping"},
    **{
        f"a driving force {words}": _drive(words, factor)
        for words, factor in {
            "of t = 0": lambda t, w: np.ones(len(t)),
            "with a sine in place of the cosine": lambda t, w: np.sin(w * t),
            "of 1000 t": lambda t, w: np.cos(1000.0 * w * t),
            "with 2 pi times the frequency": lambda t, w: np.cos(2.0 * np.pi * w * t),
            "with the frequency over 2 pi": lambda t, w: np.cos(w * t / (2.0 * np.pi)),
        }.items()
    },
    "a force along the position": OtherLaw((lambda motion, node: motion.x[:, node],)),
    "a force proportional to the velocity": OtherLaw((lambda motion, node: motion.v[:, node],)),
    NOT_JOINED: OtherLaw(tuple(_to_node(other, power) for other in range(5) for power in (0, 1))),
    "a constant acceleration": OtherLaw(
        tuple(
            lambda motion, node, axis=axis: np.broadcast_to(
                np.eye(3)[axis, : motion.x.shape[2]], motion.x[:, node].shape
            )
            for axis in range(3)
        )
    ),
    **{
        f"a spring force that {law.words}": _spring_law(law)
        for law in LAWS.values()
        if law.kind == "spring"
    },
    "a dashpot along each spring": _springs(
        lambda motion, spring, d, w: d * np.sum(d * w, axis=1, keepdims=True) / _length(d) ** 2
    ),
    "friction between neighbours": _springs(lambda motion, spring, d, w: w),
    "a force of slack springs": _springs(
        lambda motion, spring, d, w: np.where(
            _slack(motion, spring, d) > 1.0, _force(motion, spring, d, w), 0.0
        ),
        words="a force of slack springs is left out",
        coefficient="-1",
    ),
    **{f"a spring force along {'xyz'[axis]}": _along(axis) for axis in range(3)},
    **{
        f"a rest length whose direction is {words}": _direction(words, length)
        for words, length in {
            **{
                f"divided by a length of {plane} alone": lambda d, plane=plane: _in_plane(d, plane)
                for plane in ("x and y", "x and z", "y and z")
            },
            "divided by a sum of coordinates": lambda d: np.sum(np.abs(d), axis=1, keepdims=True),
            "not divided by the length": lambda d: np.ones((len(d), 1)),
            "divided by the square of the length": lambda d: _length(d) ** 2,
        }.items()
    },
    "a spring force that is no linear function of the length": _springs(
        lambda motion, spring, d, w: d * _length(d),
        lambda motion, spring, d, w: d * _length(d) ** 2,
        lambda motion, spring, d, w: d / _length(d) ** 2,
        lambda motion, spring, d, w: d / _length(d) ** 3,
    ),
}


def other_terms(motion: Motion, node: int, name: str) -> list[RopeTerm]:
    """Terms of one of `OTHER_LAWS` in the acceleration of a node."""
    args, law = motion.args, OTHER_LAWS[name]
    if not law.of_springs:
        return [
            RopeTerm(name, TermPlace(args, node, part), each(motion, node))
            for part, each in enumerate(law.parts)
        ]
    return [
        RopeTerm(name, TermPlace(args, node, spring), each(motion, spring, d, w) / args.mass[node])
        for spring, d, w in motion.springs(node)
        for each in law.parts
    ]
