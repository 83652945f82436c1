"""The runs that are advised show an order when they are added: that is carried out here."""

from __future__ import annotations

import re

import pytest
from trajectory_writing import node_values, write_csv

from ropeode import grade, reference
from ropeode.problems import PROBLEMS, InextensibleRope, Rope
from ropeode.simulation import simulate


def heun(f, t, y, dt, args):
    """Of order 2; none of ropeode's steppers."""
    k = f(t, y, args)
    return y + dt / 2 * (k + f(t + dt, y + dt * k, args))


def written(folder, problem, stepper, steps, **how):
    """Files of a stepper; positions only."""
    paths = []
    for n in steps:
        run = simulate(problem, stepper, n)
        values = node_values(problem, run.states, velocities=False)
        paths.append(write_csv(folder / f"{n}.csv", run.times, values, run.dt, **how))
    return paths


def order_of(made, known, **claims):
    report = grade(made, known, diagnose=False, **claims)
    return report, next(each for each in report.findings if each.check == "order")


def advised(line):
    """The steps per frame of the runs to add."""
    return [
        int(n) for n in re.findall(r"\d+", re.search(r"add a? ?runs? with ([\d, and]+)", line)[1])
    ]


def carried_out(folder, known, stepper, steps, *, digits="%.17g", **claims):
    """The line that advises, after its runs were added, and these; they show an order."""
    made = written(folder, known.problem, stepper, steps, digits=digits)
    report, found = order_of(made, known, **claims)
    assert report.verdict == "undetermined"
    add = advised(found.line)
    if "write 17 digits" in found.line:
        made = written(folder, known.problem, stepper, steps)
    report, after = order_of(
        [*made, *written(folder, known.problem, stepper, add)], known, **claims
    )
    assert after.status == ("fail" if "method" in claims else "pass")
    (order,) = after.convergence.orders.values()
    assert order.verdict == "converges"
    return found.line, add, order


@pytest.mark.parametrize(
    ("stepper", "steps", "claims", "words"),
    [
        # Unstable: it is of no use to halve the finest step.
        ("explicit-euler", (8, 16, 24), {}, "agree with those of explicit-euler; add runs with"),
        # The claim is wrong.
        ("explicit-euler", (8, 16, 24), {"method": "velocity-verlet"}, "it shows order 1."),
        # Too coarse for the power law.
        ("rk4", (8, 12, 16), {"expected_order": 4}, "agree with those of rk4; add "),
        # Too fine for the reference, and so for a difference between steppers.
        (
            "rk4",
            (2048, 4096, 8192),
            {"expected_order": 4},
            "velocity-verlet and rk4; add runs",
        ),
        pytest.param(
            heun,
            (4, 6, 8),
            {"expected_order": 2},
            "agree with those of heun; add",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_the_runs_that_are_advised_suffice(tmp_path, known, stepper, steps, claims, words):
    line, _, order = carried_out(tmp_path, known, stepper, steps, **claims)
    assert words in line
    if shows := re.search(r"it shows order ([\d.]+)", line):
        assert order.observed == pytest.approx(float(shows[1]), abs=0.006)


@pytest.mark.slow
def test_a_program_that_is_none_of_the_steppers(tmp_path, known):
    """There is nothing with which further runs could be tried out, and the words say so."""
    made = written(tmp_path, known.problem, "diffrax:Tsit5", (8, 16, 24))
    line = order_of(made, known)[1].line
    assert "agree with" not in line
    assert line.endswith("add runs with 48 and 96 steps per frame to begin with")


def test_files_with_few_digits(tmp_path, known):
    """Unstable runs do not tell that digits are missing, but finer ones would."""
    line, _, _ = carried_out(tmp_path, known, "explicit-euler", (8, 16, 24), digits="%.6g")
    assert "write 17 digits, and add runs with" in line


def test_two_steppers_that_are_the_same_here(tmp_path):
    """From rest and without damping, as both names say."""
    known = reference(Rope(num_nodes=4, damping=0.0).problem(frames=3))
    line, _, _ = carried_out(tmp_path, known, "stormer-verlet:start=rest", (4, 5, 10))
    assert "agree with those of semi-implicit-euler and stormer-verlet:start=rest; add" in line
    assert "with which they show order 1.0" in line


OTHERS = {
    "rigid": (lambda: InextensibleRope(num_nodes=6).problem(5), "constraint-verlet:start=rest"),
    "kepler": (lambda: PROBLEMS["kepler"](frames=3), "velocity-verlet"),
    "pleiades": (lambda: PROBLEMS["pleiades"](frames=2), "rk4"),
    "long": (lambda: Rope(damping=0.0).problem(20), "explicit-euler"),
}


@pytest.mark.slow
@pytest.mark.parametrize("steps", [(2, 3, 4), (8, 16, 24), (64, 128, 256)])
@pytest.mark.parametrize("name", OTHERS)
def test_other_problems(tmp_path, name, steps):
    problem, stepper = OTHERS[name]
    known = reference(problem())
    if order_of(written(tmp_path, known.problem, stepper, steps), known)[0].verdict != "right":
        carried_out(tmp_path, known, stepper, steps)
