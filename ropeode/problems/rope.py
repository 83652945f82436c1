"""The mass-spring rope of the computer-graphics assignment, as an initial value problem."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from pydantic import BeforeValidator, ValidationInfo, field_validator, model_validator

from ropeode.problems.problem import LinearDamping, Problem
from ropeode.validation import (
    Input,
    check_whole,
    fault_of,
    field,
    finite_number,
    finite_numbers,
    plain,
    whole_number,
)


def _one_or_many(value: Any) -> float | tuple[float, ...]:
    value = plain(value)
    return finite_numbers(value) if isinstance(value, (list, tuple)) else finite_number(value)


def _velocity(value: Any) -> Any:
    value = plain(value)
    if value and isinstance(value, (list, tuple)) and isinstance(plain(value[0]), (list, tuple)):
        return tuple(finite_numbers(row) for row in value)
    return finite_numbers(value)


def _whole_numbers(value: Any) -> tuple[int, ...]:
    value = plain(value)
    if not isinstance(value, (list, tuple)):
        raise ValueError(f"{value!r} is not a list of whole numbers")
    return tuple(whole_number(entry, at_least=0) for entry in value)


Numbers = Annotated[tuple[float, ...], BeforeValidator(finite_numbers)]
OneOrMany = Annotated[float | tuple[float, ...], BeforeValidator(_one_or_many)]


class Rope(Input):
    """A chain of point masses joined by springs, some of them pinned.

    Nodes stand equally spaced from `start` to `end` (a single node at `start`); each spring
    between neighbours is at rest initially. The time unit is one frame.

    Arguments:
        start: position of the first node, 2 or 3 coordinates.
        end: position of the last node.
        num_nodes: number of nodes.
        node_mass: mass of every node, or one for each.
        stiffness: force per length of every spring, or one for each.
        pinned: indices of the nodes that do not move.
        gravity: acceleration, as many components as `start`; a 3-D rope that is given none
            has (0, -1, 0).
        damping: coefficient of the force ``-damping * v``, one or one for each node.
        initial_velocity: one velocity for all the nodes that are free, or one for each.

    Raises:
        InputError: one line for each argument that cannot be used.
    """

    start: Numbers = field((0.0, 200.0), allowed="2 or 3 finite coordinates", example="[0, 200]")
    end: Numbers = field(
        (-400.0, 200.0),
        allowed="as many finite coordinates as start, and another point than start",
        example="[-400, 200]",
    )
    num_nodes: int = field(16, allowed="a whole number >= 1", example="16")
    node_mass: OneOrMany = field(
        1.0, allowed="finite numbers > 0, one for all nodes or one for each", example="1.0"
    )
    stiffness: OneOrMany = field(
        100.0, allowed="finite numbers > 0, one for all springs or one for each", example="100.0"
    )
    pinned: Annotated[tuple[int, ...], BeforeValidator(_whole_numbers)] = field(
        (0,), allowed="different node indices from 0 to num_nodes - 1", example="[0]"
    )
    gravity: Numbers = field(
        (0.0, -1.0), allowed="as many finite components as start", example="[0, -1]"
    )
    damping: OneOrMany = field(
        0.01, allowed="finite numbers >= 0, one for all nodes or one for each", example="0.01"
    )
    initial_velocity: Annotated[
        tuple[float, ...] | tuple[tuple[float, ...], ...], BeforeValidator(_velocity)
    ] = field(
        (),
        allowed="a finite velocity for all free nodes, or one for each node (zero where pinned)",
        example="[0, 0]",
    )

    @model_validator(mode="before")
    @classmethod
    def _defaults_follow_the_dimension(cls, given: Any) -> Any:
        start = given.get("start", cls.model_fields["start"].default)
        dim = len(start) if hasattr(start, "__len__") else 2
        if dim == 3:
            given = {"gravity": (0.0, -1.0, 0.0), **given}
        if dim in (2, 3):
            given = {"initial_velocity": (0.0,) * dim, **given}
        return given

    @field_validator("num_nodes", mode="before")
    @classmethod
    def _whole(cls, value: Any) -> int:
        return whole_number(value, at_least=1)

    @field_validator("start")
    @classmethod
    def _two_or_three(cls, start: tuple[float, ...]) -> tuple[float, ...]:
        if len(start) not in (2, 3):
            raise ValueError(f"these are {len(start)}")
        return start

    @field_validator("end", "gravity")
    @classmethod
    def _same_dimension(cls, value: tuple[float, ...], info: ValidationInfo) -> tuple[float, ...]:
        if "start" in info.data and len(value) != len(info.data["start"]):
            raise ValueError(f"start has {len(info.data['start'])}, these are {len(value)}")
        return value

    @field_validator("num_nodes")
    @classmethod
    def _has_a_length(cls, num_nodes: int, info: ValidationInfo) -> int:
        end = info.data.get("end")
        if num_nodes > 1 and end is not None and end == info.data.get("start"):
            raise fault_of("end", end, "springs of length zero would have no direction")
        return num_nodes

    @field_validator("node_mass", "stiffness")
    @classmethod
    def _above_zero(cls, value: Any, info: ValidationInfo) -> Any:
        if np.any(np.asarray(value) <= 0):
            raise ValueError(f"{np.min(value)} is not above zero")
        return value

    @field_validator("damping")
    @classmethod
    def _not_below_zero(cls, value: Any) -> Any:
        if np.any(np.asarray(value) < 0):
            raise ValueError(f"{np.min(value)} is below zero")
        return value

    @field_validator("node_mass", "stiffness", "damping")
    @classmethod
    def _one_for_each(cls, value: Any, info: ValidationInfo) -> Any:
        if "num_nodes" not in info.data or isinstance(value, float):
            return value
        needed = info.data["num_nodes"] - (info.field_name == "stiffness")
        if len(value) != needed:
            raise ValueError(f"{needed} needed, {len(value)} given")
        return value

    @field_validator("pinned")
    @classmethod
    def _different_nodes(cls, pinned: tuple[int, ...], info: ValidationInfo) -> tuple[int, ...]:
        last = info.data.get("num_nodes", np.inf) - 1
        for node in pinned:
            if node > last:
                raise ValueError(f"there is no node {node}, the last one is {last}")
        if len(set(pinned)) != len(pinned):
            raise ValueError("one is repeated")
        return tuple(sorted(pinned))

    @field_validator("initial_velocity")
    @classmethod
    def _fits_the_nodes(cls, velocity: Any, info: ValidationInfo) -> Any:
        if not {"start", "num_nodes", "pinned"} <= info.data.keys():
            return velocity
        dim, num_nodes = len(info.data["start"]), info.data["num_nodes"]
        if np.shape(velocity) == (dim,):
            return velocity
        if any(len(row) != dim for row in velocity if isinstance(row, tuple)) or np.shape(
            velocity
        ) != (num_nodes, dim):
            raise ValueError(f"{dim} components, or {num_nodes} times {dim}, needed")
        for node in info.data["pinned"]:
            if any(velocity[node]):
                raise ValueError(f"node {node} is pinned but has velocity {velocity[node]}")
        return velocity

    def problem(self, frames: int = 20) -> Problem:
        """The rope as a `Problem`, sampled at times 0, 1, ..., `frames`.

        Raises:
            InputError: `frames` is not a whole number >= 1.
        """
        frames = check_whole("frames", frames, at_least=1, example="20")
        dim = len(self.start)
        fractions = np.linspace(0.0, 1.0, self.num_nodes)
        start, end = np.asarray(self.start)[:, None], np.asarray(self.end)[:, None]
        x0 = start + (end - start) * fractions
        free = np.ones(self.num_nodes)
        free[list(self.pinned)] = 0.0
        velocity = np.asarray(self.initial_velocity)
        v0 = np.broadcast_to(velocity[:, None] if velocity.ndim == 1 else velocity.T, x0.shape)
        args = RopeArgs(
            mass=np.broadcast_to(self.node_mass, (self.num_nodes,)),
            stiffness=np.broadcast_to(self.stiffness, (self.num_nodes - 1,)),
            rest_length=np.sqrt(np.sum(np.diff(x0) ** 2, axis=0)),
            free=free,
            gravity=np.asarray(self.gravity).reshape(dim, 1),
            damping=np.broadcast_to(self.damping, (self.num_nodes,)),
        )
        return Problem.second_order(
            acceleration,
            x0,
            v0 * free,
            np.arange(frames + 1.0),
            args,
            damping=linear_damping,
            node_axis=1,
            name="rope",
            energy=energy,
            parameters={"kind": "rope", "frames": frames, **self.model_dump(mode="json")},
        )


class RopeArgs(NamedTuple):
    """The numbers in the rope's equations; nodes and springs run along the last axis."""

    mass: Any
    stiffness: Any
    rest_length: Any
    free: Any
    gravity: Any
    damping: Any


def acceleration(t: Any, x: Any, v: Any, args: RopeArgs) -> Any:
    """``M a = spring forces - damping v + M gravity``; zero at pinned nodes.

    Arguments:
        t: time; the rope does not depend on it.
        x: positions, ``(dim, nodes)``. This layout keeps the long axis last, which is what
            vectorised code wants.
        v: velocities, ``(dim, nodes)``.
        args: the rope's numbers.
    """
    del t
    pull = _tension_per_length(x, args)[1] * (x[:, 1:] - x[:, :-1])
    # Padded once at both ends: XLA would compute `pull` again for a second padded copy of it.
    pull = jnp.pad(pull, ((0, 0), (1, 1)))
    force = pull[:, 1:] - pull[:, :-1]
    return ((force - args.damping * v) / args.mass + args.gravity) * args.free


def _tension_per_length(x: Any, args: RopeArgs) -> tuple[Any, Any]:
    """The length of each spring, and its tension over its length.

    A spring pulls node a towards node b with ``k (|b - a| - l) (b - a)/|b - a|``. At length
    zero that has no direction, and the force is defined to be zero; the length is taken as
    infinite there until it has been divided by, which keeps the derivatives finite as well.
    """
    # Not `jnp.sum`: XLA stores what it sums over a leading axis, and reads it back.
    squared = sum(component**2 for component in x[:, 1:] - x[:, :-1])
    length = jnp.sqrt(jnp.where(squared > 0, squared, jnp.inf))
    inverse = 1.0 / length
    # Looking at `inverse` here, and not at `squared`, saves XLA from computing that again.
    factor = jnp.where(inverse > 0, args.stiffness * (1.0 - args.rest_length * inverse), 0.0)
    return jnp.where(squared > 0, length, 0.0), factor


def linear_damping(args: RopeArgs) -> LinearDamping:
    """The damping force ``-damping v`` as an acceleration; none at pinned nodes."""
    return LinearDamping(args.damping / args.mass * args.free, args.damping * args.free)


def energy(t: Any, y: Any, args: RopeArgs) -> Any:
    """Kinetic energy, spring energy and potential energy in gravity's field.

    Constant along solutions where the damping is zero. Gravity pulls on pinned nodes too,
    but these do not move, so that their share is constant.

    Arguments:
        t: time; not used.
        y: state, ``(2, dim, nodes)``.
        args: the rope's numbers.
    """
    del t
    x, v = y
    length, _ = _tension_per_length(x, args)
    kinetic = 0.5 * jnp.sum(args.mass * jnp.sum(v * v, axis=0))
    springs = 0.5 * jnp.sum(args.stiffness * (length - args.rest_length) ** 2)
    return kinetic + springs - jnp.sum(args.mass * args.gravity * x)
