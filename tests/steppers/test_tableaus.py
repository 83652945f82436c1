"""Coefficients of tableaus and of compositions meet their order conditions; tableaus in files."""

from __future__ import annotations

import itertools
import math
import warnings
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from ropeode import LinearDamping
from ropeode.errors import InputError, InputWarning
from ropeode.problems import Problem
from ropeode.simulation import simulate
from ropeode.steppers import STEPPERS, ProblemClass, RungeKutta, as_stepper
from ropeode.sweep import SweepSpec, evaluate

EXAMPLE = Path(__file__).parents[2] / "docs/examples/heun3.toml"
METHODS = [cls for cls in STEPPERS.values() if issubclass(cls, RungeKutta)]


@pytest.mark.parametrize("cls", METHODS)
def test_conditions_are_met_to_the_last_digits(cls):
    """Those of order 6 and less, which is fast; and no more than is declared."""
    tableau, order = cls.tableau, cls.tableau_order
    assert tableau.explicit
    assert tableau.keeps_time

    def worst(order):
        return max(abs(float(each.weight - each.exact)) for each in tableau.errors(order))

    for each in range(1, min(order, 6) + 1):
        assert worst(each) < 4e-15
    assert order > 5 or worst(order + 1) > 1e-5


@pytest.mark.slow
def test_the_order_conditions_say_what_is_declared():
    """All of them, without rounding; of files that is asked in each test below."""
    for cls in METHODS:
        assert cls.tableau.order == cls.tableau_order


# ---- tableaus in files


def written(folder: Path, text: str) -> str:
    (folder / "own.toml").write_text(text)
    return "runge-kutta:own.toml"


def by_hand(a2, a3, b):
    """Three stages, each of which reads the one before it."""

    def step(rhs, t, y, dt, args):
        k1 = rhs(t, y, args)
        k2 = rhs(t + a2 * dt, y + a2 * dt * k1, args)
        k3 = rhs(t + a3 * dt, y + a3 * dt * k2, args)
        return y + dt * (b[0] * k1 + b[1] * k2 + b[2] * k3)

    return step


# Their common denominator is no whole number of float64.
HALF, QUARTER = Fraction(2**39, 2**40 + 1), Fraction(2**38, 2**40 - 1)
LARGE = [HALF, QUARTER, 1 - HALF - QUARTER]


OF_LARGE = f"A = [[], [1], [0, 1]]\nb = {[*map(str, LARGE)]}\nc = [0, 1, 1]"


@pytest.mark.parametrize(
    ("text", "method", "order", "per_step"),
    [
        (EXAMPLE.read_text(), (1 / 3, 2 / 3, (1 / 4, 0, 3 / 4)), 3, 3),
        (OF_LARGE, (1, 1, [*map(float, LARGE)]), 1, 3),
        # A stage that nobody reads is left out.
        ('A = [[], ["1/2"], [1, 1]]\nb = [0, 1, 0]\nc = [0, 0.5, 2]', (1 / 2, 1, (0, 1, 0)), 2, 2),
    ],
)
def test_a_file_is_its_formula(tmp_path, text, method, order, per_step):
    stepper = as_stepper(written(tmp_path, text), folder=tmp_path)
    assert stepper.order(ProblemClass()) == order
    problem = Problem(lambda t, y, args: -y * y * t, [0.7], [0.0, 1.0, 2.0])
    run, expected = (simulate(problem, each, 7) for each in (stepper, by_hand(*method)))
    np.testing.assert_allclose(run.states, expected.states, rtol=1e-14)
    assert run.rhs_evaluations == 2 * 7 * per_step


THIRD_ORDER = (
    "order: 3 given; allowed: at most 2; of the conditions for order 3 one is "
    "Σ b_i a_ij c_j = 1/6, and here it is 0."
)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("A = [[]]\nb = [1]\nd = 1", "'d' given, which does not exist; allowed: A, b, c, name"),
        ("A = [[], [1]]\nb = [1]", "A: '2 rows' given; allowed: 1 rows"),
        ("A = [[], [1, 2, 3]]\nb = [0, 1]", "A[2]: '3 entries' given; allowed: 1 of them, or 2"),
        ("A = [[], [1]]\nb = [0, 1]\nc = [0]", "c: '1 times' given; allowed: 2 times"),
        ('A = [["1/2"]]\nb = [1]', "A[1][1]: '1/2' given; allowed: 0 there, in explicit methods"),
        ('A = [[]]\nb = ["1/0"]', "b[1]: '1/0' given; allowed: finite numbers"),
        ('A = [[]]\nb = [1]\nname = "two\\nlines"', "allowed: a line of text that is not the name"),
        ('A = [[]]\nb = [1]\norder = "2"', "order: 2 given; allowed: at most 1"),
        ("A = [[], [1]]\nb = [0.5, 0.5]\norder = 3", THIRD_ORDER),
        ("A = [[]", "a TOML file"),
        (None, "No such file"),
    ],
)
def test_faults_are_one_line_each(tmp_path, text, words):
    if text is not None:
        written(tmp_path, text)
    with pytest.raises(InputError) as caught:
        as_stepper("runge-kutta:own.toml", folder=tmp_path)
    (line,) = caught.value.problems
    assert all(part in line for part in ("own.toml", words, "Fix: "))
    assert "\n" not in line


@pytest.mark.parametrize(
    ("text", "words", "order"),
    [
        # A byte order mark is no part of the text.
        ('\ufeffA = [[], [1]]\nb = ["1/2", "2/3"]', "add up to 7/6, not to 1; its order is 0", 0),
        # Shown with all its digits.
        ("A = [[], [1]]\nb = [0.3333333333, 0.6666666666]", "weights b add up to 0.9999999999,", 0),
        ("A = [[], [1]]\nb = [0.5, 0.5]\nc = [0, 0.25]", r"c\[2\] is 0.25, and row 2 of A", 1),
        # An order that is the same without time is said once.
        ('A = [[]]\nb = [1]\nc = ["1/2"]', r"row 1 of A adds up to 0; its order is 1\.$", 1),
    ],
)
def test_warnings(tmp_path, text, words, order):
    with pytest.warns(InputWarning, match=words):
        stepper = as_stepper(written(tmp_path, text), folder=tmp_path)
    assert stepper.order(ProblemClass()) == order


def test_a_command_warns_in_one_line(tmp_path, run):
    written(tmp_path, "A = [[]]\nb = [2]")
    with warnings.catch_warnings():
        warnings.simplefilter("always", InputWarning)
        done = run("steppers", f"runge-kutta:{tmp_path}/own.toml")
    (warned,) = done.stderr.splitlines()
    assert warned.startswith("ropeode: warning: ")
    assert "add up to 2, not to 1" in warned


def test_sweeps_follow_the_file(tmp_path):
    text = written(tmp_path, "A = [[], [1]]\nb = [0.5, 0.5]")
    values = {"steppers": [text], "grid": {"damping": [0.1]}}
    before = SweepSpec(values, tmp_path)
    written(tmp_path, 'A = [[], ["2/3"]]\nb = [0.25, 0.75]')
    assert SweepSpec(values, tmp_path).values["stepper_files"] != before.values["stepper_files"]
    with pytest.raises(InputError, match="unchanged since the sweep was started"):
        evaluate(next(before.tasks()), tmp_path)
    assert as_stepper(text, folder=tmp_path).tableau.a[1][0] == Fraction(2, 3)


# --- compositions of drifts and kicks, and damping inside the kicks


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
