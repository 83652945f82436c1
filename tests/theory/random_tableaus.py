"""Runge-Kutta methods drawn at random and published ones, and steps that are made of them."""

from __future__ import annotations

from fractions import Fraction

import diffrax
from hypothesis import strategies as st

from ropeode.tableaus import NystromTableau, Tableau

coefficients = st.fractions(min_value=-3, max_value=3, max_denominator=24)


@st.composite
def rows(draw, stages):
    """A matrix with zeros on and above the diagonal."""
    return tuple(
        tuple(draw(coefficients) if j < i else Fraction(0) for j in range(stages))
        for i in range(stages)
    )


def row(stages):
    return st.tuples(*[coefficients] * stages)


@st.composite
def explicit_tableaus(draw, most_stages=5):
    stages = draw(st.integers(1, most_stages))
    return Tableau(draw(rows(stages)), draw(row(stages)), draw(row(stages)))


@st.composite
def nystrom_tableaus(draw, most_stages=4):
    stages = draw(st.integers(1, most_stages))
    p, a = draw(rows(stages)), draw(rows(stages))
    q, b, c, d = (draw(row(stages)) for _ in range(4))
    return NystromTableau(p, q, a, b, c, d)


def step_of(tableau):
    """A step function that takes the slopes of a tableau, as its author writes it in NumPy."""

    def step(rhs, t, y, dt, args):
        return tableau.step(lambda t, y: rhs(t, y, args), t, y, dt)

    def second_order_step(acceleration, t, x, v, dt, args):
        return tableau.step(lambda t, x, v: acceleration(t, x, v, args), t, x, v, dt)

    return step if isinstance(tableau, Tableau) else second_order_step


def of_diffrax(name):
    """The tableau that diffrax publishes with a solver."""
    own = getattr(diffrax, name).tableau
    return Tableau.of([[], *own.a_lower], own.b_sol, [0.0, *own.c])
