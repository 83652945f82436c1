"""A rope's forces with the terms that programs get wrong, for many copies of the rope at once."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ropeode.problems import Problem
from ropeode.theory.rope_terms import TermPlace
from ropeode.theory.terms import AXES, LAWS, MISTAKES, TERMS

# The numbers of a rope without springs.
_NUMBERS = {"mass", "rest_length", "free", "gravity", "damping"}

# How closely factors are the same.
_SAME = 1e-12
# Values of terms by name, ``(copies,)`` each, or ``(copies, places)`` for each node or spring.
Terms = Mapping[str, np.ndarray]


def right_terms(copies: int) -> dict[str, np.ndarray]:
    """The terms of right programs."""
    terms = {name: np.full(copies, term.expected) for name, term in TERMS.items()}
    return terms | {name: np.zeros(copies) for name in LAWS}


class KnownMistake(NamedTuple):
    """A mistake of `MISTAKES` or `LAWS` on one rope.

    Fields:
        kind: of the term.
        words: what follows its name.
        values: of terms, for each node or spring; 1 of another law.
        number: by which it multiplies a term, if it is the same everywhere on this rope.
    """

    kind: str
    words: str
    values: Mapping[str, np.ndarray]
    number: float | None = None


def known_mistakes(args: Any) -> list[KnownMistake]:
    """The mistakes that change the motion of a rope; of those that change it alike the first.

    Arguments:
        args: the rope's numbers.
    """
    at_nodes = [TermPlace(args, node, 0) for node in range(len(args.mass))]
    springs = range(len(args.rest_length) if hasattr(args, "stiffness") else 0)
    at_ends = [[TermPlace(args, i + end, i) for i in springs] for end in (0, 1)]
    places = {
        "mass": {"forces": at_nodes},
        "gravity": {"gravity": at_nodes},
        "damping": {"damping": at_nodes},
        "spring": dict(zip(("first_ends", "second_ends"), at_ends, strict=True)),
        "rest": {"rest": at_ends[0]},
    }
    found: dict[bytes, KnownMistake] = {}
    for kind in places if springs else ("gravity", "damping"):
        for mistake in MISTAKES[kind]:
            with np.errstate(all="ignore"):  # A length or a damping of zero.
                values = {
                    name: np.array([mistake.factor(place) for place in at])
                    for name, at in places[kind].items()
                }
            effect = _effect(args, values)
            changed = np.concatenate(effect)
            if not np.all(np.isfinite(changed)) or np.allclose(changed, 1.0, rtol=0.0, atol=_SAME):
                continue
            own = np.concatenate([part for part in effect if not np.all(part == 1.0)])
            number = float(own[0]) if np.ptp(own) <= _SAME * abs(own[0]) else None
            key = np.round(changed, 12).tobytes()
            found.setdefault(key, KnownMistake(kind, mistake.words, values, number))
    laws = [
        KnownMistake(law.kind, law.words, {name: np.ones(1)})
        for name, law in LAWS.items()
        if (springs if law.kind == "spring" else np.any(args.damping))
    ]
    return [*found.values(), *laws]


def _effect(args: Any, values: Mapping[str, np.ndarray]) -> list[np.ndarray]:
    """The factors of all terms that a rope has, at its free nodes and at its springs."""

    def of(name: str) -> np.ndarray:
        return values.get(name, np.ones(1))

    free, forces = args.free != 0.0, of("forces") * np.ones(len(args.mass))
    damped = free & (args.damping != 0.0)
    effect = [(of("damping") * forces)[damped]]
    if np.any(args.gravity):
        effect.append((of("gravity") * np.ones(len(free)))[free])
    if hasattr(args, "stiffness"):
        effect.append((of("first_ends") * forces[:-1])[free[:-1]])
        effect.append((of("second_ends") * forces[1:])[free[1:]])
        effect.append(of("rest"))
    return effect


def has_rope_forces(problem: Problem) -> bool:
    """Whether a problem is a rope (springs or rigid links) whose state is ``(2, dim, nodes)``."""
    fields = {*getattr(problem.args, "_fields", ())}
    return (
        problem.mechanics is not None
        and problem.y0.ndim == 3
        and fields >= _NUMBERS
        and np.shape(problem.args.mass) == problem.y0.shape[2:]
        and np.size(problem.args.gravity) == problem.y0.shape[1] <= len(AXES)
    )


def initial_states(problem: Problem, terms: Terms) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities with which copies of a program begin, ``(copies, dim, nodes)``."""
    copies, (x, v) = len(terms["velocity"]), problem.y0
    more = np.stack([terms[f"velocity_{axis}"] for axis in AXES[: len(v)]], axis=1)
    velocity = terms["velocity"][:, None, None] * v + more[:, :, None] * problem.args.free
    return np.repeat(x[None], copies, axis=0), velocity


class Forces:
    """A rope's forces in several copies of a program, each with terms of its own.

    Arguments:
        args: the rope's numbers.
        terms: of the copies.
        single: whether the lengths of springs are rounded to single precision.
    """

    def __init__(self, args: Any, terms: Terms, *, single: bool = False):
        self._args, self._single = args, single
        self._of = {name: value.reshape(len(value), 1, -1) for name, value in terms.items()}
        gravity = np.reshape(args.gravity, (-1, 1))
        more = [self._of[f"gravity_{axis}"] for axis in AXES[: len(gravity)]]
        self._gravity = self._of["gravity"] * gravity + np.concatenate(more, axis=1)
        self.last: np.ndarray | None = None
        self._old_force: np.ndarray | float = 0.0
        self._old_gravity: np.ndarray | float = 0.0
        springs_at = np.ones(len(args.mass))
        springs_at[1:-1] = 2.0
        further = self._of["further"] + self._of["per_spring"] * springs_at
        self._drag, self._further = -self._of["damping"] * args.damping, -further
        self._laws = {name for name in ("dashpot", *LAWS) if np.any(terms[name])}

    def __call__(self, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        """The acceleration, of which a program may keep a part for its next step.

        Arguments:
            x: positions, ``(copies, dim, nodes)``.
            v: velocities, likewise.
        """
        of, args = self._of, self._args
        v = v / of["kept"]
        force = self._lawful("damping", self._drag, v=v) * v + self._further * v
        if hasattr(args, "stiffness"):
            pull = self._pull(x, v)
            force[:, :, :-1] += of["first_ends"] * pull
            force[:, :, 1:] -= of["second_ends"] * pull
        force = of["forces"] * force + of["old_forces"] * self._old_force
        gravity = self._gravity + of["old_gravity"] * self._old_gravity
        self._old_force, self._old_gravity = force, gravity
        acceleration = of["all"] * args.free * (force / args.mass + gravity)
        self.last = acceleration
        return acceleration

    def _pull(self, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        """The force of each spring on the node before it."""
        of, args = self._of, self._args
        d = x[:, :, 1:] - x[:, :, :-1]
        length = np.sqrt(np.einsum("cdn,cdn->cn", d, d))[:, None]
        if self._single:
            length = length.astype(np.float32).astype(np.float64)
        along = d / length
        stretch = length - of["rest"] * args.rest_length
        tension = of["spring"] * args.stiffness * stretch
        tension = self._lawful("spring", tension, length=length, stretch=stretch)
        if "dashpot" in self._laws:
            apart = np.einsum("cdn,cdn->cn", v[:, :, 1:] - v[:, :, :-1], along)[:, None]
            tension = tension + of["dashpot"] * apart
        return tension * along

    def _lawful(self, kind: str, right: np.ndarray, **measures: np.ndarray) -> np.ndarray:
        """A term as the copies have it whose law is another."""
        for name in self._laws & {*LAWS}:
            if LAWS[name].kind == kind:
                factor = LAWS[name].factor(**measures)
                right = np.where(self._of[name] != 0.0, right * factor, right)
        return right
