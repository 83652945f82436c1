"""Compositions of drifts and kicks: their order conditions, and damping inside the kicks."""

from __future__ import annotations

import itertools
import math
from fractions import Fraction

import numpy as np
import pytest

from ropeode import LinearDamping
from ropeode.problems import Problem
from ropeode.simulation import simulate
from ropeode.steppers import STEPPERS

COMPOSITIONS = [STEPPERS[name] for name in ("ruth3", "yoshida4", "pefrl", "yoshida6")]


def largest_defects(substeps, longest):
    """Of exp(c1 A) exp(d1 B) exp(c2 A) ... from exp(A + B), for words of 1, 2, ... letters.

    A and B do not commute. Computed without rounding, from the coefficients as they are stored.
    """
    words = ["".join(w) for n in range(longest + 1) for w in itertools.product("AB", repeat=n)]
    series = {word: Fraction(not word) for word in words}
    for size, letter in zip(np.ravel(substeps), itertools.cycle("AB"), strict=False):
        factor = [Fraction(float(size)) ** n / math.factorial(n) for n in range(longest + 1)]
        # What ends in n of this letter, begins with any word.
        series = {
            word: sum(series[word[: len(word) - n]] * factor[n] for n in ending(word, letter))
            for word in words
        }
    return [
        max(float(abs(series[w] - Fraction(1, math.factorial(n)))) for w in words if len(w) == n)
        for n in range(1, longest + 1)
    ]


def ending(word, letter):
    """How many of a word's last letters may be taken from powers of one letter."""
    return range(len(word) - len(word.rstrip(letter)) + 1)


@pytest.mark.parametrize("stepper", COMPOSITIONS, ids=lambda stepper: stepper.name)
def test_order_conditions(stepper):
    """For flows of any two parts: no use is made of forces that depend on positions alone."""
    order = stepper.undamped_order
    *kept, missed = largest_defects(stepper.substeps, order + 1)
    # A rounding of coefficients, of which no one is above 2.
    assert max(kept) < 1e-15
    assert missed > 1e-3
    flat = np.trim_zeros(np.ravel(stepper.substeps))
    assert np.allclose(flat, flat[::-1], rtol=0, atol=1e-15) == (stepper.name != "ruth3")


FORMS = ("leapfrog", "leapfrog:form=drift-kick-drift", "leapfrog:form=staggered")


@pytest.mark.parametrize("label", [*FORMS, *(stepper.name for stepper in COMPOSITIONS)])
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
