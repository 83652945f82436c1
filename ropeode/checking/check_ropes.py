"""The ropes on which steppers are checked: one family, so that a stepper is compiled once."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from ropeode.problems import Problem, rope
from ropeode.problems.links import LinearDamping
from ropeode.problems.rope import RopeArgs
from ropeode.validation import is_traced

NODES, DIM = 5, 3


class CheckArgs(NamedTuple):
    """The parameters of a check rope, as the `args` of steppers under check.

    Fields:
        mass: of each node, ``(nodes,)``.
        stiffness: of each spring, ``(nodes - 1,)``.
        rest_length: of each spring, ``(nodes - 1,)``.
        free: 1 where a node is free and 0 where it is pinned, ``(nodes,)``.
        gravity: acceleration, ``(dim,)``.
        damping: coefficient of the force ``-damping v`` on each node, ``(nodes,)``.
        drive: amplitude of the acceleration ``drive cos(frequency t)`` of all free nodes,
            ``(dim,)``.
        frequency: of the drive, in radians per time unit.

    Examples:
        >>> from ropeode import check_stepper
        >>> def implicit_drag(acceleration, t, x, v, dt, args):
        ...     drag = dt * (args.damping / args.mass)[:, None]
        ...     v = (v + dt * acceleration(t, x, v, args) + drag * v) / (1 + drag)
        ...     return x + dt * v, v
        >>> check_stepper(implicit_drag, expected_order=1, quick=True).verdict
        'right'
    """

    mass: Any
    stiffness: Any
    rest_length: Any
    free: Any
    gravity: Any
    damping: Any
    drive: Any
    frequency: Any


# Of the fields of `CheckArgs`.
_SHAPES = ((NODES,), (NODES - 1,), (NODES - 1,), (NODES,), (DIM,), (NODES,), (DIM,), ())


def acceleration(t: Any, x: Any, v: Any, args: CheckArgs) -> Any:
    """The rope's acceleration and the drive's; like `x` and `v` ``(nodes, dim)``."""
    drive = args.drive * jnp.cos(args.frequency * t)
    return rope.acceleration(t, x.T, v.T, _as_rope(args)).T + args.free[:, None] * drive


def rates(y: np.ndarray, args: CheckArgs) -> np.ndarray:
    """The right-hand side without the drive, in NumPy, of many states ``(..., 2, nodes, dim)``."""
    x, v = y[..., 0, :, :], y[..., 1, :, :]
    return np.stack([v, _undriven(x, v, args)], axis=-3)


def _undriven(x: np.ndarray, v: np.ndarray, args: CheckArgs) -> np.ndarray:
    """The rope's acceleration alone, in NumPy; like `x` and `v` ``(..., nodes, dim)``."""
    d = x[..., 1:, :] - x[..., :-1, :]
    # A spring of length zero pulls nowhere, as in `ropeode.problems.rope`.
    length = np.sqrt(np.sum(d * d, axis=-1) + np.finfo(np.float64).tiny)
    pull = (args.stiffness * (1.0 - args.rest_length / length))[..., None] * d
    force = args.mass[:, None] * args.gravity - args.damping[:, None] * v
    force[..., :-1, :] += pull
    force[..., 1:, :] -= pull
    return (args.free / args.mass)[:, None] * force


def _acceleration_in_numpy(t: Any, x: Any, v: Any, args: CheckArgs) -> Any:
    """As `acceleration`, for steps in Python; inside a loop of JAX's own it is traced."""
    if is_traced((t, x, v, args)):
        return acceleration(t, x, v, args)
    x, v, *numbers = map(np.asarray, (x, v, *args))
    args = CheckArgs(*numbers)
    return _undriven(x, v, args) + args.free[:, None] * (args.drive * np.cos(args.frequency * t))


# A call of what JAX compiles takes twice as long, and compiles it for each number of nodes.
acceleration.in_numpy = _acceleration_in_numpy  # type: ignore[attr-defined]


def linear_damping(args: CheckArgs) -> LinearDamping:
    """The damping force ``-damping v`` as an acceleration; none at pinned nodes."""
    rate, coefficient = rope.linear_damping(_as_rope(args))
    return LinearDamping(rate[:, None], coefficient[:, None])


def energy(t: Any, y: Any, args: CheckArgs) -> Any:
    """The rope's energy; constant along solutions without damping and drive."""
    return rope.energy(t, jnp.swapaxes(y, 1, 2), _as_rope(args))


def _as_rope(args: CheckArgs) -> RopeArgs:
    return RopeArgs(
        args.mass,
        args.stiffness,
        args.rest_length,
        args.free,
        args.gravity[:, None],
        args.damping,
    )


# What a check rope has unless something else is said.
_USUAL = CheckArgs(1.0, 4.0, 1.0, 1.0, gravity=0.0, damping=0.0, drive=0.0, frequency=0.0)


def check_rope(
    name: str, x0: Any, ts: ArrayLike, *, v0: Any = 0.0, pinned: Sequence[int] = (0,), **args: Any
) -> Problem:
    """A rope of the family.

    Arguments:
        name: for reports.
        x0: initial positions, ``(NODES, DIM)``.
        ts: sample times.
        v0: initial velocities, broadcast to the shape of `x0`; those of pinned nodes are ignored.
        pinned: indices of the nodes that do not move.
        args: fields of `CheckArgs` that are not the usual ones; a single number applies to all
            nodes or springs.
    """
    free = np.ones(NODES)
    free[list(pinned)] = 0.0
    given = _USUAL._replace(free=free, **args)
    numbers = CheckArgs(*(_filled(*each) for each in zip(given, _SHAPES, strict=True)))
    y0 = np.stack([_filled(x0, (NODES, DIM)), _filled(v0, (NODES, DIM)) * free[:, None]])
    return _family().changed(y0=y0, ts=np.asarray(ts, dtype=np.float64), args=numbers, name=name)


def _filled(value: Any, shape: tuple[int, ...]) -> np.ndarray:
    return np.array(np.broadcast_to(np.asarray(value, dtype=np.float64), shape))


@functools.cache
def _family() -> Problem:
    """A member of the family; the functions are tried on it once."""
    return Problem.second_order(
        acceleration,
        _row((1.0, 0.0, 0.0)),
        np.zeros((NODES, DIM)),
        np.arange(2.0),
        CheckArgs(*map(np.ones, _SHAPES)),
        damping=linear_damping,
        energy=energy,
        name="check rope",
    )


def _row(step: Sequence[float]) -> np.ndarray:
    """Nodes in a straight row from the origin, ``(NODES, DIM)``."""
    return np.outer(np.arange(float(NODES)), step)


# A crooked rope whose springs are neither at rest nor equally stretched, and its velocities.
CROOKED = np.array(
    [[0.1, 0.2, 0.0], [0.9, -0.1, 0.3], [1.7, 0.5, 0.1], [2.4, 0.2, -0.6], [3.1, -0.4, -0.2]]
)
MOVING = np.array(
    [[0.3, -0.5, 0.2], [0.0, 0.0, 0.0], [-0.4, 0.3, 0.6], [0.2, 0.8, -0.3], [-0.6, 0.1, 0.5]]
)
_UNEQUAL: dict[str, Any] = {
    "mass": (1.3, 0.8, 0.6, 1.7, 0.9),
    "stiffness": (3.0, 5.5, 4.2, 2.6),
    "rest_length": (0.75, 0.85, 0.6, 1.15),
    "pinned": (1,),
    "gravity": (0.3, -0.8, 0.2),
    "v0": MOVING,
}
_DAMPED: dict[str, Any] = {"damping": (0.2, 0.1, 0.4, 0.3, 0.25)}
_DRIVE = (0.9, 0.7, -1.1)


@functools.cache
def convergence_problems() -> dict[str, Problem]:
    """The problems on which orders are observed, by name; each exposes other mistakes."""
    ropes = (
        # As in the classroom: all parameters 1, a straight rope released at rest.
        check_rope(
            "textbook", _row((1.0, 0.0, 0.0)), (0.0, 0.7, 1.4, 2.1), gravity=(0.0, -1.0, 0.0)
        ),
        # Equal masses that are not 1, damping, rest lengths below 1; at rest.
        check_rope(
            "damped",
            _row((0.55, 0.15, -0.1)),
            (0.0, 0.6, 1.2, 1.8),
            mass=0.7,
            stiffness=3.2,
            rest_length=0.6,
            gravity=(0.2, -0.9, 0.1),
            damping=0.35,
        ),
        # All parameters different, moving at the start, in three dimensions, a pin inside.
        check_rope("unequal", CROOKED, (0.0, 0.5, 1.0, 1.5), **_UNEQUAL, **_DAMPED),
        # A force that depends on time, which does not start at 0.
        check_rope(
            "driven", CROOKED, (0.4, 0.9, 1.4, 1.9), **_UNEQUAL, drive=_DRIVE, frequency=3.1
        ),
        # The same with damping, and frames that one step size does not divide.
        check_rope(
            "uneven",
            CROOKED,
            (-0.3, 0.4, 0.65, 1.3),
            **_UNEQUAL,
            **_DAMPED,
            drive=_DRIVE,
            frequency=2.3,
        ),
        # Without pins and gravity.
        check_rope(
            "free",
            CROOKED,
            (0.0, 0.6, 1.2, 1.8),
            **{
                **_UNEQUAL,
                "v0": np.add(MOVING, (0.1, 0.05, -0.2)),
                "pinned": (),
                "gravity": (0.0, 0.0, 0.0),
            },
        ),
    )
    return {problem.name: problem for problem in ropes}


@functools.cache
def generic() -> Problem:
    """All parameters different, with damping but no drive: for checks of a few steps."""
    return convergence_problems()["unequal"]


@functools.cache
def undamped() -> Problem:
    """The same rope without damping."""
    return generic().changed(
        args=generic().args._replace(damping=np.zeros(NODES)), name="unequal, undamped"
    )


@functools.cache
def swing() -> Problem:
    """A hanging rope, displaced sideways, without damping, over a long time."""
    still = hanging()
    aside = np.zeros((2, NODES, DIM))
    aside[0, 1:, 0], aside[0, 1:, 2] = (0.1, 0.25, 0.4, 0.5), (0.05, 0.1, 0.1, -0.1)
    return still.changed(y0=still.y0 + aside, ts=0.5 * np.arange(401.0), name="swing")


@functools.cache
def hanging() -> Problem:
    """A rope that hangs at rest from its first node, without damping."""
    return hanging_rope(
        mass=np.array([1.0, 1.3, 0.7, 0.9, 1.1]),
        stiffness=np.array([9.0, 8.0, 7.5, 9.5]),
        rest_length=np.array([0.8, 0.7, 0.9, 0.75]),
        gravity=0.9,
    )


def hanging_rope(
    mass: np.ndarray, stiffness: np.ndarray, rest_length: np.ndarray, gravity: float
) -> Problem:
    """A rope that hangs at rest from its first node, without damping.

    Each spring is extended by the weight below it divided by its stiffness.

    Arguments:
        mass: of each node.
        stiffness: of each spring.
        rest_length: of each spring.
        gravity: its magnitude; it points down the second axis.
    """
    weight = gravity * np.cumsum(mass[::-1])[::-1]
    x0 = np.zeros((NODES, DIM))
    x0[1:, 1] = -np.cumsum(rest_length + weight[1:] / stiffness)
    return check_rope(
        "hanging",
        x0,
        (0.0, 1.0),
        mass=mass,
        stiffness=stiffness,
        rest_length=rest_length,
        gravity=(0.0, -gravity, 0.0),
    )


def held(problem: Problem, *nodes: int) -> Problem:
    """The same rope, pinned at these nodes and at no others."""
    free = np.ones(NODES)
    free[list(nodes)] = 0.0
    y0 = problem.y0 * np.stack([np.ones(NODES), free])[:, :, None]
    return problem.changed(y0=y0, args=problem.args._replace(free=free))


def renumbered(problem: Problem) -> Problem:
    """The same rope with its nodes numbered from the other end."""
    args = problem.args
    names = ("mass", "stiffness", "rest_length", "free", "damping")
    turned = {name: getattr(args, name)[::-1].copy() for name in names}
    return problem.changed(y0=problem.y0[:, ::-1].copy(), args=args._replace(**turned))


# The ratio of two units of length: near 1, and without a pattern in its binary digits.
UNITS = 1.1883951057781212


def in_other_units(problem: Problem, units: float = UNITS) -> Problem:
    """A check rope with its lengths in another unit; its states are `units` times as large.

    In exact arithmetic a stepper computes the same motion. In floating point, with the default,
    every rounding differs, so the difference between two runs shows the size of their round-off.

    Arguments:
        problem: of the family.
        units: how many of the new units make an old one.
    """
    return Units(length=units).of(problem)


class Units(NamedTuple):
    """Units of length, mass and time.

    Fields:
        length: how many of these make one of the old.
        mass, time: likewise.
    """

    length: float = 1.0
    mass: float = 1.0
    time: float = 1.0

    @property
    def state(self) -> np.ndarray:
        """What states are multiplied by, ``(2, 1, 1)``."""
        return np.array([self.length, self.length / self.time])[:, None, None]

    def of(self, problem: Problem) -> Problem:
        """A check rope, measured in these."""
        length, mass, time = self
        sizes = CheckArgs(
            mass=mass,
            stiffness=mass / time**2,
            rest_length=length,
            free=1.0,
            gravity=length / time**2,
            damping=mass / time,
            drive=length / time**2,
            frequency=1.0 / time,
        )
        args = CheckArgs(*(own * size for own, size in zip(problem.args, sizes, strict=True)))
        return problem.changed(y0=problem.y0 * self.state, ts=problem.ts * time, args=args)
