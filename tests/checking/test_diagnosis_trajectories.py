"""Trajectories of other programs: given runs, and no more of them."""

import jax
import numpy as np
import pytest

from ropeode import Rope, reference, simulate
from ropeode.checking import diagnose_trajectories
from ropeode.problems import PROBLEMS

FRAMES = 3
STEPS = (64, 128, 256, 512)
CLAIMED = {"num_nodes": 4, "end": (90.0, 0.0), "gravity": (0.0, -0.7), "damping": 0.01}


@pytest.fixture(scope="module", autouse=True)
def _float64():
    with jax.enable_x64(True):
        yield


@pytest.fixture(scope="module")
def known():
    problem = Rope(**CLAIMED).problem(FRAMES)
    return reference(problem)


def runs(stepper, digits=None, frames=FRAMES, **changes):
    """Runs of another rope than the claimed one, possibly printed and read again."""
    pairs = []
    for steps in STEPS:
        run = simulate(Rope(**{**CLAIMED, **changes}).problem(frames), stepper, steps)
        states = run.states
        if digits is not None:
            printed = [float(f"{value:.{digits}g}") for value in states.ravel()]
            states = np.array(printed).reshape(states.shape)
        pairs.append((run.dt, states))
    return pairs


def found(known, given, quantities=("position", "velocity")):
    (diagnosis,) = diagnose_trajectories(known.problem, known, given, quantities)
    return diagnosis


@pytest.mark.slow
def test_the_rope_that_was_solved_instead(known):
    given = runs("semi-implicit-euler", damping=0.0, gravity=(0.0, -0.49))
    without_velocities = [(dt, states.copy()) for dt, states in given]
    for _, states in without_velocities:
        states[:, 1] = np.nan
    both = ((given, known.problem.quantities), (without_velocities, ("position",)))
    for each, quantities in both:
        diagnosis = found(known, each, quantities)
        assert diagnosis.cause == "parameters"
        assert (
            "the rope with gravity (0, -0.49) instead of (0, -0.7) and damping 0 instead of 0.01"
            in diagnosis.line
        )
        assert diagnosis.evidence["orders"]["position"]["observed"] == pytest.approx(1.0, abs=0.1)


@pytest.mark.slow
def test_fewer_printed_digits_give_a_larger_spread(known):
    printed = runs("semi-implicit-euler", digits=7, damping=0.0, gravity=(0.0, -0.49))
    diagnosis = found(known, printed)
    damping = diagnosis.evidence["parameters"]["damping"]
    assert abs(damping["found"]) <= damping["spread"]
    assert damping["spread"] < 0.005
    exact = found(known, runs("semi-implicit-euler", damping=0.0, gravity=(0.0, -0.49)))
    assert exact.evidence["parameters"]["damping"]["spread"] < damping["spread"]


@pytest.mark.slow
def test_six_printed_digits_and_more_frames():
    known = reference(Rope(**CLAIMED).problem(6))
    printed = runs("semi-implicit-euler", digits=6, frames=6, damping=0.0, gravity=(0.0, -0.49))
    damping = found(known, printed).evidence["parameters"]["damping"]
    assert abs(damping["found"]) <= damping["spread"]
    assert 1e-7 < damping["spread"] < 0.005


@pytest.mark.slow
def test_large_changes_of_several_parameters(known):
    """Too large for steps of a fit that trust its slopes."""
    given = runs("stormer-verlet", stiffness=200.0, gravity=(0.3, -1.5), damping=0.1)
    diagnosis = found(known, given)
    assert diagnosis.cause == "parameters"
    numbers = diagnosis.evidence["parameters"]
    assert {name: number["found"] for name, number in numbers.items()} == {
        "gravity": pytest.approx([0.3, -1.5]),
        "damping": pytest.approx(0.1),
        "stiffness": pytest.approx(200.0),
    }


def test_wrong_initial_velocities(known):
    diagnosis = found(known, runs("stormer-verlet", initial_velocity=(1.0, 0.5)))
    assert diagnosis.evidence["parameters"]["velocity"]["found"] == pytest.approx([1.0, 0.5])


def test_damping_per_step(known):
    diagnosis = found(known, runs("stormer-verlet:damping=per-step"))
    assert diagnosis.cause == "damping-per-step"
    assert diagnosis.evidence["lost_per_step"] == pytest.approx(0.01, rel=0.1)


@pytest.mark.parametrize("stepper", ["stormer-verlet", "semi-implicit-euler"])
def test_right_runs_have_no_wrong_numbers(known, stepper):
    diagnosis = found(known, runs(stepper))
    assert diagnosis.cause == "unknown"
    assert "tend to the right solution" in diagnosis.line


@pytest.mark.slow
def test_another_mass_at_each_node_is_no_number(known):
    diagnosis = found(known, runs("stormer-verlet", node_mass=[1.0, 2.0, 0.5, 3.0]))
    assert diagnosis.cause == "unknown"


def test_two_runs_say_nothing(known):
    diagnosis = found(known, runs("stormer-verlet", damping=0.0)[:2])
    assert diagnosis.cause == "unknown"
    assert "at least three step sizes" in diagnosis.line


def test_what_is_no_rope_has_no_such_numbers(known):
    problem = PROBLEMS["pendulum"]()
    (diagnosis,) = diagnose_trajectories(problem, known, [], problem.quantities)
    assert diagnosis.cause == "unknown"
    assert "no parameters" in diagnosis.line
