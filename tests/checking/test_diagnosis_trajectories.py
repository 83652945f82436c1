"""Trajectories of other programs that solve another rope: which one is read off the files."""

import dataclasses

import numpy as np
import pytest
from trajectory_writing import write_runs

from ropeode import Rope, grade, simulate
from ropeode.checking import diagnose_trajectories
from ropeode.problems import PROBLEMS
from tests.exact_reference import rope_reference

STEPS = (64, 128, 256, 512)
slow = pytest.mark.slow


def files_of(folder, stepper, changes, steps=STEPS, **how):
    """Those of another rope than `small_rope`."""
    return write_runs(folder, Rope(**{"num_nodes": 4, **changes}).problem(3), stepper, steps, **how)


PULLED = {"gravity": (0.3, -1.5), "stiffness": 200.0}
PRINTED = {"suffix": ".csv", "digits": "%.7g"}
# Stepper, what is changed, how it is written, and words of the diagnosis.
OTHER_ROPES = [
    # Without velocities in the files these may be wrong from the start.
    (
        "stormer-verlet",
        {"initial_velocity": (1.0, 0.5)},
        {"velocities": False, "steps": (32, 64, 128, 256)},
        "initial velocity along x, of coefficient 1 and there is an additional initial velocity "
        "along y, of coefficient 0.5",
    ),
    # Too large for steps of a fit that trust its slopes.
    ("stormer-verlet", PULLED, {}, "the spring force is counted twice"),
    # What is found is simple as far as the digits allow it.
    (
        "semi-implicit-euler",
        {"damping": 0.0, "gravity": (0.0, -0.7)},
        PRINTED,
        "gravity is 30% too small and the damping is left out",
    ),
]


# The fast tests of test_programs.py have wrong parameters too.
@slow
@pytest.mark.parametrize(("stepper", "changes", "how", "words"), OTHER_ROPES)
def test_the_rope_that_was_solved_instead(tmp_path, known, stepper, changes, how, words):
    report = grade(files_of(tmp_path, stepper, changes, **how), known)
    assert [each.check for each in report.failed] == ["order"]
    (diagnosis,) = report.diagnosis
    assert diagnosis.cause == "parameters"
    assert words in diagnosis.line
    order = None if how is PRINTED else 1 if "euler" in stepper else 2
    assert order in (None, diagnosis.evidence["orders"]["position"])


@slow
def test_another_mass_at_each_node_is_no_number(tmp_path, known):
    made = files_of(tmp_path, "stormer-verlet", {"node_mass": [1.0, 2.0, 0.5, 3.0]})
    assert [each.cause for each in grade(made, known).diagnosis] == ["unknown"]


@slow
@pytest.mark.parametrize("seed", range(4))
def test_numbers_are_right_to_their_spread(seed):
    """Changes drawn at random, of one to three parameters, of a rope in space that moves."""
    draw = np.random.default_rng(seed)
    velocity = draw.normal(size=(5, 3))
    velocity[1] = 0.0
    problem = Rope(
        num_nodes=5, start=(0.0, 0.0, 0.0), end=(3.0, 1.0, 0.5), node_mass=1.3, stiffness=3.7,
        damping=0.45, gravity=(0.3, -0.8, 0.2), pinned=(1,), initial_velocity=velocity,
    ).problem(3).changed(parameters={})  # fmt: skip
    terms = {
        "damping": "the damping",
        "stiffness": "the spring force",
        "rest_length": "the rest length",
        "gravity": "gravity",
    }
    names = draw.choice([*terms], draw.integers(1, 4), replace=False)
    factors = {name: draw.uniform(0.5, 1.6) for name in names}
    changed = {name: factor * getattr(problem.args, name) for name, factor in factors.items()}
    other = problem.changed(args=problem.args._replace(**changed))
    runs = [(1 / n, simulate(other, "rk4", n).states) for n in (24, 36, 48, 72, 96)]
    found = diagnose_trajectories(rope_reference(problem), runs, problem.quantities)
    # Damping and stiffness together have the same effect as a mass and one of them.
    right = {terms[name]: factor for name, factor in factors.items()}
    each = [found.evidence["terms"], *found.evidence["alternatives"]]
    (fitted,) = (some for some in each if {term["term"] for term in some} == {*right})
    for term in fitted:
        assert abs(term["found"] - right[term["term"]]) <= term["spread"] < 3e-3


def test_what_has_no_wrong_numbers(known):
    right = [(1 / n, simulate(known.problem, "semi-implicit-euler", n).states) for n in STEPS]
    rope = known.problem
    driven = rope.changed(rhs=lambda t, y, args: rope.rhs(t, y, args) + 1e-6)
    for problem, given, words in (
        (known.problem, right, "tend to the right solution"),
        (known.problem, right[:2], "at least three step sizes"),
        (PROBLEMS["pendulum"](), [], "no parameters"),
        # Not the forces of a rope alone, whatever its numbers say.
        (driven, right, "no parameters"),
    ):
        other = dataclasses.replace(known, problem=problem)
        diagnosis = diagnose_trajectories(other, given, problem.quantities)
        assert diagnosis.cause == "unknown"
        assert words in diagnosis.line
