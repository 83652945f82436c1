"""Forces with the terms that programs get wrong, for many copies of a program at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import jax
import numpy as np

from ropeode.problems import Problem, compiled
from ropeode.theory import is_rope
from ropeode.theory.terms import AXES, LAWS, TERMS

# The numbers of a rope without springs.
_NUMBERS = {"mass", "rest_length", "free", "gravity", "damping"}

# Values of terms by name, ``(copies,)`` each, or ``(copies, places)`` for each node or spring.
Terms = Mapping[str, np.ndarray]


def right_terms(copies: int) -> dict[str, np.ndarray]:
    """The terms of right programs."""
    terms = {name: np.full(copies, term.expected) for name, term in TERMS.items()}
    return terms | {name: np.zeros(copies) for name in LAWS}


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


def has_rigid_links(problem: Problem) -> bool:
    """Whether a problem is a rope without springs."""
    return has_rope_forces(problem) and not is_rope(problem)


def initial_states(problem: Problem, terms: Terms) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities with which copies of a program begin, ``(copies, dim, nodes)``."""
    copies, (x, v) = len(terms["velocity"]), problem.y0
    if not has_rope_forces(problem):
        return np.repeat(x[None], copies, axis=0), terms["velocity"][:, None, None] * v
    more = np.stack([terms[f"velocity_{axis}"] for axis in AXES[: len(v)]], axis=1)
    velocity = terms["velocity"][:, None, None] * v + more[:, :, None] * problem.args.free
    return np.repeat(x[None], copies, axis=0), velocity


def forces_of(problem: Problem, terms: Terms, *, single: bool = False) -> Forces | AnyForces:
    """Those of a problem in several copies of a program; arguments as for `Forces`."""
    if has_rope_forces(problem):
        return Forces(problem.args, terms, single=single)
    return AnyForces(problem, terms)


def is_autonomous(problem: Problem) -> bool:
    """Whether a problem has accelerations that JAX evaluates and that depend on no time."""
    if problem.mechanics is None or problem.y0.ndim != 3 or problem.in_python:
        return False
    a, (x, v) = problem.mechanics.acceleration, problem.y0
    early, late = (np.asarray(a(t, x, v, problem.args)) for t in problem.ts[[0, -1]])
    return np.array_equal(early, late)


class AnyForces:
    """The acceleration of any problem in several copies of a program.

    Arguments:
        problem: that `is_autonomous`.
        terms: of the copies, of which those count that every problem has.
    """

    def __init__(self, problem: Problem, terms: Terms):
        assert problem.mechanics is not None
        self._problem, self._right = problem, compiled(_of_copies, problem.mechanics.acceleration)
        self._of = {name: terms[name][:, None, None] for name in ("all", "kept", "old_forces")}
        self.last: np.ndarray | None = None
        self._old: np.ndarray | float = 0.0

    def __call__(self, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        """The acceleration, of which a program may keep a part for its next step.

        Arguments:
            x: positions, ``(copies, ...)`` as the problem has them.
            v: velocities, likewise.
        """
        of, copies = self._of, len(x)
        # One compiled program serves up to twice as many copies.
        padded = (
            np.resize(part, (1 << (copies - 1).bit_length(), *part.shape[1:]))
            for part in (x, v / of["kept"])
        )
        force = np.asarray(self._right(self._problem.ts[0], *padded, self._problem.args))[:copies]
        force = force + of["old_forces"] * self._old
        self._old = force
        self.last = of["all"] * force
        return self.last


def _of_copies(acceleration: Callable) -> Callable:
    return jax.vmap(acceleration, (None, 0, 0, None))


class Forces:
    """A rope's forces in several copies of a program, each with terms of its own.

    Arguments:
        args: the rope's numbers.
        terms: of the copies.
        single: whether the lengths of springs are rounded to single precision.
    """

    def __init__(self, args: Any, terms: Terms, *, single: bool = False):
        self._args, self._single = args, single
        of = {name: value.reshape(len(value), 1, -1) for name, value in terms.items()}
        # Most terms are right in all copies, and cost nothing then.
        self._of = {name: of[name] for name in TERMS if np.any(of[name] != TERMS[name].expected)}
        gravity = np.reshape(args.gravity, (-1, 1))
        more = [of[f"gravity_{axis}"] for axis in AXES[: len(gravity)]]
        self._gravity = of["gravity"] * gravity + np.concatenate(more, axis=1)
        self.last: np.ndarray | None = None
        self._old_force: np.ndarray | float = 0.0
        self._old_gravity: np.ndarray | float = 0.0
        springs_at = np.ones(len(args.mass))
        springs_at[1:-1] = 2.0
        further = -of["further"] - of["per_spring"] * springs_at
        self._further = further if np.any(further) else None
        self._drag, self._moves = -of["damping"] * args.damping, of["all"] * args.free
        if hasattr(args, "stiffness"):
            self._stiffness = of["spring"] * args.stiffness
            self._rest_length = of["rest"] * args.rest_length
        self._at: np.ndarray | None = None
        self._laws = {
            kind: [
                (law.factor, of[name] != 0.0)
                for name, law in LAWS.items()
                if law.kind == kind and np.any(of[name])
            ]
            for kind in ("damping", "spring")
        }

    def __call__(self, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        """The acceleration, of which a program may keep a part for its next step.

        Arguments:
            x: positions, ``(copies, dim, nodes)``.
            v: velocities, likewise.
        """
        of, gravity = self._of, self._gravity
        if "kept" in of:
            v = v / of["kept"]
        force = self._lawful("damping", self._drag, v=v) * v
        if self._further is not None:
            force += self._further * v
        if hasattr(self._args, "stiffness"):
            pull = self._pull(x, v)
            force[:, :, :-1] += self._times("first_ends", pull)
            force[:, :, 1:] -= self._times("second_ends", pull)
        force = self._times("forces", force)
        if "old_forces" in of:
            self._old_force = force = force + of["old_forces"] * self._old_force
        if "old_gravity" in of:
            self._old_gravity = gravity = gravity + of["old_gravity"] * self._old_gravity
        self.last = acceleration = self._moves * (force / self._args.mass + gravity)
        return acceleration

    def _times(self, name: str, values: np.ndarray) -> np.ndarray:
        """Values times a term that is 1 in right programs."""
        return self._of[name] * values if name in self._of else values

    def _pull(self, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        """The force of each spring on the node before it."""
        # A velocity that depends on its own damping is sought at one place.
        if x is not self._at:
            self._at, self._springs = x, self._tensions(x)
        tension, along = self._springs
        if "dashpot" in self._of:
            apart = np.einsum("cdn,cdn->cn", v[:, :, 1:] - v[:, :, :-1], along)[:, None]
            tension = tension + self._of["dashpot"] * apart
        return tension * along

    def _tensions(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The tension of each spring without its damping, and its direction."""
        d = x[:, :, 1:] - x[:, :, :-1]
        length = np.sqrt(np.einsum("cdn,cdn->cn", d, d))[:, None]
        if self._single:
            length = length.astype(np.float32).astype(np.float64)
        stretch = length - self._rest_length
        tension = self._lawful("spring", self._stiffness * stretch, length=length, stretch=stretch)
        return tension, d / length

    def _lawful(self, kind: str, right: np.ndarray, **measures: np.ndarray) -> np.ndarray:
        """A term as the copies have it whose law is another."""
        for factor, has_it in self._laws[kind]:
            right = np.where(has_it, right * factor(**measures), right)
        return right
