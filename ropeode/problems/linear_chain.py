"""A chain of equal masses between two walls."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Annotated, Any

import jax.numpy as jnp
import numpy as np
from pydantic import ValidationInfo, field_validator

from ropeode.problems import oscillator
from ropeode.problems.oscillator import OscillatorArgs
from ropeode.problems.parameters import library_problem
from ropeode.problems.picture import Picture
from ropeode.problems.problem import Problem
from ropeode.validation import FiniteTuple, NonNegative, Positive, WholePositive

Numbers = Annotated[FiniteTuple, "finite numbers, at most num_masses of them"]


def _filled(values: tuple[float, ...], info: ValidationInfo) -> tuple[float, ...]:
    """Zeros in place of the numbers that are missing."""
    missing = info.data.get("num_masses", len(values)) - len(values)
    if missing < 0:
        raise ValueError(f"{len(values)} given for {info.data['num_masses']} masses")
    return values + (0.0,) * missing


def _between_walls(times: np.ndarray, states: np.ndarray, args: OscillatorArgs) -> np.ndarray:
    """Displacements over the places of the masses in the row, with the two walls."""
    del times, args
    displacements = np.pad(states[:, 0], [(0, 0), (1, 1)])
    places = np.broadcast_to(np.arange(displacements.shape[1]), displacements.shape)
    return np.stack([places, displacements], axis=2)


@library_problem(
    Picture("rope", _between_walls, ("mass", "displacement"), fixed=(0, -1), chained=True),
    filled=field_validator("displacement", "velocity")(_filled),
)
def linear_chain(
    frames: WholePositive = 20,
    num_masses: WholePositive = 8,
    mass: Positive = 1.0,
    stiffness: Positive = 1.0,
    damping: NonNegative = 0.0,
    displacement: Numbers = (1.0,),
    velocity: Numbers = (),
) -> Problem:
    """Equal masses in a row between two walls, with equal springs between neighbours.

    ``mass x_j'' = stiffness (x_(j-1) - 2 x_j + x_(j+1)) - damping x_j'`` for the displacements
    from rest, of shape (num_masses,). The time unit is one frame.

    Arguments:
        frames: the problem is sampled at times 0, 1, ..., `frames`.
        num_masses: number of masses; there is one spring more.
        mass: of each.
        stiffness: force per length of each spring.
        damping: force per velocity on each mass.
        displacement: initial displacements of the first masses, in the unit of length;
            missing ones are zero.
        velocity: initial velocities likewise, in lengths per frame.

    Raises:
        InputError: one line for each argument that cannot be used.

    Source: LeVeque, Finite Difference Methods for Ordinary and Partial Differential
    Equations, section 2.10, equations (2.23) and (2.24): the modes and their frequencies.
    """
    args = OscillatorArgs(mass, stiffness, damping)
    return Problem.second_order(
        acceleration,
        displacement,
        velocity,
        np.arange(frames + 1.0),
        args,
        damping=oscillator.linear_damping,
        name="linear chain",
        energy=energy,
        exact=functools.partial(_exact, args, displacement, velocity),
    )


def acceleration(t: Any, x: Any, v: Any, args: OscillatorArgs) -> Any:
    """The forces of springs and dampers over the mass; `t` is not used."""
    del t
    pull = args.stiffness * _stretches(x)
    return (pull[1:] - pull[:-1] - args.damping * v) / args.mass


def _stretches(x: Any) -> Any:
    """How much longer each spring is than at rest; the walls do not move."""
    return jnp.diff(jnp.pad(x, 1))


def energy(t: Any, y: Any, args: OscillatorArgs) -> Any:
    """Kinetic energy and the springs'; constant without damping. `t` is not used."""
    del t
    x, v = y
    return 0.5 * (args.mass * jnp.sum(v * v) + args.stiffness * jnp.sum(_stretches(x) ** 2))


def solution(
    t: Any, mass: Any, stiffness: Any, damping: Any, x0: Any, v0: Any
) -> tuple[np.ndarray, np.ndarray]:
    """Displacements and velocities at times since the start, ``(times, masses)``.

    In extended precision. The modes do not act on each other: each is a damped oscillator.

    Arguments:
        t: times, ``(times,)``.
        mass: as for `linear_chain`, like all that follow.
        stiffness: greater than zero.
        damping: not below zero.
        x0: initial displacements, ``(masses,)``.
        v0: initial velocities, ``(masses,)``.
    """
    x0, v0 = np.asarray(x0, dtype=np.longdouble), np.asarray(v0, dtype=np.longdouble)
    node = np.arange(1, len(x0) + 1)
    half_turns = len(x0) + 1
    # Mode j at mass k is sin(j k pi/(n+1)); whole turns are taken off before rounding can.
    modes = _sine(np.outer(node, node) % (2 * half_turns), half_turns)
    modes *= np.sqrt(2 / np.longdouble(half_turns))
    mode_stiffness = 4 * np.longdouble(stiffness) * _sine(node, 2 * half_turns) ** 2
    x, v = oscillator.solution(
        np.asarray(t)[:, None], mass, mode_stiffness, damping, modes @ x0, modes @ v0
    )
    return x @ modes, v @ modes


def _sine(numerator: np.ndarray, denominator: int) -> np.ndarray:
    """``sin(pi numerator/denominator)``."""
    pi = 4 * np.arctan(np.longdouble(1))
    return np.sin(pi * numerator / denominator)


def _exact(
    args: OscillatorArgs, x0: Sequence[float], v0: Sequence[float], ts: np.ndarray
) -> np.ndarray:
    return np.stack(solution(ts, *args, x0, v0), axis=1).astype(np.float64)
