"""What ropes share: nodes in a straight row, masses, pins, gravity, damping."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from pydantic import BeforeValidator, ValidationInfo, field_validator, model_validator

from ropeode.problems.problem import Problem
from ropeode.validation import (
    Input,
    check_memory,
    check_whole,
    fault_of,
    field,
    finite_number,
    finite_numbers,
    plain,
    require_all_digits,
    whole_number,
)

if TYPE_CHECKING:
    from ropeode.problems.ensemble import Ensemble


def _one_or_many(value: Any) -> float | tuple[float, ...]:
    require_all_digits(value)
    value = plain(value)
    return finite_numbers(value) if isinstance(value, (list, tuple)) else finite_number(value)


def _velocity(value: Any) -> Any:
    require_all_digits(value)
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
Indices = Annotated[tuple[int, ...], BeforeValidator(_whole_numbers)]
Velocity = Annotated[tuple[float, ...] | tuple[tuple[float, ...], ...], BeforeValidator(_velocity)]

# The fields that ropes share. A rope lists them itself, in the order of its own arguments.
START = field((0.0, 200.0), allowed="2 or 3 finite coordinates", example="[0, 200]")
END = field(
    (-400.0, 200.0),
    allowed="as many finite coordinates as start, and another point than start",
    example="[-400, 200]",
)
NUM_NODES = field(16, allowed="a whole number >= 1", example="16")
NODE_MASS = field(
    1.0, allowed="finite numbers > 0, one for all nodes or one for each", example="1.0"
)
PINNED = field((0,), allowed="different node indices from 0 to num_nodes - 1", example="[0]")
GRAVITY = field((0.0, -1.0), allowed="as many finite components as start", example="[0, -1]")
DAMPING = field(
    0.01, allowed="finite numbers >= 0, one for all nodes or one for each", example="0.01"
)
INITIAL_VELOCITY = field(
    (),
    allowed="a finite velocity for all free nodes, or one for each node (zero where pinned)",
    example="[0, 0]",
)


class RopeInput(Input):
    """The checks that ropes share; a subclass lists the fields, and may add some.

    Raises:
        InputError: one line for each argument that cannot be used.
    """

    # In the library.
    kind: ClassVar[str]

    if TYPE_CHECKING:
        start: Numbers
        end: Numbers
        num_nodes: int
        node_mass: OneOrMany
        pinned: Indices
        gravity: Numbers
        damping: OneOrMany
        initial_velocity: Velocity

    @model_validator(mode="before")
    @classmethod
    def _defaults_follow_the_dimension(cls, values: Any) -> Any:
        start = values.get("start", cls.model_fields["start"].default)
        dim = len(start) if hasattr(start, "__len__") else 2
        if dim == 3:
            values = {"gravity": (0.0, -1.0, 0.0), **values}
        if dim in (2, 3):
            values = {"initial_velocity": (0.0,) * dim, **values}
        return values

    @field_validator("num_nodes", mode="before", check_fields=False)
    @classmethod
    def _whole(cls, value: Any) -> int:
        return whole_number(value, at_least=1)

    @field_validator("start", check_fields=False)
    @classmethod
    def _two_or_three(cls, start: tuple[float, ...]) -> tuple[float, ...]:
        if len(start) not in (2, 3):
            raise ValueError(f"these are {len(start)}")
        return start

    @field_validator("end", "gravity", check_fields=False)
    @classmethod
    def _same_dimension(cls, value: tuple[float, ...], info: ValidationInfo) -> tuple[float, ...]:
        if "start" in info.data and len(value) != len(info.data["start"]):
            raise ValueError(f"start has {len(info.data['start'])}, these are {len(value)}")
        return value

    @field_validator("num_nodes", check_fields=False)
    @classmethod
    def _has_a_length(cls, num_nodes: int, info: ValidationInfo) -> int:
        end = info.data.get("end")
        if num_nodes > 1 and end is not None and end == info.data.get("start"):
            raise fault_of("end", end, "what joins neighbours would have no direction")
        return num_nodes

    @field_validator("node_mass", "stiffness", check_fields=False)
    @classmethod
    def _above_zero(cls, value: Any) -> Any:
        if np.any(np.asarray(value) <= 0):
            raise ValueError(f"{np.min(value)} is not above zero")
        return value

    @field_validator("damping", check_fields=False)
    @classmethod
    def _not_below_zero(cls, value: Any) -> Any:
        if np.any(np.asarray(value) < 0):
            raise ValueError(f"{np.min(value)} is below zero")
        return value

    @field_validator("node_mass", "stiffness", "damping", check_fields=False)
    @classmethod
    def _one_for_each(cls, value: Any, info: ValidationInfo) -> Any:
        if "num_nodes" not in info.data or isinstance(value, float):
            return value
        needed = info.data["num_nodes"] - (info.field_name == "stiffness")
        if len(value) != needed:
            raise ValueError(f"{needed} needed, {len(value)} given")
        return value

    @field_validator("pinned", check_fields=False)
    @classmethod
    def _different_nodes(cls, pinned: tuple[int, ...], info: ValidationInfo) -> tuple[int, ...]:
        last = info.data.get("num_nodes", np.inf) - 1
        for node in pinned:
            if node > last:
                raise ValueError(f"there is no node {node}, the last one is {last}")
        if len(set(pinned)) != len(pinned):
            raise ValueError("one is repeated")
        return tuple(sorted(pinned))

    @field_validator("initial_velocity", check_fields=False)
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

    def ensemble(self, frames: int = 20, **arrays: Any) -> Ensemble:
        """Ropes like this one that differ in some of their numbers.

        Arguments:
            frames: as for `problem`.
            arrays: for `node_mass`, `stiffness`, `damping`, `gravity` or `initial_velocity`,
                the values of all ropes: what this rope takes, with one more axis in front,
                as in ``damping=np.linspace(0.0, 0.1, 1000)``.

        Raises:
            InputError: one line for each array that cannot be used.

        Examples:
            >>> from ropeode import Rope
            >>> ropes = Rope(num_nodes=4).ensemble(frames=3, damping=[0.0, 0.01, 0.1])
            >>> ropes[2]
            <Problem: rope, 4 nodes, damping 0.1, 3 frames>
        """
        # Not above: few ropes become an ensemble.
        from ropeode.problems.ensemble import rope_ensemble

        return rope_ensemble(self, frames, arrays)

    def problem(self, frames: int = 20) -> Problem:
        """The rope as a `Problem`, sampled at times 0, 1, ..., `frames`.

        Raises:
            InputError: `frames` is not a whole number >= 1.

        Examples:
            >>> from ropeode import Rope
            >>> problem = Rope(num_nodes=4).problem(frames=3)
            >>> problem.y0.shape, problem.ts
            ((2, 2, 4), array([0., 1., 2., 3.]))
        """
        frames = check_whole("frames", frames, at_least=1, example="20")
        check_memory(frames)
        x0, v0 = self.y0()
        return Problem.second_order(
            x0=x0,
            v0=v0,
            ts=np.arange(frames + 1.0),
            args=self.args(),
            node_axis=1,
            in_turn=True,
            name=self.kind.replace("-", " "),
            parameters={"kind": self.kind, "frames": frames, **self.model_dump(mode="json")},
            **self.functions(),
        )

    @classmethod
    def from_parameters(cls, /, frames: int = 20, **parameters: Any) -> Problem:
        """The problem of a rope, as the library has it.

        Arguments:
            frames: the problem is sampled at times 0, 1, ..., `frames`.
            parameters: those of the rope.

        Raises:
            InputError: one line for each argument that cannot be used.
        """
        return cls(**parameters).problem(frames)

    def functions(self) -> dict[str, Any]:
        """The functions that `Problem.second_order` takes."""
        raise NotImplementedError

    def y0(self) -> np.ndarray:
        """Initial positions and velocities, ``(2, dim, nodes)``; pinned nodes stand still."""
        start, end = np.asarray(self.start)[:, None], np.asarray(self.end)[:, None]
        x0 = start + (end - start) * np.linspace(0.0, 1.0, self.num_nodes)
        velocity = np.asarray(self.initial_velocity)
        v0 = np.broadcast_to(velocity[:, None] if velocity.ndim == 1 else velocity.T, x0.shape)
        return np.stack([x0, v0 * self.free()])

    def free(self) -> np.ndarray:
        """1 where a node is free and 0 where it is pinned, ``(nodes,)``."""
        free = np.ones(self.num_nodes)
        free[list(self.pinned)] = 0.0
        return free

    def lengths(self) -> np.ndarray:
        """The initial distances of neighbours, ``(nodes - 1,)``."""
        return np.sqrt(np.sum(np.diff(self.y0()[0]) ** 2, axis=0))

    def args(self) -> Any:
        """The numbers in the rope's equations; gravity is ``(dim, 1)``."""
        raise NotImplementedError

    def common_args(self) -> dict[str, np.ndarray]:
        """The numbers in the equations of every rope, by name."""
        return {
            "mass": np.broadcast_to(self.node_mass, (self.num_nodes,)),
            "rest_length": self.lengths(),
            "free": self.free(),
            "gravity": np.reshape(self.gravity, (-1, 1)),
            "damping": np.broadcast_to(self.damping, (self.num_nodes,)),
        }
