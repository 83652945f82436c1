"""The mass-spring rope of the computer-graphics assignment, as an initial value problem."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple, SupportsIndex

import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from ropeode.problems import rope_input
from ropeode.problems.links import LinearDamping, Links, along, impulses
from ropeode.problems.rope_input import Indices, Numbers, OneOrMany, RopeInput, Velocity
from ropeode.validation import field

# Of squares of lengths: they may be squared, and divided by.
_SMALLEST = 1e-150
# XLA makes one instruction of a division by a root where there is AVX-512. Elsewhere it computes
# such roots one at a time, and only roots of quotients several at once.
_DIVIDES_BY_ROOTS: bool = np._core._multiarray_umath.__cpu_features__["AVX512_SKX"]  # type: ignore


class Rope(RopeInput):
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
        gravity: acceleration, as many components as `start`; the default of a
            3-D rope is (0, -1, 0).
        damping: coefficient of the force ``-damping * v``, one or one for each node.
        initial_velocity: one velocity for all the nodes that are free, or one for each.

    Raises:
        InputError: one line for each argument that cannot be used.

    Examples:
        >>> from ropeode import Rope
        >>> Rope(num_nodes=4, damping=0.05).problem(frames=3)
        <Problem: rope, 4 nodes, damping 0.05, 3 frames>
    """

    kind = "rope"

    start: Numbers = rope_input.START
    end: Numbers = rope_input.END
    num_nodes: int = rope_input.NUM_NODES
    node_mass: OneOrMany = rope_input.NODE_MASS
    stiffness: OneOrMany = field(
        100.0, allowed="finite numbers > 0, one for all springs or one for each", example="100.0"
    )
    pinned: Indices = rope_input.PINNED
    gravity: Numbers = rope_input.GRAVITY
    damping: OneOrMany = rope_input.DAMPING
    initial_velocity: Velocity = rope_input.INITIAL_VELOCITY

    if TYPE_CHECKING:
        # Checked, and made tuples of.
        def __init__(
            self,
            start: ArrayLike = ...,
            end: ArrayLike = ...,
            num_nodes: SupportsIndex = ...,
            node_mass: ArrayLike = ...,
            stiffness: ArrayLike = ...,
            pinned: ArrayLike = ...,
            gravity: ArrayLike = ...,
            damping: ArrayLike = ...,
            initial_velocity: ArrayLike = ...,
        ) -> None: ...

    def functions(self) -> dict[str, Any]:
        """See `RopeInput`."""
        return {
            "acceleration": acceleration,
            "damping": linear_damping,
            "links": links,
            "neighbours": True,
            "energy": energy,
        }

    def args(self) -> RopeArgs:
        """See `RopeInput`."""
        stiffness = np.broadcast_to(self.stiffness, (self.num_nodes - 1,))
        return RopeArgs(stiffness=stiffness, **self.common_args())


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
            vectorised code wants. Ropes side by side are one array, as `Links` explains.
        v: velocities, ``(dim, nodes)``.
        args: the rope's numbers.
    """
    del t
    own = rigid_links(args)
    d, square = _springs(x, args)
    if _DIVIDES_BY_ROOTS:
        ratio = args.rest_length / jnp.sqrt(square)
    else:
        ratio = jnp.sqrt(args.rest_length**2 / square)
    tension = args.stiffness * (1.0 - ratio)
    return own.acceleration - own.damping.rate * v + impulses(d, tension, own.inverse_mass)


def _springs(x: Any, args: RopeArgs) -> tuple[Any, Any]:
    """The vector along each spring, and the square of its length.

    A spring pulls node a towards node b with ``k (|b - a| - l) (b - a)/|b - a|``. At length
    zero that has no direction, and the force is defined to be zero. A tiny number is added to
    the length's square, which leaves all lengths above 1e-67 as they are: what is divided by is
    then never zero, and the derivatives stay finite as well.
    """
    d = along(x, args.free.shape[-1] - args.rest_length.shape[-1])
    # Not `jnp.sum`: XLA stores what it sums over a leading axis, and reads it back.
    return d, sum((component**2 for component in d), _SMALLEST)


def linear_damping(args: Any) -> LinearDamping:
    """The damping force ``-damping v`` as an acceleration; none at pinned nodes."""
    return LinearDamping(args.damping / args.mass * args.free, args.damping * args.free)


def links(args: RopeArgs) -> Links:
    """The rope as steppers see it that move nodes link by link."""
    return rigid_links(args)._replace(compliance=1.0 / args.stiffness)


def rigid_links(args: Any) -> Links:
    """The same rope with links that keep their lengths."""
    return Links(
        length=args.rest_length,
        inverse_mass=args.free / args.mass,
        acceleration=args.gravity * args.free,
        damping=linear_damping(args),
    )


def energy(t: Any, y: Any, args: RopeArgs) -> Any:
    """Kinetic energy, spring energy and potential energy in gravity's field.

    Constant along solutions where the damping is zero. Gravity pulls on pinned nodes too,
    but these do not move, so that their share is constant.

    Arguments:
        t: time; not used.
        y: state, ``(2, dim, nodes)``.
        args: the rope's numbers.
    """
    _, square = _springs(y[0], args)
    springs = 0.5 * jnp.sum(args.stiffness * (jnp.sqrt(square) - args.rest_length) ** 2)
    return energy_of_nodes(t, y, args) + springs


def energy_of_nodes(t: Any, y: Any, args: Any) -> Any:
    """Kinetic energy and potential energy in gravity's field; arguments as for `energy`."""
    del t
    x, v = y
    kinetic = 0.5 * jnp.sum(args.mass * jnp.sum(v * v, axis=0))
    return kinetic - jnp.sum(args.mass * args.gravity * x)
