"""Methods for second-order problems, in which positions and velocities have their own coefficients.

Runge-Kutta methods, partitioned ones (semi-implicit Euler, velocity Verlet) and those of Nystrom
all have this form on ``x' = v``, ``v' = a(t, x, v)``.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Iterator
from fractions import Fraction
from typing import Any, Self

import numpy as np

from ropeode.tableaus.order_conditions import Method
from ropeode.tableaus.rooted_trees import SECOND_ORDER, Tree, trees_of_order
from ropeode.tableaus.stages import Matrix, Number, Parts, Row, applied, dot, moduli
from ropeode.tableaus.tableau import Tableau

_POSITIONS_ONLY = {"v": ("x", "t"), "x": ("v",), "t": ()}


@dataclasses.dataclass(frozen=True)
class NystromTableau(Method):
    """A method that takes accelerations ``k_i = a(t_i, x_i, v_i)`` and adds them up.

    With ``t_i = t + c_i dt``, ``x_i = x + d_i dt v + dt^2 Σ p_ij k_j`` and
    ``v_i = v + dt Σ a_ij k_j``; and for the result ``x += dt v + dt^2 Σ q_i k_i`` and
    ``v += dt Σ b_i k_i``.

    Arguments:
        p: the matrix of the positions, as rows; fractions where they are known exactly.
        q: the weights of the new positions.
        a: the matrix of the velocities; None where the acceleration never sees them, so that the
            method is one for forces of time and positions.
        b: the weights of the new velocities.
        c: the times of the accelerations, in units of dt.
        d: how far the positions have drifted, in units of ``dt v``.

    Source: Hairer, Norsett, Wanner, Solving ODEs I, section II.14, where p and q are a and b with
    bars, and d = c.
    """

    p: Matrix
    q: Row
    a: Matrix | None
    b: Row
    c: Row
    d: Row

    @classmethod
    def of_tableau(cls, tableau: Tableau) -> NystromTableau:
        """A Runge-Kutta method on a second-order problem: p = a a and q = b a."""
        columns = tuple(zip(*tableau.a, strict=True))
        return cls(
            p=tuple(tuple(dot(row, column) for column in columns) for row in tableau.a),
            q=tuple(dot(tableau.b, column) for column in columns),
            a=tableau.a,
            b=tableau.b,
            c=tableau.c,
            d=tableau.row_sums,
        )

    @property
    def parts(self) -> Parts:
        """Its coefficients by their kind."""
        matrices = (self.p,) if self.a is None else (self.p, self.a)
        return Parts(matrices, (self.q, self.b), (self.c, self.d))

    def of_parts(self, parts: Parts) -> Self:
        """A method with other coefficients."""
        (p, *a), (q, b), (c, d) = parts
        return dataclasses.replace(self, p=p, q=q, a=a[0] if a else None, b=b, c=c, d=d)

    def trees(self, order: int) -> Iterator[Tree]:
        """The trees of its conditions with so many nodes: for velocities and for positions."""
        colours = _POSITIONS_ONLY if self.a is None else SECOND_ORDER
        for root in "vx":
            yield from trees_of_order(order, colours, root)

    def branch(self, tree: Tree, in_moduli: bool) -> Row:
        """The factor that a branch gives to the weight of each stage, ``(stages,)``."""
        if tree.colour == "v" or tree.branches:
            matrix = self.a if tree.colour == "v" else self.p
            below = tree if tree.colour == "v" else tree.branches[0]
            assert matrix is not None
            if in_moduli:
                matrix = tuple(map(moduli, matrix))
            return applied(matrix, self.stage_weights(below, in_moduli))
        column = self.c if tree.colour == "t" else self.d
        return moduli(column) if in_moduli else column

    def weight(self, tree: Tree, in_moduli: bool = False) -> Number:
        """The elementary weight of a tree, for velocities or positions as its root is coloured."""
        if tree.colour == "x" and not tree.branches:
            # The new positions always hold dt v.
            return Fraction(1)
        row, below = (self.q, tree.branches[0]) if tree.colour == "x" else (self.b, tree)
        return dot(moduli(row) if in_moduli else row, self.stage_weights(below, in_moduli))

    @functools.cached_property
    def order_without_velocities(self) -> int:
        """The order where the acceleration depends on time and positions alone."""
        return dataclasses.replace(self, a=None).order

    def step(
        self, force: Callable[[float, Any, Any], Any], t: float, x: Any, v: Any, dt: float
    ) -> tuple[Any, Any]:
        """Positions and velocities after one step of an explicit method, by the definition.

        Arguments:
            force: the acceleration ``force(t, x, v)``; where `a` is None it is handed v as it is.
            t: time.
            x, v: arrays of the same shape.
            dt: step size.
        """
        p, q, b, c, d = (
            np.array(each, dtype=float) for each in (self.p, self.q, self.b, self.c, self.d)
        )
        a = np.zeros_like(p) if self.a is None else np.array(self.a, dtype=float)
        k = np.zeros((self.stages, *np.shape(x)))
        for i in range(self.stages):
            x_i = x + d[i] * dt * v + dt**2 * np.tensordot(p[i], k, 1)
            k[i] = force(t + c[i] * dt, x_i, v + dt * np.tensordot(a[i], k, 1))
        return x + dt * v + dt**2 * np.tensordot(q, k, 1), v + dt * np.tensordot(b, k, 1)
