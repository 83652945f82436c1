"""Programs with one mistake, as people hand them in, are named from a few coarse files."""

from __future__ import annotations

import pytest
from trajectory_writing import finding
from written_programs import (
    Program,
    explicit,
    frozen,
    kick_drift_kick,
    kutta3,
    midpoint,
    on_a_floor,
    rk4,
    semi_implicit,
    slowed_down,
    speed,
)

from ropeode import InextensibleRope, Rope, grade
from tests.exact_reference import rope_reference

FRAMES = 4


SPRINGS = {"num_nodes": 5, "end": (-100.0, 150.0), "stiffness": 90.0}
MOVING = Rope(
    **SPRINGS,
    node_mass=(1.0, 2.0, 0.5, 1.5, 3.0),
    damping=0.2,
    initial_velocity=(3.0, -1.0),
)
RESTING = Rope(**SPRINGS, damping=0.0)
RIGID = InextensibleRope(num_nodes=5, end=(-100.0, 150.0), damping=0.0)


@pytest.fixture(scope="module")
def known():
    return {
        name: rope_reference(rope.problem(FRAMES))
        for name, rope in (("moving", MOVING), ("resting", RESTING), ("rigid", RIGID))
    }


BY_TAYLOR = {"method": "verlet", "starts": "taylor"}
# The rope, what the program does, the cause, and a part of the words.
MISTAKES = [
    ("resting", {"method": "verlet", "kept": 1 - 5e-5}, "damping-per-step", "keeps 0.99995 of"),
    ("moving", {"kept": 0.999}, "damping-per-step", "keeps 0.999 of"),
    ("rigid", {"method": "verlet", "kept": 0.9995}, "damping-per-step", "keeps 0.9995 of"),
    ("rigid", {"method": "verlet", "gravity": 9.8}, "parameters", "gravity is 9.8 times"),
    ("moving", {"method": midpoint, "gravity": -1.0}, "parameters", "the wrong sign"),
    ("moving", {"gravity_times_dt": True}, "step-size", "gravity is multiplied by dt once more"),
    ("moving", {"push": True}, "parameters", "the spring force has the wrong sign"),
    ("moving", {"one_sided": True}, "parameters", "the node behind them is left out"),
    ("moving", {"damping": 0.0}, "parameters", "the damping is left out"),
    ("moving", {"damping": -1.0}, "parameters", "the damping has the wrong sign"),
    ("resting", {"dashpot": -0.3}, "parameters", "along each spring, of coefficient -0.3"),
    ("moving", {"drag_per_spring": 0.05}, "parameters", "two nodes, of coefficient 0.05"),
    ("moving", {"forces": 0.5}, "parameters", "the mass is counted twice"),
    ("moving", {"adds_up": True}, "forces-add-up", "never set to zero"),
    ("resting", {"rested": (4,)}, "fixed-node", "node 4 never moves"),
    ("moving", {"rested": (4,)}, "fixed-node", "node 4 moves on with its initial velocity"),
    ("moving", {"method": "verlet", "starts": "rest"}, "start", "initial velocity is forgotten"),
    ("moving", {"method": explicit}, "method", "are those of explicit Euler"),
    ("moving", {"masses_that_divide": 0}, "parameters", "the mass is left out"),
    ("moving", {"masses_of_gravity": 1}, "parameters", "and is multiplied by the mass"),
    ("moving", {"drag_times": lambda v, mass: mass}, "parameters", "is not divided by the mass"),
    ("moving", {"drag_times": speed}, "parameters", "grows with the square of the speed"),
    ("moving", {"spring_times": lambda length, _: length}, "parameters", "no unit vector"),
    ("moving", {"spring_times": lambda _, stretch: stretch > 0}, "parameters", "is shorter than"),
    ("moving", {**BY_TAYLOR, "kept": 0.999}, "damping-per-step", "keeps 0.999 of"),
    ("moving", {"method": midpoint, "afterwards": on_a_floor}, "departure", "node 4 departs"),
    ("moving", {"method": rk4, "afterwards": slowed_down}, "departure", "is never above 4,"),
    ("moving", {"method": frozen}, "method", "takes the acceleration of the start for both"),
    # Two at once, of which none is a number, and one in the method.
    (
        "moving",
        {"masses_that_divide": 0, "drag_times": speed},
        "parameters",
        "the mass is left out: forces are not divided by it; and the damping grows with the square",
    ),
]
# Two at once, of which the search takes longer.
SEARCHED = [
    ("moving", {"gravity": 9.8, "damping": 0.0}, "parameters", "; and the damping is left out"),
    ("moving", {"method": frozen, "gravity": -1.0}, "parameters", "With this change, velocity V"),
]


@pytest.mark.parametrize(
    ("rope", "change", "cause", "words"),
    [*MISTAKES, *(pytest.param(*each, marks=pytest.mark.slow) for each in SEARCHED)],
)
def test_the_one_mistake_is_named(known, tmp_path, rope, change, cause, words):
    program = Program(known[rope].problem, **change)
    files = program.files(tmp_path, columns=2 if program.method == "verlet" else 4)
    report = grade(files, known[rope], expected_order=2)
    assert report.verdict == "wrong"
    (diagnosis,) = report.diagnosis
    assert diagnosis.cause == cause
    assert words in diagnosis.line
    assert diagnosis.evidence.get("misfit", 0.0) < 1e-8


@pytest.mark.slow
def test_a_fit_of_a_rope_that_nearly_blows_up_ends(tmp_path):
    """Of the changes that are tried, some have slopes whose squares overflow."""
    long = rope_reference(InextensibleRope().problem(4))
    program = Program(long.problem, method="verlet", kept=1 - 5e-5)
    report = grade(program.files(tmp_path, (128, 256, 512, 1024)), long, expected_order=1)
    assert report.diagnosis[0].cause == "damping-per-step"


def test_an_order_that_damping_lowers_may_be_claimed_apart(known, tmp_path):
    files = Program(known["moving"].problem, method=kick_drift_kick).files(tmp_path, (64, 128, 256))
    assert grade(files, known["moving"], expected_order=2, diagnose=False).verdict == "wrong"
    assert grade(files, known["moving"], expected_order=2, damped_order=1).passed


def test_rounded_steps_added_up_make_a_step_too_many(known, tmp_path):
    program = Program(known["moving"].problem, counts_by_time=True)
    report = grade(program.files(tmp_path, (10, 20, 50)), known["moving"], expected_order=1)
    assert report.diagnosis[0].cause == "extra-step"
    assert "at dt = 0.1 there is a step too many in frame 1" in report.diagnosis[0].line


def test_a_node_that_never_moves_hides_no_other_mistake(known, tmp_path):
    program = Program(known["resting"].problem, rested=(4,), gravity=2.0)
    (diagnosis,) = grade(program.files(tmp_path), known["resting"], expected_order=2).diagnosis
    assert diagnosis.cause == "fixed-node"
    assert "not pinned; and gravity is counted twice" in diagnosis.line


@pytest.mark.parametrize(
    ("change", "digits"),
    [
        ({}, "%.17g"),
        ({}, "%.9g"),
        pytest.param({"method": midpoint}, "%.17g", marks=pytest.mark.slow),
        ({"method": "verlet"}, "%.17g"),
    ],
)
def test_a_right_program_is_called_by_its_method(known, tmp_path, change, digits):
    """A claim that it does not keep is all that is wrong."""
    program = Program(known["moving"].problem, **change)
    files = program.files(tmp_path, (128, 256, 512), digits=digits)
    report = grade(files, known["moving"], expected_order=4)
    assert [each.cause for each in report.diagnosis] == ["method"]


@pytest.mark.parametrize(
    ("method", "verdict"),
    [pytest.param(explicit, "wrong", marks=pytest.mark.slow), (semi_implicit, "right")],
)
def test_another_method_of_the_order_that_is_claimed_is_told_apart(
    known, tmp_path, method, verdict
):
    files = Program(known["moving"].problem, method=method).files(tmp_path, (512, 1024, 2048))
    report = grade(files, known["moving"], method="semi-implicit-euler")
    assert report.verdict == verdict
    fixes = [each.remedy for each in report.diagnosis]
    right = "for semi-implicit Euler: v_new = v + dt * a; x_new = x + dt * v_new"
    assert fixes == ([right] if method is explicit else [])


@pytest.mark.slow
def test_a_treatment_of_damping_that_is_right_in_the_limit_is_no_mistake(tmp_path):
    damped = rope_reference(Rope(**SPRINGS, damping=0.003).problem(FRAMES))
    program = Program(damped.problem, damping=0.0, exact_damping=True)
    (diagnosis,) = grade(program.files(tmp_path), damped, expected_order=2).diagnosis
    assert diagnosis.cause not in ("parameters", "step-size", "damping-per-step")


@pytest.mark.slow
def test_a_damping_that_is_missing_is_no_tiny_one(tmp_path):
    """What is left of it in the numbers is rounding."""
    damped = rope_reference(Rope(**SPRINGS, damping=0.01).problem(FRAMES))
    files = Program(damped.problem, damping=0.0).files(tmp_path, (64, 128, 256))
    (diagnosis,) = grade(files, damped, expected_order=2).diagnosis
    assert "the damping is left out" in diagnosis.line


# The errors of the second three grow as dt falls.
@pytest.mark.slow
@pytest.mark.parametrize("steps", [(32, 64, 128), (64, 96, 128)])
def test_lengths_in_single_precision_refute_nothing(tmp_path, steps):
    long = rope_reference(Rope(num_nodes=5, end=(-8e4, 150.0), stiffness=90.0).problem(FRAMES))
    program = Program(long.problem, method=midpoint, single_length=True)
    report = grade(program.files(tmp_path, steps), long, expected_order=2)
    assert report.verdict != "wrong"
    assert "single precision" in finding(report).line


@pytest.mark.parametrize("digits", ["%.6g", pytest.param("%.7g", marks=pytest.mark.slow)])
def test_few_digits_are_no_mistake(known, tmp_path, digits):
    program = Program(known["moving"].problem, method=midpoint)
    report = grade(program.files(tmp_path, digits=digits), known["moving"], expected_order=2)
    assert "single precision" not in finding(report).line
    assert not report.diagnosis


OTHER_TERMS = {
    "gravity is counted twice and there is a damping along each spring, of coefficient 0.3": {
        "gravity": 2.0,
        "dashpot": 0.3,
    },
    "a damping along each spring, of coefficient -0.01 (± 0.002)": {"dashpot": -0.01},
    "a damping of each spring's two nodes, of coefficient 0.05": {"drag_per_spring": 0.05},
    "the pull of springs on the node behind them is left out": {"one_sided": True},
    "the mass is 0.1001% too large": {"forces": 0.999},
}


@pytest.mark.slow
@pytest.mark.parametrize("words", OTHER_TERMS)
def test_terms_of_a_method_that_is_not_known_are_named(known, tmp_path, words):
    """Its runs tend to a limit, to which the terms are fitted."""
    program = Program(known["moving"].problem, method=kutta3, **OTHER_TERMS[words])
    files = program.files(tmp_path, (32, 48, 64, 96))
    (diagnosis,) = grade(files, known["moving"], expected_order=3).diagnosis
    assert diagnosis.cause == "parameters"
    assert words in diagnosis.line
