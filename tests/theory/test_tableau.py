"""What a tableau says about a Runge-Kutta method apart from its order."""

from __future__ import annotations

from fractions import Fraction as F

import numpy as np
import pytest
from hypothesis import given, settings

from ropeode.tableaus import Tableau
from ropeode.theory import EXPLICIT, IMPLICIT
from tests.theory.random_tableaus import explicit_tableaus


@pytest.mark.parametrize(
    ("name", "assumptions"),
    [
        # Hairer, Wanner, Solving ODEs II, table IV.5.13.
        ("the Gauss method of order 4", (4, 2, 2)),
        ("Radau IIA of order 5", (5, 3, 2)),
        ("Lobatto IIIA of order 4", (4, 3, 1)),
    ],
)
def test_simplifying_assumptions(name, assumptions):
    assert IMPLICIT[name].simplifying_assumptions == assumptions


@pytest.mark.parametrize(
    ("name", "above", "below"),
    [
        # Hairer, Wanner, Solving ODEs II, table IV.3.1 of Pade approximations to exp(z).
        ("Radau IIA of order 3", [1, F(1, 3)], [1, -F(2, 3), F(1, 6)]),
        ("Lobatto IIIA of order 4", [1, F(1, 2), F(1, 12)], [1, -F(1, 2), F(1, 12)]),
    ],
)
def test_stability_functions_are_exact(name, above, below):
    assert IMPLICIT[name].stability_function == (tuple(above), tuple(below))


@pytest.mark.parametrize("name", [*EXPLICIT, *IMPLICIT])
def test_stability_function_is_what_a_step_does(name):
    tableau = {**EXPLICIT, **IMPLICIT}[name]
    # Real and imaginary part of a number that is multiplied by -0.4 + 0.9j, as a state of two.
    matrix = np.array([[-0.4, -0.9], [0.9, -0.4]])
    x, y = tableau.step(lambda t, y: matrix @ y, 0.0, np.array([1.0, 0.0]), 0.5)
    assert x + 1j * y == pytest.approx(complex(tableau.stability_function(-0.2 + 0.45j)))


@settings(max_examples=15)
@given(explicit_tableaus())
def test_stages_without_effect_do_not_count(tableau):
    """A copy of the first stage, and a stage that nothing needs: the reduced method is the same."""
    zero = (F(0),)
    half = tableau.b[0] / 2
    more = Tableau(
        tuple(row + zero + zero for row in (*tableau.a, tableau.a[0], tableau.b)),
        (half, *tableau.b[1:], half, F(0)),
        (*tableau.c, tableau.c[0], F(1)),
    )
    assert more.reduced == tableau.reduced
    assert more.stages - 1 in more.unused


def test_a_stage_without_effect_is_no_factor_of_the_stability_function():
    tableau = Tableau.of([[1, 0], [0, "1/2"]], [1, 0])
    assert tableau.stability_function == ((1,), (1, -1))
    assert tableau.unused == (1,)


def test_implicit_equations_without_a_solution_nearby_give_not_a_number():
    y = IMPLICIT["implicit Euler"].step(lambda t, y: -9.0 * y, 0.0, np.array([1.0]), 1.0)
    assert np.all(np.isnan(y))
