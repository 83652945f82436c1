"""Names of methods, and what differs from a well-known one."""

from __future__ import annotations

import dataclasses
import functools
from fractions import Fraction as F

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ropeode.tableaus import NystromTableau, Tableau
from ropeode.theory import EXPLICIT, IMPLICIT, SECOND_ORDER, describe, recognised
from tests.theory.random_tableaus import coefficients

RK4, HEUN = EXPLICIT["RK4"], EXPLICIT["Heun's method"]
MUTATED = [each for each in EXPLICIT.items() if each[1].stages > 2 and each[1].rational]
KNOWN = {**EXPLICIT, **IMPLICIT, **SECOND_ORDER}


def changed(tableau, **entries):
    """A tableau with other entries, as in ``a43="1/2"``."""
    values = {name: np.array(getattr(tableau, name)) for name in "abc"}
    for (name, *indices), value in entries.items():
        values[name][tuple(int(index) - 1 for index in indices)] = F(value)
    return Tableau(tuple(map(tuple, values["a"])), tuple(values["b"]), tuple(values["c"]))


@pytest.mark.parametrize("name", KNOWN)
def test_well_known_methods_are_themselves(name):
    assert recognised(KNOWN[name]) == (name, KNOWN[name], KNOWN[name], ())
    if name in EXPLICIT:
        assert recognised(NystromTableau.of_tableau(KNOWN[name])).name == name


rk4 = functools.partial(changed, RK4)
euler = functools.partial(dataclasses.replace, SECOND_ORDER["semi-implicit-euler"])
verlet = functools.partial(dataclasses.replace, SECOND_ORDER["velocity-verlet"])
ZERO, ONE = F(0), F(1)
NONE = ((ZERO, ZERO),) * 2


@pytest.mark.parametrize(
    ("tableau", "words"),
    [
        (RK4, "RK4; its order is 4"),
        (rk4(a43="1/2"), "RK4 with a43 = 1/2 in place of 1; its order is 1 in place of 4"),
        (NystromTableau.of_tableau(rk4(a43="1/2")), "RK4 with a43 = 1/2 in place of 1; its"),
        (rk4(b2="2/3", b3=0), "k2 used twice in the result in place of k3; its order is 2"),
        (rk4(b2="2/3", b3=0, a42=1, a43=0), "k3, and with k2 used in the argument of k4"),
        (rk4(c2=0, c3=0, c4=0), "RK4 with all slopes taken at time t; its order is 1 in place of"),
        (rk4(b1="1/5", b2="2/5", b3="2/5", b4="1/5"), "RK4 with its slopes times 6/5 in the"),
        (rk4(b1="1/3", b2="1/6"), "RK4 with k1 and k2 swapped in the result; its order is 1"),
        (changed(HEUN, b1=1, b2=0), "explicit-euler; its order is 1. k2, the slope at the new"),
        (Tableau.of([[], ["3/4"]], ["1/3", "2/3"]), "2 stages, none of the well-known ones; its"),
        (euler(q=(F(1, 4),)), "an explicit Nystrom method with 1 stage, none of the well-known"),
        (euler(q=(-ONE,), b=(-ONE,)), "semi-implicit-euler with all its slopes times -1; its"),
        (verlet(q=(ONE, ZERO), p=((ZERO, ZERO), (ONE, ZERO))), "1 in place of 1/2 as the factor"),
        (verlet(a=NONE), "velocity-verlet; its order is 1, and 2 where forces do not depend on"),
        (verlet(d=(ZERO, ZERO), p=NONE), "the old positions used in k2; its order is 1 in place"),
    ],
)
def test_what_differs_and_what_it_costs_is_said(tableau, words):
    assert words in describe(tableau)


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
    if found.name != name:
        # Another one is as near.
        assert len(found.differences) <= 1
        return
    old = np.array(getattr(known, place[0]))[tuple(int(index) - 1 for index in place[1:])]
    expected = (f"{place} = {value} in place of {old}",) if value != old else ()
    assert found.differences == expected or "all slopes taken at time t" in found.differences


def test_an_order_that_is_not_the_declared_one_is_said():
    assert describe(HEUN, declared=2) == "This is Heun's method; its order is 2."
    assert describe(HEUN, declared=4) == "This is Heun's method; its order is 2 (declared: 4)."
