"""Tableaus: those of the steppers meet their order conditions; those in files are checked."""

from __future__ import annotations

import warnings
from fractions import Fraction
from pathlib import Path

import kauri
import numpy as np
import pytest

from ropeode import simulate
from ropeode.errors import InputError, InputWarning
from ropeode.problems import Problem
from ropeode.steppers import STEPPERS, ProblemClass, RungeKutta, as_stepper
from ropeode.sweep import SweepSpec, evaluate

EXAMPLE = Path(__file__).parents[2] / "docs/examples/heun3.toml"
METHODS = {name: cls for name, cls in STEPPERS.items() if issubclass(cls, RungeKutta)}
HIGH = pytest.mark.slow


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=HIGH if cls.tableau_order > 5 else [])
        for name, cls in METHODS.items()
    ],
)
def test_declared_order_is_that_of_the_order_conditions(name):
    tableau = METHODS[name].tableau
    assert tableau.explicit
    assert tableau.keeps_time
    assert tableau.order == METHODS[name].tableau_order


@pytest.mark.parametrize("name", METHODS)
def test_conditions_are_met_to_the_last_digits(name):
    """By kauri's trees, in floating-point numbers: up to order 6, which is fast."""
    tableau = METHODS[name].tableau
    a, b = np.array(tableau.a, float), np.array(tableau.b, float)

    def stages(tree):
        *branches, _ = tree
        weights = np.ones(len(b))
        for branch in branches:
            weights = weights * (a @ stages(branch))
        return weights

    for order in range(1, min(METHODS[name].tableau_order, 6) + 1):
        for tree in kauri.trees_of_order(order):
            assert b @ stages(tree.list_repr) == pytest.approx(1 / tree.factorial(), abs=4e-15)


# ---- tableaus in files


def written(folder: Path, text: str, name: str = "own.toml") -> str:
    (folder / name).write_text(text)
    return f"runge-kutta:{name}"


def test_the_example_is_a_stepper_of_order_3():
    stepper = as_stepper("runge-kutta:heun3.toml", folder=EXAMPLE.parent)
    assert (stepper.label, stepper.order(ProblemClass())) == ("heun3", 3)
    problem = Problem(lambda t, y, args: -y * y * t, [0.7], [0.0, 1.0, 2.0])

    def by_hand(rhs, t, y, dt, args):
        k1 = rhs(t, y, args)
        k2 = rhs(t + dt / 3, y + dt / 3 * k1, args)
        k3 = rhs(t + 2 * dt / 3, y + 2 * dt / 3 * k2, args)
        return y + dt / 4 * (k1 + 3 * k3)

    run, expected = simulate(problem, stepper, 7), simulate(problem, by_hand, 7)
    np.testing.assert_allclose(run.states, expected.states, rtol=1e-14)
    assert run.rhs_evaluations == 2 * 7 * 3


def test_stages_that_nobody_reads_are_left_out(tmp_path):
    text = written(tmp_path, 'A = [[], ["1/2"], [1, 1]]\nb = [0, 1, 0]\nc = [0, 0.5, 2]')
    problem = Problem(lambda t, y, args: -y, [0.7], [0.0, 1.0])
    run = simulate(problem, as_stepper(text, folder=tmp_path), 4)
    assert run.rhs_evaluations == 8
    assert np.array_equal(run.states, simulate(problem, "midpoint", 4).states)


def test_large_denominators_lose_no_digits(tmp_path):
    """Their common denominator is no whole number of float64."""
    half, quarter = Fraction(2**39, 2**40 + 1), Fraction(2**38, 2**40 - 1)
    rest = 1 - half - quarter
    text = written(
        tmp_path, f'A = [[], [1], [0, 1]]\nb = ["{half}", "{quarter}", "{rest}"]\nc = [0, 1, 1]'
    )
    problem = Problem(lambda t, y, args: t - y, [0.7], [0.0, 1.0])

    def by_hand(rhs, t, y, dt, args):
        k1 = rhs(t, y, args)
        k2 = rhs(t + dt, y + dt * k1, args)
        k3 = rhs(t + dt, y + dt * k2, args)
        return y + dt * (float(half) * k1 + float(quarter) * k2 + float(rest) * k3)

    run = simulate(problem, as_stepper(text, folder=tmp_path), 1)
    expected = simulate(problem, by_hand, 1)
    np.testing.assert_allclose(run.states, expected.states, rtol=1e-15)


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
        ("A = [[0, 1], [1, 0]]\nb = [0, 1]", "implicit tableaus are not taken"),
        ('A = [[]]\nb = ["1/0"]', "b[1]: '1/0' given; allowed: finite numbers"),
        ("A = [[]]\nb = [nan]", "b[1]: nan given; allowed: finite numbers"),
        ('A = [[]]\nb = ["1e400"]', "b[1]: '1e400' given; allowed: finite numbers"),
        ('A = [[]]\nb = [1]\nname = "leapfrog:form=staggered"', "name: 'leapfrog:form=staggered'"),
        ('A = [[]]\nb = [1]\nname = "two\\nlines"', "allowed: a line of text that is not the name"),
        ('A = [[]]\nb = [1]\norder = "2"', "order: 2 given; allowed: at most 1"),
        ("A = [[], [1]]\nb = [0.5, 0.5]\norder = 3", THIRD_ORDER),
        ("A = [[]", "a TOML file"),
    ],
)
def test_faults_are_one_line_each(tmp_path, text, words):
    with pytest.raises(InputError) as caught:
        as_stepper(written(tmp_path, text), folder=tmp_path)
    (line,) = caught.value.problems
    assert "own.toml" in line
    assert words in line
    assert "Fix: " in line
    assert "\n" not in line


def test_a_byte_order_mark_is_no_part_of_the_text(tmp_path):
    text = written(tmp_path, "\ufeffA = [[]]\nb = [1]")
    assert as_stepper(text, folder=tmp_path).order(ProblemClass()) == 1


def test_a_file_is_needed(tmp_path):
    for text in ("runge-kutta", "runge-kutta:", "runge-kutta:own.py"):
        with pytest.raises(InputError, match="allowed: runge-kutta:FILE.toml"):
            as_stepper(text)
    with pytest.raises(InputError, match="No such file"):
        as_stepper("runge-kutta:none.toml", folder=tmp_path)


@pytest.mark.parametrize(
    ("text", "words", "order"),
    [
        (
            'A = [[], [1]]\nb = ["1/2", "2/3"]',
            "weights b add up to 7/6, not to 1; its order is 0",
            0,
        ),
        # Shown with all its digits.
        (
            "A = [[], [1]]\nb = [0.3333333333, 0.6666666666]",
            "weights b add up to 0.9999999999, not to 1",
            0,
        ),
        # An order that is the same without time is said once.
        ('A = [[]]\nb = [1]\nc = ["1/2"]', r"row 1 of A adds up to 0; its order is 1\.$", 1),
    ],
)
def test_warnings(tmp_path, text, words, order):
    with pytest.warns(InputWarning, match=words):
        stepper = as_stepper(written(tmp_path, text), folder=tmp_path)
    assert stepper.order(ProblemClass()) == order


def test_times_that_are_not_row_sums(tmp_path):
    text = written(tmp_path, "A = [[], [1]]\nb = [0.5, 0.5]\nc = [0, 0.25]")
    with pytest.warns(
        InputWarning, match=r"c\[2\] is 0.25, and row 2 of A adds up to 1; its order"
    ):
        stepper = as_stepper(text, folder=tmp_path)
    # Measured on a right-hand side of time alone.
    problem = Problem(lambda t, y, args: np.cos(3.0) * t + 0 * y, [0.0], [0.0, 1.0])
    exact = np.cos(3.0) / 2
    errors = [simulate(problem, stepper, n).states[-1, 0] - exact for n in (10, 30)]
    assert stepper.order(ProblemClass()) == 1
    assert errors[0] / errors[1] == pytest.approx(3, rel=1e-6)


def test_a_command_warns_in_one_line(tmp_path, run):
    written(tmp_path, "A = [[]]\nb = [2]")
    with warnings.catch_warnings():
        warnings.simplefilter("always", InputWarning)
        done = run("steppers", f"runge-kutta:{tmp_path}/own.toml")
    assert done.returncode == 0, done.stderr
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
    again = as_stepper(text, folder=tmp_path)
    assert again.tableau.a[1][0] == Fraction(2, 3)
