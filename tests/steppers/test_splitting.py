"""Compositions of drifts and kicks: their order conditions, and damping inside the kicks."""

from __future__ import annotations

import dataclasses
import itertools
import math
from fractions import Fraction

import numpy as np
import pytest

from ropeode import LinearDamping
from ropeode.errors import InputError
from ropeode.problems import PROBLEMS, Problem
from ropeode.simulation import simulate
from ropeode.steppers import STEPPERS, as_stepper

COMPOSITIONS = [STEPPERS[name] for name in ("ruth3", "yoshida4", "pefrl", "yoshida6")]


def product(one, other, longest):
    """Of two series in words of letters that do not commute."""
    found = {}
    for (left, a), (right, b) in itertools.product(one.items(), other.items()):
        if len(left) + len(right) <= longest:
            found[left + right] = found.get(left + right, 0) + a * b
    return found


def exponential(letter, size, longest):
    return {letter * n: Fraction(size) ** n / math.factorial(n) for n in range(longest + 1)}


def largest_defects(substeps, longest):
    """Of exp(c1 A) exp(d1 B) exp(c2 A) ... from exp(A + B), for words of 1, 2, ... letters.

    Computed without rounding, from the coefficients as they are stored.
    """
    series = {"": Fraction(1)}
    for size, letter in zip(np.ravel(substeps), itertools.cycle("AB"), strict=False):
        series = product(series, exponential(letter, float(size), longest), longest)
    return [
        max(
            float(abs(series.get("".join(word), 0) - Fraction(1, math.factorial(n))))
            for word in itertools.product("AB", repeat=n)
        )
        for n in range(1, longest + 1)
    ]


@pytest.mark.parametrize("stepper", COMPOSITIONS, ids=lambda stepper: stepper.name)
def test_order_conditions(stepper):
    """For flows of any two parts: no use is made of forces that depend on positions alone."""
    order = stepper.undamped_order
    *kept, missed = largest_defects(stepper.substeps, order + 1)
    # A rounding of coefficients, of which no one is above 2.
    assert max(kept) < 1e-15
    assert missed > 1e-3


def test_a_digit_less_is_noticed():
    wrong = [(round(drift, 12), round(kick, 12)) for drift, kick in STEPPERS["yoshida6"].substeps]
    assert max(largest_defects(wrong, 6)) > 1e-13


@pytest.mark.parametrize("stepper", COMPOSITIONS, ids=lambda stepper: stepper.name)
def test_those_that_are_symmetric(stepper):
    flat = np.trim_zeros(np.ravel(stepper.substeps))
    assert np.allclose(flat, flat[::-1], rtol=0, atol=1e-15) == (stepper.name != "ruth3")


EXACT = ["leapfrog", "leapfrog:form=drift-kick-drift", "leapfrog:form=staggered", "ruth3"]


@pytest.mark.parametrize("label", [*EXACT, "yoshida4", "pefrl", "yoshida6"])
def test_without_forces_damping_is_exact(label):
    """However long the step and strong the damping; and a constant force is left at its speed."""
    rate = np.array([[0.0], [1e-300], [1e-17], [1e-9], [1e-5], [0.5], [30.0]])

    def acceleration(t, x, v, args):
        return args["pull"] - args["rate"] * v

    for pull in (0.0, 2.0):
        problem = Problem.second_order(
            acceleration,
            np.zeros((7, 1)),
            np.array([[1.0], [-2.0], [0.3], [0.7], [1.1], [-0.9], [0.5]]),
            0.7 * np.arange(4),
            {"rate": rate, "pull": pull},
            damping=lambda args: LinearDamping(args["rate"], args["rate"]),
        )
        v0 = problem.velocities(problem.y0[None])[0]
        run = simulate(problem, label, 1)
        for t, v in zip(problem.ts, run.velocities, strict=True):
            # (1 - exp(-r t))/r, which is t where there is no damping.
            lasting = np.where(rate > 0, -np.expm1(-rate * t) / np.where(rate > 0, rate, 1), t)
            exact = np.exp(-rate * t) * v0 + pull * lasting
            # Substeps back in time lose digits: kicks of up to -1.7 dt multiply by exp(1.7 r dt).
            np.testing.assert_allclose(v, exact, rtol=1e-12, atol=1e-12)


def test_staggered_is_kick_drift_kick():
    problem = PROBLEMS["oscillator"](damping=0.7, stiffness=3.0, frames=5)
    one, other = (
        simulate(problem, f"leapfrog:form={form}", 7) for form in ("staggered", "kick-drift-kick")
    )
    np.testing.assert_allclose(one.states, other.states, rtol=0, atol=1e-13)


def test_staggered_velocities_need_steps_of_one_size():
    """Half a step before a frame is half a step of another size before the next one."""
    uneven = dataclasses.replace(
        PROBLEMS["oscillator"](frames=3), ts=np.array([0.0, 0.4, 1.6, 1.9])
    )
    with pytest.raises(InputError, match="staggered' given, a multistep method that needs one"):
        simulate(uneven, "leapfrog:form=staggered", 7)
    for form in ("kick-drift-kick", "drift-kick-drift"):
        assert simulate(uneven, f"leapfrog:form={form}", 7).status == "ok"


def test_forms_without_damping_are_the_verlet_methods():
    problem = PROBLEMS["oscillator"](damping=0.0, stiffness=3.0, frames=5)
    verlet = simulate(problem, "velocity-verlet", 7).states
    for form in ("staggered", "kick-drift-kick"):
        run = simulate(problem, f"leapfrog:form={form}", 7)
        np.testing.assert_allclose(run.states, verlet, rtol=0, atol=1e-13)
    drifts_first = simulate(problem, "leapfrog:form=drift-kick-drift", 7).states
    assert np.max(np.abs(drifts_first - verlet)) > 1e-3


@pytest.mark.parametrize(
    ("label", "evaluations"),
    [("leapfrog", 1), ("leapfrog:form=drift-kick-drift", 1), ("leapfrog:form=staggered", 1),
     ("ruth3", 3), ("yoshida4", 3), ("pefrl", 4), ("yoshida6", 7)],
)  # fmt: skip
def test_evaluations_in_a_step(label, evaluations):
    problem = PROBLEMS["oscillator"](frames=2)
    few, many = (simulate(problem, as_stepper(label), n).rhs_evaluations for n in (4, 10))
    assert (many - few) / (6 * problem.frames) == evaluations
