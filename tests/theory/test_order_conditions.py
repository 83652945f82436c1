"""What a tableau says of its method: its order, and what else follows from the coefficients.

Held against published values, kauri's trees, and errors that are measured.
"""

from __future__ import annotations

import dataclasses
import math
import re
from fractions import Fraction as F

import kauri
import numpy as np
import pytest
from hypothesis import given, settings
from scipy import linalg

from ropeode.tableaus import NystromTableau, Tableau
from ropeode.tableaus.rooted_trees import FIRST_ORDER, Tree, trees_of_order
from ropeode.theory import EXPLICIT, IMPLICIT, SECOND_ORDER
from tests.theory.steps import explicit_tableaus, of_diffrax

RK4 = EXPLICIT["RK4"]
VERLET = SECOND_ORDER["velocity-verlet"]
EVERY = {**EXPLICIT, **IMPLICIT, **SECOND_ORDER}


def shape_of(tree: Tree) -> tuple:
    """A tree as nested tuples of branches, which do not depend on who lists them."""
    return tuple(sorted(map(shape_of, tree.branches)))


def shape_of_kauris(tree: list | tuple) -> tuple:
    """Likewise; the last element of kauri's lists is a colour."""
    return tuple(sorted(map(shape_of_kauris, tree[:-1])))


def test_trees_are_kauris_with_their_densities_and_symmetries():
    for order in range(1, 10):
        own = trees_of_order(order, {"y": ("y",)}, "y")
        theirs = list(kauri.trees_of_order(order))
        assert len(own) == len(theirs)
        assert {shape_of(each): (each.density, each.symmetry) for each in own} == {
            shape_of_kauris(each.list_repr): (each.factorial(), each.sigma()) for each in theirs
        }
    # OEIS A000151 for two colours of which one is that of leaves: by hand to order 3.
    assert [len(trees_of_order(p, FIRST_ORDER, "y")) for p in (1, 2, 3)] == [1, 2, 5]


@pytest.mark.parametrize("name", EVERY)
def test_names_of_well_known_methods_tell_their_order(name):
    order = EVERY[name].order
    said = re.search(r"order (\d)", name)
    assert said is None or order == int(said[1])
    if name in EXPLICIT:
        own = NystromTableau.of_tableau(EXPLICIT[name])
        assert own.order == own.order_without_velocities == order


def test_times_and_velocities_of_a_lower_order_cost_order_only_where_they_count():
    late = dataclasses.replace(RK4, c=(F(0),) * 4)
    assert (late.order, late.order_without_time) == (1, 4)
    # Order 2 in time needs the sum of b_i c_i alone.
    assert dataclasses.replace(RK4, c=(F(1, 2),) * 4).order == 2
    lagged = dataclasses.replace(VERLET, a=((F(0),) * 2,) * 2)
    assert (lagged.order, lagged.order_without_velocities) == (1, 2)


def observed_order(step, exact, size):
    """From the errors of one step and of one half as long, less one."""
    long, short = (np.max(np.abs(step(dt) - exact(dt))) for dt in (size, size / 2))
    return math.log2(long / short) - 1


@pytest.mark.parametrize("name", [*EXPLICIT, *IMPLICIT])
def test_order_is_that_of_errors_on_an_equation_that_depends_on_time(name):
    tableau = EVERY[name]

    def f(t, y):
        return -2.0 * t * y**2  # y = 1/(1 + t^2)

    def exact(dt):
        return np.array([1.0 / (1.0 + (0.4 + dt) ** 2)])

    order = observed_order(lambda dt: tableau.step(f, 0.4, exact(0.0), dt), exact, 0.02)
    assert order == pytest.approx(tableau.order, abs=0.25)


@pytest.mark.parametrize("damping", [0.0, 0.5])
@pytest.mark.parametrize("name", SECOND_ORDER)
def test_order_of_second_order_methods_is_that_of_errors(name, damping):
    """On x'' = -x - r v, with the velocities that velocity Verlet's users hand to their forces."""
    tableau = SECOND_ORDER[name]
    if damping:
        lagged = ((F(0),) * tableau.stages,) * tableau.stages
        tableau = dataclasses.replace(tableau, a=lagged)
    matrix, start = np.array([[0.0, 1.0], [-1.0, -damping]]), np.array([0.7, 0.4])

    def step(dt):
        return np.array(tableau.step(lambda t, x, v: -x - damping * v, 0.0, *start, dt))

    # The linear force hides some conditions, but never those of the first error of these methods.
    # Nor rounding, if the step is long enough.
    size = 0.02 if tableau.order < 5 else 0.2
    observed = observed_order(step, lambda dt: linalg.expm(dt * matrix) @ start, size)
    assert observed == pytest.approx(tableau.order, abs=0.1)


def test_principal_error_norms_are_the_published_ones():
    # Dormand and Prince, J. Comput. Appl. Math. 6 (1980), give 0.399e-3 for RK5(4)7M.
    assert of_diffrax("Dopri8").order == 8
    assert of_diffrax("Dopri5").principal_error_norm == pytest.approx(3.99e-4, rel=1e-3)
    assert RK4.principal_error_norm == pytest.approx(1.45e-2, rel=1e-3)


# --- apart from the order


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
