"""The runs that are advised show an order when they are added: that is carried out here."""

from __future__ import annotations

import re

import pytest
from trajectory_writing import finding, write_runs

from ropeode import grade, reference
from ropeode.problems import PROBLEMS, InextensibleRope, Rope
from tests.exact_reference import rope_reference


def written(folder, problem, stepper, steps, **how):
    """Files with positions only."""
    return write_runs(folder, problem, stepper, steps, ".csv", velocities=False, **how)


def advised(line):
    """The steps per frame of the runs to add."""
    words = re.search(r"add a? ?runs? with ([\d, and]+)|$", line)[1]
    return [int(n) for n in re.findall(r"\d+", words or "")]


def carried_out(folder, known, stepper, steps, *, digits="%.17g", **claims):
    """The line that advises, and the order that is shown with the runs that it advises."""
    made = written(folder, known.problem, stepper, steps, digits=digits)
    report = grade(made, known, diagnose=False, **claims)
    assert report.verdict == "undetermined"
    line = finding(report).line
    if "write 17 digits" in line:
        made = written(folder, known.problem, stepper, steps)
    made += written(folder, known.problem, stepper, advised(line))
    after = finding(grade(made, known, diagnose=False, **claims))
    assert after.status == "pass"
    (order,) = after.convergence.orders.values()
    assert order.verdict == "converges"
    return line, order


COARSE = (8, 16, 24)
ADVICE = [
    # Unstable: it is of no use to halve the finest step.
    ("explicit-euler", COARSE, {}, "agree with those of explicit-euler; add runs with"),
    ("explicit-euler", COARSE, {}, "before that of order 1.07 [0.88, 1."),
    # Unstable runs do not tell that digits are missing, but finer ones would.
    ("explicit-euler", COARSE, {"digits": "%.6g"}, "write 17 digits, and add runs with"),
    # Too coarse for the power law.
    ("rk4", (8, 12, 16), {}, "agree with those of rk4; add "),
    # Too fine for the reference, and so for a difference between steppers.
    pytest.param(
        *("rk4", (2048, 4096, 8192), {"expected_order": 4}, "velocity-verlet and rk4; add runs"),
        marks=pytest.mark.slow,
    ),
    # So fine that errors grow again.
    ("stormer-verlet", (4096, 8192, 16384), {"expected_order": 2}, "add runs with 16, 32 and 64 "),
    # With all digits these are enough.
    ("velocity-verlet", (16, 24, 32, 48), {"digits": "%.5g"}, "have 5 digits; write 17 digits"),
]


@pytest.mark.parametrize(("stepper", "steps", "claims", "words"), ADVICE)
def test_the_runs_that_are_advised_suffice(tmp_path, known, stepper, steps, claims, words):
    line, order = carried_out(tmp_path, known, stepper, steps, **claims)
    assert words in line
    if shows := re.search(r"it shows order ([\d.]+)", line):
        assert order.observed == pytest.approx(float(shows[1]), abs=0.006)


@pytest.mark.slow
def test_a_program_that_is_none_of_the_steppers(tmp_path, known):
    """There is nothing with which further runs could be tried out, and the words say so."""
    made = written(tmp_path, known.problem, "diffrax:Tsit5", COARSE)
    line = finding(grade(made, known, diagnose=False)).line
    assert "agree with" not in line
    assert line.endswith("add runs with 48 and 96 steps per frame to begin with")


@pytest.mark.slow
def test_two_steppers_that_are_the_same_here(tmp_path):
    """From rest and without damping, as both names say."""
    known = rope_reference(Rope(num_nodes=4, damping=0.0).problem(frames=3))
    line, _ = carried_out(tmp_path, known, "stormer-verlet:start=rest", (4, 5, 10))
    assert "agree with those of semi-implicit-euler and stormer-verlet:start=rest; add" in line
    assert "with which they show order 1.0" in line


OTHERS = {
    "rigid": (lambda: InextensibleRope(num_nodes=6).problem(5), "constraint-verlet:start=rest"),
    "kepler": (lambda: PROBLEMS["kepler"](frames=3), "velocity-verlet"),
    "pleiades": (lambda: PROBLEMS["pleiades"](frames=2), "rk4"),
    "long": (lambda: Rope(damping=0.0).problem(20), "explicit-euler"),
}


@pytest.mark.slow
@pytest.mark.parametrize("steps", [(2, 3, 4), (64, 128, 256)])
@pytest.mark.parametrize("name", OTHERS)
def test_other_problems(tmp_path, name, steps):
    problem, stepper = OTHERS[name]
    known = reference(problem())
    made = written(tmp_path, known.problem, stepper, steps)
    if grade(made, known, diagnose=False).verdict != "right":
        carried_out(tmp_path, known, stepper, steps)
