"""Names of methods, and what differs from a well-known one."""

from __future__ import annotations

import dataclasses
from fractions import Fraction as F

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ropeode.tableaus import NystromTableau, Tableau
from ropeode.theory import EXPLICIT, IMPLICIT, SECOND_ORDER, describe, recognised, tableau_of
from tests.theory.random_tableaus import coefficients

RK4, HEUN, VERLET = EXPLICIT["RK4"], EXPLICIT["Heun's method"], SECOND_ORDER["velocity-verlet"]
MUTATED = [each for each in EXPLICIT.items() if each[1].stages > 2 and each[1].rational]
KNOWN = {**EXPLICIT, **IMPLICIT, **SECOND_ORDER}


def changed(tableau, **entries):
    """A tableau with other entries, as in ``a43="1/2"``."""
    values = {name: list(getattr(tableau, name)) for name in "abc"}
    values["a"] = list(map(list, tableau.a))
    for place, value in entries.items():
        name, *indices = place
        row = values[name]
        for index in indices[:-1]:
            row = row[int(index) - 1]
        row[int(indices[-1]) - 1] = F(value)
    return Tableau(tuple(map(tuple, values["a"])), tuple(values["b"]), tuple(values["c"]))


@pytest.mark.parametrize("name", KNOWN)
def test_well_known_methods_are_themselves(name):
    assert recognised(KNOWN[name]) == (name, KNOWN[name], KNOWN[name], ())


@pytest.mark.parametrize("name", EXPLICIT)
def test_runge_kutta_methods_are_named_on_positions_and_velocities_too(name):
    assert recognised(NystromTableau.of_tableau(EXPLICIT[name])).name == name


@pytest.mark.parametrize(
    ("tableau", "words"),
    [
        (RK4, "This is RK4; its order is 4."),
        (
            changed(RK4, a43="1/2"),
            "This is RK4 with a43 = 1/2 in place of 1; its order is 1 in place of 4.",
        ),
        (
            changed(RK4, b2="2/3", b3=0),
            "This is RK4 with k2 used twice in the result in place of k3; its order is 2 in place "
            "of 4.",
        ),
        (
            changed(RK4, a31="1/2", a32=0),
            "This is RK4 with k1 used in the argument of k3 in place of k2; its order is 2 in "
            "place of 4. k2 and k3 are computed with equal arguments.",
        ),
        (
            changed(RK4, b2="2/3", b3=0, a42=1, a43=0),
            "This is RK4 with k2 used twice in the result in place of k3, and with k2 used in the "
            "argument of k4 in place of k3; its order is 2 in place of 4. k3 is not used in the "
            "step.",
        ),
        (
            changed(RK4, c2=0, c3=0, c4=0),
            "This is RK4 with all slopes taken at time t; its order is 1 in place of 4, and 4 "
            "where the right-hand side does not depend on time.",
        ),
        (
            changed(RK4, b1="1/5", b2="2/5", b3="2/5", b4="1/5"),
            "This is RK4 with its slopes times 6/5 in the result; its order is 0 in place of 4.",
        ),
        (
            changed(RK4, b1="1/3", b2="1/6"),
            "This is RK4 with k1 and k2 swapped in the result; its order is 1 in place of 4.",
        ),
        (
            changed(HEUN, b1=1, b2=0),
            "This is explicit-euler; its order is 1. k2, the slope at the new state, is not used "
            "in the step.",
        ),
        (
            Tableau.of([[], ["1/2"]], [1, 0]),
            "This is explicit-euler; its order is 1. k2 is not used in the step.",
        ),
        (
            Tableau.of([[], ["3/4"]], ["1/3", "2/3"]),
            "This is an explicit Runge-Kutta method with 2 stages, none of the well-known ones; "
            "its order is 2.",
        ),
        (
            dataclasses.replace(SECOND_ORDER["semi-implicit-euler"], q=(F(1, 4),)),
            "This is an explicit Nystrom method with 1 stage, none of the well-known ones; its "
            "order is 1, for forces that do not depend on the velocities.",
        ),
        (
            dataclasses.replace(
                SECOND_ORDER["semi-implicit Euler with the positions first"], c=(F(0),)
            ),
            "This is semi-implicit Euler with the positions first with all slopes taken at time t; "
            "its order is 1, for forces that do not depend on the velocities.",
        ),
        (
            NystromTableau.of_tableau(changed(RK4, a43="1/2")),
            "This is RK4 with a43 = 1/2 in place of 1; its order is 1 in place of 4.",
        ),
        (
            dataclasses.replace(VERLET, q=(F(1), F(0)), p=((F(0), F(0)), (F(1), F(0)))),
            "This is velocity-verlet with 1 in place of 1/2 as the factor of dt^2 k1 in the new "
            "positions; its order is 1 in place of 2, for forces that do not depend on the "
            "velocities.",
        ),
        (
            dataclasses.replace(VERLET, a=((F(0), F(0)),) * 2),
            "This is velocity-verlet; its order is 1, and 2 where forces do not depend on the "
            "velocities. k2 takes positions at t + dt and velocities at t.",
        ),
        (
            dataclasses.replace(VERLET, d=(F(0), F(0)), p=((F(0), F(0)),) * 2),
            "This is velocity-verlet with the old positions used in k2; its order is 1 in place of "
            "2, for forces that do not depend on the velocities.",
        ),
        (
            dataclasses.replace(SECOND_ORDER["semi-implicit-euler"], q=(F(-1),), b=(F(-1),)),
            "This is semi-implicit-euler with all its slopes times -1; its order is 0 in place of "
            "1, for forces that do not depend on the velocities.",
        ),
    ],
)
def test_sentences(tableau, words):
    assert describe(tableau) == words


@settings(max_examples=40)
@given(st.data())
def test_a_changed_entry_is_named(data):
    name, known = data.draw(st.sampled_from(MUTATED))
    i = data.draw(st.integers(1, known.stages))
    j = data.draw(st.integers(1, max(i - 1, 1)))
    place = data.draw(st.sampled_from([f"b{i}", *([f"a{i}{j}", f"c{i}"] if i > 1 else [])]))
    value = data.draw(coefficients)
    tableau = changed(known, **{place: value})
    found = recognised(tableau)
    assert found is not None
    if found.name != name:
        # Another one is as near.
        assert len(found.differences) <= 1
        return
    old = getattr(known, place[0])
    for index in place[1:]:
        old = old[int(index) - 1]
    expected = (f"{place} = {value} in place of {old}",) if value != old else ()
    assert found.differences == expected or "all slopes taken at time t" in found.differences


@pytest.mark.parametrize(
    ("tableau", "corrections"),
    [
        (RK4, []),
        (changed(RK4, a43="1/2"), ["k4 = f(t + dt, y + dt * k3)"]),
        (
            changed(RK4, b2="2/3", b3=0),
            ["y_new = y + dt * (1/6 * k1 + 1/3 * k2 + 1/3 * k3 + 1/6 * k4)"],
        ),
        (
            dataclasses.replace(VERLET, q=(F(1), F(0))),
            ["k2 = a(t + dt, x_new)", "x_new = x + dt * v + 1/2 * dt**2 * k1"],
        ),
    ],
)
def test_only_the_lines_that_differ_are_corrected(tableau, corrections):
    assert recognised(tableau).corrections == corrections


def test_an_order_that_is_not_the_declared_one_is_said():
    assert describe(HEUN, declared=2) == "This is Heun's method; its order is 2."
    assert describe(HEUN, declared=4) == "This is Heun's method; its order is 2 (declared: 4)."


def test_a_step_with_a_slip_is_described():
    """The whole way, from a step function of a user to the sentence."""

    def step(rhs, t, y, dt, args):
        k1 = rhs(t, y, args)
        k2 = rhs(t + dt / 2, y + dt / 2 * k1, args)
        k3 = rhs(t + dt / 2, y + dt / 2 * k2, args)
        k4 = rhs(t + dt, y + dt / 2 * k3, args)
        return y + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)

    assert describe(tableau_of(step).tableau).startswith(
        "This is RK4 with a43 = 1/2 in place of 1;"
    )
