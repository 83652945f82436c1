"""Tableaus that are found by watching a step, their names, and what differs from known ones."""

from __future__ import annotations

import dataclasses
import functools
from fractions import Fraction as F

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate

from ropeode.problems import Problem
from ropeode.tableaus import NystromTableau, Tableau
from ropeode.theory import EXPLICIT, IMPLICIT, SECOND_ORDER, describe, recognised, tableau_of
from tests.theory.steps import (
    AdamsBashforth,
    coefficients,
    euler_in_numpy,
    explicit_tableaus,
    nystrom_tableaus,
    of_diffrax,
    step_of,
)

RK4, SEMI_IMPLICIT = EXPLICIT["RK4"], SECOND_ORDER["semi-implicit-euler"]
SLOW = pytest.mark.slow


def equal(one, other):
    """Up to the last digits of coefficients that are no fractions."""
    return all(
        np.allclose(np.array(a, float), np.array(b, float), rtol=0, atol=1e-12)
        for a, b in zip((one.a, one.b, one.c), (other.a, other.b, other.c), strict=True)
    )


@settings(max_examples=20)
@given(st.one_of(explicit_tableaus(), nystrom_tableaus()))
def test_every_explicit_method_is_found_exactly(tableau):
    assert tableau_of(step_of(tableau)) == (tableau, "")


@pytest.mark.parametrize(
    ("name", "stepper"),
    [
        ("the implicit trapezoidal rule", None),
        ("Alexander's SDIRK2", None),
        ("Radau IIA of order 5", None),
        # The stage at the later time comes first.
        pytest.param("the Gauss method of order 4", "gauss4", marks=SLOW),
        pytest.param("implicit Euler", "diffrax:ImplicitEuler", marks=SLOW),
    ],
)
def test_implicit_methods_are_found(name, stepper):
    """The equations are solved by iterations until nothing changes."""
    found = tableau_of(stepper or step_of(IMPLICIT[name]))
    assert found.tableau is not None, found.reason
    assert equal(found.tableau, IMPLICIT[name])


def test_a_few_iterations_of_an_implicit_method_are_an_explicit_one():
    def midpoint(rhs, t, y, dt, args):
        new = y
        for _ in range(3):
            new = y + dt * rhs(t + dt / 2, (y + new) / 2, args)
        return new

    tableau = tableau_of(midpoint).tableau
    assert (tableau.explicit, tableau.order, tableau.b) == (True, 2, (0, 0, 1))


@pytest.mark.parametrize(
    "name", ["scipy:DOP853", "diffrax:Bosh3", pytest.param("diffrax:Dopri8", marks=SLOW)]
)
def test_tableaus_of_libraries_from_their_compiled_steps(name):
    library, method = name.split(":")
    if library == "diffrax":
        published = of_diffrax(method)
    else:
        own = getattr(integrate, method)
        stages = own.n_stages
        published = Tableau.of(own.A[:stages, :stages], own.B, own.C[:stages])
    assert equal(tableau_of(name).tableau.reduced, published.reduced)


def test_loops_of_jax_are_watched_too():
    def euler_twice(rhs, t, y, dt, args):
        def half(i, y):
            return y + dt / 2 * rhs(t + i * dt / 2, y, args)

        return jax.lax.fori_loop(0, 2, half, jnp.asarray(y))

    assert tableau_of(euler_twice).tableau == Tableau.of([[], ["1/2"]], ["1/2", "1/2"])


def shu_and_osher(rhs, t, y, dt, args):
    """SSPRK3 with sums of states, as they have it: what is held is rounded."""
    first = y + dt * rhs(t, y, args)
    second = 3 / 4 * y + 1 / 4 * (first + dt * rhs(t + dt, first, args))
    return 1 / 3 * y + 2 / 3 * (second + dt * rhs(t + dt / 2, second, args))


LAGGED = dataclasses.replace(SECOND_ORDER["velocity-verlet"], a=((F(0), F(0)),) * 2)


def test_on_a_problem(small_rope):
    assert tableau_of(step_of(RK4), small_rope).tableau == RK4
    assert tableau_of(step_of(LAGGED), small_rope).tableau == LAGGED
    assert tableau_of(shu_and_osher, small_rope).tableau == EXPLICIT["SSPRK3"]


def test_what_the_problem_holds_may_be_held_by_hand(small_rope):
    """The pinned node is put back where it was; everything else is semi-implicit Euler."""

    def held(acceleration, t, x, v, dt, args, drop=0.0):
        v_new = v + dt * acceleration(t, x, v, args)
        x_new = x + dt * v_new
        x_new[0], v_new[0] = x[0] - drop * dt**2, 0.0
        return x_new, v_new

    found = tableau_of(held, small_rope).tableau
    assert dataclasses.replace(found, a=None) == SEMI_IMPLICIT
    dropped = functools.partial(held, drop=0.01)
    assert tableau_of(dropped, small_rope).reason == "moves what the problem holds"


def test_a_state_that_is_a_tree():
    state = {"a": np.array(1.0), "b": np.arange(3.0)}
    problem = Problem(lambda t, y, args: {"a": -y["a"], "b": y["b"]}, state, np.arange(3.0))

    def euler(rhs, t, y, dt, args):
        return jax.tree.map(lambda y, k: y + dt * k, y, rhs(t, y, args))

    assert tableau_of(euler, problem).tableau == EXPLICIT["explicit-euler"]


def test_positions_and_velocities_apart_with_a_right_hand_side():
    def semi_implicit(rhs, t, y, dt, args):
        x, v = y
        v = v + dt * rhs(t, y, args)[1]
        return np.stack([x + dt * v, v])

    assert dataclasses.replace(tableau_of(semi_implicit).tableau, a=None) == SEMI_IMPLICIT


def moved(change):
    """Explicit Euler with something done to its result."""
    return lambda rhs, t, y, dt, args: change(euler_in_numpy(rhs, t, y, dt, args), y, t, dt)


def of_forces(change):
    """The new positions and velocities by what is done with the old ones and the acceleration."""
    return lambda acceleration, t, x, v, dt, args: change(x, v, acceleration(t, x, v, args), dt)


calls = []


def counting(new, y, t, dt):
    calls.append(t)
    return y + (1.0 + 1e-9 * len(calls)) * (new - y)


def adaptive(rhs, t, y, dt, args):
    k = rhs(t, y, args)
    return y + dt * k if np.max(np.abs(rhs(t + dt, y + dt * k, args) - k)) < 1.0 else y


def per_step(x, v, a, dt):
    x_new = x + (1 - 5e-5) * v * dt + dt**2 * a
    return x_new, (x_new - x) / dt


@pytest.mark.parametrize(
    ("step", "reason"),
    [
        (moved(lambda new, y, t, dt: new + (new - y) * (dt < 1e-5)), "depend on the step size"),
        (lambda rhs, t, y, dt, args: y + dt * rhs(round(t, 2), y, args), "depend on the time"),
        (moved(lambda new, y, t, dt: np.clip(new, -500, 500)), "large states"),
        (moved(lambda new, y, t, dt: new - 5e-5 * y), "multiplies the state by 0.99995"),
        (moved(lambda new, y, t, dt: new + 0.001), "not a sum"),
        (moved(lambda new, y, t, dt: new * np.nan), "not-a-number"),
        (adaptive, "small states"),
        (moved(lambda new, y, t, dt: y + np.float32(new - y)), "up to a relative error of"),
        (moved(counting), "hidden state"),
        (lambda rhs, t, y, dt, args: y - dt * 9.81, "asks for no slope"),
        (of_forces(per_step), "multiplies the velocities by 0.99995 in its result"),
        (of_forces(lambda x, v, a, dt: (x + dt / 2 * v, v + dt * a)), "on their way into the"),
        (of_forces(lambda x, v, a, dt: (x + dt * v, v + dt * a - x / dt)), "from positions"),
        (lambda rhs, t, y, dt, args: 1 / 0, "ZeroDivisionError"),
        ("constraint-verlet", "nodes in a row"),
        pytest.param("diffrax:ReversibleHeun", "carries memory", marks=SLOW),
        pytest.param("diffrax:Kvaerno3", "iterates", marks=SLOW),
    ],
)
def test_what_is_no_method_has_no_tableau(step, reason):
    found = tableau_of(step)
    assert found.tableau is None
    assert reason in found.reason


@pytest.mark.parametrize("first", [1, 12])
def test_memory_between_steps_is_noticed(first):
    assert tableau_of(AdamsBashforth(first)).reason == "carries memory"


# --- names


HEUN = EXPLICIT["Heun's method"]
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
    assert recognised(KNOWN[name]) == (name, KNOWN[name], (), ())
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
        (
            rk4(a43="1/2"),
            "y + 1/2 * dt * k3) in place of f(t + dt, y + dt * k3); its order is 1 in",
        ),
        (
            NystromTableau.of_tableau(rk4(a43="1/2")),
            "RK4 with k4 = f(t + dt, y + 1/2 * dt * k3) in",
        ),
        (rk4(b2="2/3", b3=0, a42=1, a43=0), "dt * k3), and with y_new = y + dt * (1/6 * k1 + 2/3"),
        (rk4(c2=0, c3=0, c4=0), "RK4 with all slopes taken at time t; its order is 1 in place of"),
        (changed(HEUN, b1=1, b2=0), "explicit-euler; its order is 1. k2, the slope at the new"),
        (Tableau.of([[], ["3/4"]], ["1/3", "2/3"]), "2 stages, none of the well-known ones; its"),
        (euler(q=(F(1, 4),)), "an explicit Nystrom method with 1 stage, none of the well-known"),
        (euler(q=(-ONE,), b=(-ONE,)), "dt**2 * k1, and with v_new = v - dt * k1 in place of"),
        (
            verlet(q=(ONE, ZERO), p=((ZERO, ZERO), (ONE, ZERO))),
            "k1 in place of x + dt * v + 1/2",
        ),
        (verlet(a=NONE), "velocity-verlet; its order is 1, and 2 where forces do not depend on"),
        (verlet(d=(ZERO, ZERO), p=NONE), "k2 = a(t + dt, x) in place of a(t + dt, x_new); its"),
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
    line = "y_new" if place.startswith("b") else f"k{i}"
    assert [each.split(" ")[0] for each in found.corrections] == [line] * (value != old)


def test_an_order_that_is_not_the_declared_one_is_said():
    assert describe(HEUN, declared=2) == "This is Heun's method; its order is 2."
    assert describe(HEUN, declared=4) == "This is Heun's method; its order is 2 (declared: 4)."
