"""The rope whose nodes are joined by rigid links, as an initial value problem."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from ropeode.errors import InputError
from ropeode.problems import rope_input
from ropeode.problems.links import along, constrained_acceleration, dot
from ropeode.problems.rope import energy_of_nodes, linear_damping, rigid_links
from ropeode.problems.rope_input import Indices, Numbers, OneOrMany, RopeInput, Velocity
from ropeode.validation import complaint

# What rounding may leave of a stretching rate, relative to the velocities.
_ROUNDING = 1e-12


class InextensibleRope(RopeInput):
    """A chain of point masses joined by rigid massless links, some of them pinned.

    Nodes stand equally spaced from `start` to `end` (a single node at `start`). It is what a
    `Rope` tends to as its stiffness grows, and what a stepper that projects link lengths
    solves as its step size shrinks. The time unit is one frame.

    Arguments:
        start: position of the first node, 2 or 3 coordinates.
        end: position of the last node.
        num_nodes: number of nodes.
        node_mass: mass of every node, or one for each.
        pinned: indices of the nodes that do not move. The rope starts taut, so that nodes
            between two pins could not move either: it may be pinned in one node, or in
            neighbours.
        gravity: acceleration, as many components as `start`; the default of a
            3-D rope is (0, -1, 0).
        damping: coefficient of the force ``-damping * v``, one or one for each node.
        initial_velocity: one velocity for all the nodes that are free, or one for each; no
            link may be stretched by it.

    Raises:
        InputError: one line for each argument that cannot be used.

    Examples:
        >>> from ropeode import InextensibleRope
        >>> rope = InextensibleRope(num_nodes=4)
        >>> rope.problem(frames=3)
        <Problem: inextensible rope, 4 nodes, damping 0.01, 3 frames>
        >>> rope.lengths().round(1)
        array([133.3, 133.3, 133.3])
    """

    kind = "inextensible-rope"

    start: Numbers = rope_input.START
    end: Numbers = rope_input.END
    num_nodes: int = rope_input.NUM_NODES
    node_mass: OneOrMany = rope_input.NODE_MASS
    pinned: Indices = rope_input.PINNED
    gravity: Numbers = rope_input.GRAVITY
    damping: OneOrMany = rope_input.DAMPING
    initial_velocity: Velocity = rope_input.INITIAL_VELOCITY

    def __init__(self, /, *values: Any, **named: Any):
        super().__init__(*values, **named)
        faults = [*self._lengths_at_fault(), *self._pins_at_fault()]
        if faults := faults or self._velocities_at_fault():
            raise InputError(faults)

    def _lengths_at_fault(self) -> list[str]:
        if np.all(self.lengths() > 0):
            return []
        allowed = "a point so far from start that no link has length zero"
        return [complaint("end", self.end, allowed, "move it away, or take fewer nodes")]

    def _pins_at_fault(self) -> list[str]:
        if len(self.pinned) == self.num_nodes:
            allowed = "pins that leave a node free (with all nodes pinned, nothing moves)"
            return [complaint("pinned", list(self.pinned), allowed, "leave one out")]
        for pin, other in zip(self.pinned, self.pinned[1:], strict=False):
            if other - pin > 1:
                allowed = (
                    "one node, or neighbours (the rope is taut between the pins "
                    f"{pin} and {other}, so that what is between them cannot move)"
                )
                fix = f"leave one of them out, as in pinned = [{pin}]"
                return [complaint("pinned", list(self.pinned), allowed, fix)]
        return []

    def _velocities_at_fault(self) -> list[str]:
        y0 = self.y0()
        d, w = np.diff(y0)
        rate = np.abs(np.sum(d * w, axis=0)) / self.lengths()
        fastest = np.max(np.abs(y0[1]), initial=0.0)
        bad = np.flatnonzero(rate > _ROUNDING * fastest)
        if not len(bad):
            return []
        allowed = (
            f"velocities that stretch no link (link {bad[0]}, between the nodes {bad[0]} and "
            f"{bad[0] + 1}, would change its length by {rate[bad[0]]:.3g} per frame)"
        )
        fix = "give velocities across the rope, or none"
        return [complaint("initial_velocity", self.initial_velocity, allowed, fix)]

    def functions(self) -> dict[str, Any]:
        """See `RopeInput`."""
        return {
            "acceleration": acceleration,
            # The tensions depend on the velocities too, and a single node has none.
            "damping": linear_damping if self.num_nodes == 1 else None,
            "links": rigid_links,
            "energy": energy_of_nodes,
            "constraints": constraints,
        }

    def args(self) -> InextensibleRopeArgs:
        """See `RopeInput`."""
        return InextensibleRopeArgs(**self.common_args())


class InextensibleRopeArgs(NamedTuple):
    """The numbers in the rope's equations; nodes and links run along the last axis."""

    mass: Any
    rest_length: Any
    free: Any
    gravity: Any
    damping: Any


def acceleration(t: Any, x: Any, v: Any, args: InextensibleRopeArgs) -> Any:
    """``M a = tensions - damping v + M gravity`` with links of constant length.

    Arguments:
        t: time; the rope does not depend on it.
        x: positions, ``(dim, nodes)``.
        v: velocities, ``(dim, nodes)``.
        args: the rope's numbers.
    """
    del t
    return constrained_acceleration(x, v, rigid_links(args))


def constraints(t: Any, y: Any, args: InextensibleRopeArgs) -> dict[str, Any]:
    """What is zero along each solution: how much longer the links are, and are getting.

    Arguments:
        t: time; not used.
        y: state, ``(2, dim, nodes)``.
        args: the rope's numbers.
    """
    del t
    apart = rigid_links(args).apart
    d, w = along(y[0], apart), along(y[1], apart)
    length = jnp.sqrt(dot(d, d))
    return {"position": length - args.rest_length, "velocity": dot(d, w) / length}
