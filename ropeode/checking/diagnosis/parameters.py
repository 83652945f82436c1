"""The parameters of a rope that a wrong stepper may have changed."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from ropeode.problems import Problem

# Their names in `args`, and the initial velocity.
PARAMETERS = ("gravity", "damping", "stiffness", "mass", "rest_length", "velocity")


class Units(NamedTuple):
    """What a change of 1 means, chosen so that all changes are of similar size.

    Stiffness and rest length change by factors, ``1 + change``, and the mass by
    ``1/(1 + change)``, in which the acceleration is linear.

    Fields:
        gravity: an acceleration.
        damping: coefficients, of the shape of `args.damping`: those of the problem, or the same
            for all nodes if it has none.
        velocity: initial velocities, ``(dim, *x0.shape)``. The first are those of the problem;
            if it starts at rest, each moves all nodes along one axis.
        scale: of positions, for tolerances.
    """

    gravity: np.ndarray
    damping: np.ndarray
    velocity: np.ndarray
    scale: np.ndarray


def dimension(problem: Problem) -> int:
    """How many coordinates a node has."""
    return int(np.size(problem.args.gravity))


def places(dim: int) -> dict[str, slice]:
    """Where the change of each parameter stands in the vector of all changes."""
    return {
        "gravity": slice(0, dim),
        "damping": slice(dim, dim + 1),
        "stiffness": slice(dim + 1, dim + 2),
        "mass": slice(dim + 2, dim + 3),
        "rest_length": slice(dim + 3, dim + 4),
        "velocity": slice(dim + 4, 2 * dim + 4),
    }


def units(problem: Problem) -> Units:
    """The units of a problem's changes."""
    args, dim = problem.args, dimension(problem)
    span = float(problem.ts[-1] - problem.ts[0])
    length = float(np.mean(args.rest_length)) or problem.scale
    gravity = float(np.linalg.norm(args.gravity)) or length / span**2
    rate = float(np.mean(args.mass)) / span
    damping = np.asarray(args.damping, dtype=np.float64)
    mean = float(np.mean(np.abs(damping)))
    damping = damping * max(rate / mean, 1.0) if mean else np.full(damping.shape, rate)
    velocity = np.zeros((dim, *problem.y0[1].shape))
    if np.any(problem.y0[1]):
        velocity[0] = problem.y0[1]
    else:
        assert problem.mechanics is not None
        nodes_last = np.moveaxis(velocity, 1 + problem.mechanics.node_axis, -1)
        for axis in range(dim):
            nodes_last[axis, axis] = args.free * length / span
    return Units(np.asarray(gravity), damping, velocity, np.asarray(problem.scale))


def can_change(problem: Problem, name: str) -> np.ndarray:
    """Which entries of the vector of all changes belong to a parameter, as truth values."""
    dim = dimension(problem)
    mask = np.zeros(2 * dim + 4, dtype=bool)
    place = places(dim)[name]
    mask[place] = True
    if name == "velocity":
        mask[place] = np.any(units(problem).velocity.reshape(dim, -1), axis=1)
    return mask


def changed(y0: Any, args: Any, units: Units, changes: Any) -> tuple[Any, Any]:
    """Initial state and arguments with changed parameters; in JAX."""
    dim = units.velocity.shape[0]
    part = {name: changes[place] for name, place in places(dim).items()}
    velocity = y0[1] + jnp.tensordot(part["velocity"], units.velocity, 1)
    gravity = args.gravity + (units.gravity * part["gravity"]).reshape(args.gravity.shape)
    return jnp.stack([y0[0], velocity]), args._replace(
        gravity=gravity,
        damping=args.damping + units.damping * part["damping"],
        stiffness=args.stiffness * (1.0 + part["stiffness"]),
        mass=args.mass / (1.0 + part["mass"]),
        rest_length=args.rest_length * (1.0 + part["rest_length"]),
    )
