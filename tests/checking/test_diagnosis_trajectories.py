"""Trajectories of other programs that solve another rope: which one is read off the files."""

import jax
import numpy as np
import pytest
from trajectory_writing import write_runs

from ropeode import Rope, grade, reference, simulate
from ropeode.checking import diagnose_trajectories
from ropeode.problems import PROBLEMS

STEPS = (64, 128, 256, 512)
slow = pytest.mark.slow


def files_of(folder, stepper, changes, **how):
    """Those of another rope than `small_rope`."""
    return write_runs(folder, Rope(**{"num_nodes": 4, **changes}).problem(3), stepper, STEPS, **how)


def numbers(**found):
    """What is found of parameters, to six digits or so."""
    return {name: pytest.approx(value, rel=1e-4, abs=1e-6) for name, value in found.items()}


PULLED = {"gravity": (0.3, -1.5), "damping": 0.1, "stiffness": 200.0}
# Stepper, what is changed, whether velocities are written, and words of the diagnosis.
OTHER_ROPES = [
    # One change would be found by computing the same numbers.
    (
        "semi-implicit-euler",
        {"damping": 0.0, "gravity": (0.0, -0.8)},
        True,
        "gravity (0, -0.8) instead of (0, -1) and damping 0 instead of 0.01",
    ),
    # Without velocities in the files these may be wrong from the start.
    ("stormer-verlet", {"initial_velocity": (1.0, 0.5)}, False, "velocity (1, 0.5)"),
    # Too large for steps of a fit that trust its slopes.
    pytest.param("stormer-verlet", PULLED, True, "stiffness 200 instead of 100", marks=slow),
]


@pytest.mark.parametrize(("stepper", "changes", "velocities", "words"), OTHER_ROPES)
def test_the_rope_that_was_solved_instead(tmp_path, known, stepper, changes, velocities, words):
    made = files_of(tmp_path, stepper, changes, velocities=velocities)
    report = grade(made, known)
    assert [each.check for each in report.failed] == ["order"]
    (diagnosis,) = report.diagnosis
    assert diagnosis.cause == "parameters"
    assert words in diagnosis.line
    found = {name: each["found"] for name, each in diagnosis.evidence["parameters"].items()}
    wanted = {name.removeprefix("initial_"): value for name, value in changes.items()}
    assert found == numbers(**wanted)
    order = diagnosis.evidence["orders"]["position"]["observed"]
    assert order == pytest.approx(1.0 if "euler" in stepper else 2.0, abs=0.1)


def test_damping_per_step(tmp_path, known):
    made = files_of(tmp_path, "stormer-verlet:damping=per-step", {})
    (diagnosis,) = grade(made, known, expected_order=1).diagnosis
    assert diagnosis.cause == "damping-per-step"
    (term,) = diagnosis.evidence["terms"]
    assert term["found"] == pytest.approx([0.99] * len(term["found"]), rel=1e-6)


@slow
def test_velocities_and_digits_may_be_missing():
    claimed = {"num_nodes": 4, "end": (90.0, 0.0), "gravity": (0.0, -0.7)}
    problem = Rope(**claimed).problem(3)
    other = Rope(**{**claimed, "damping": 0.0, "gravity": (0.0, -0.49)}).problem(3)
    known, both = reference(problem), problem.quantities
    exact = [(1 / n, simulate(other, "semi-implicit-euler", n).states) for n in STEPS]
    without, printed = ([(dt, states.copy()) for dt, states in exact] for _ in range(2))
    for _, states in without:
        states[:, 1] = np.nan
    for _, states in printed:
        states.flat = [float(f"{number:.7g}") for number in states.flat]
    dampings = []
    for given, quantities in ((exact, both), (without, ("position",)), (printed, both)):
        with jax.enable_x64(True):
            (diagnosis,) = diagnose_trajectories(problem, known, given, quantities)
        assert diagnosis.cause == "parameters"
        dampings.append(diagnosis.evidence["parameters"]["damping"])
        if given is not printed:
            words = "gravity (0, -0.49) instead of (0, -0.7) and damping 0 instead of 0.01"
            assert words in diagnosis.line
            order = diagnosis.evidence["orders"]["position"]["observed"]
            assert order == pytest.approx(1.0, abs=0.1)
    # Fewer digits give a larger spread.
    assert abs(dampings[2]["found"]) <= dampings[2]["spread"]
    assert dampings[0]["spread"] < dampings[2]["spread"] < 0.005


@slow
def test_another_mass_at_each_node_is_no_number(tmp_path, known):
    made = files_of(tmp_path, "stormer-verlet", {"node_mass": [1.0, 2.0, 0.5, 3.0]})
    assert [each.cause for each in grade(made, known).diagnosis] == ["unknown"]


def test_what_has_no_wrong_numbers(known):
    right = [(1 / n, simulate(known.problem, "semi-implicit-euler", n).states) for n in STEPS]
    for problem, given, words in (
        (known.problem, right, "tend to the right solution"),
        (known.problem, right[:2], "at least three step sizes"),
        (PROBLEMS["pendulum"](), [], "no parameters"),
    ):
        (diagnosis,) = diagnose_trajectories(problem, known, given, problem.quantities)
        assert diagnosis.cause == "unknown"
        assert words in diagnosis.line
