"""Runs that are too coarse, or in single precision: what decides nothing, and what does."""

from __future__ import annotations

import re

import jax
import numpy as np
import pytest
from trajectory_writing import finding, node_values, write_npz, write_runs

from ropeode import grade
from ropeode.checking import read_runs
from ropeode.problems import Rope
from ropeode.simulation import simulate
from tests.exact_reference import rope_reference

PRE_ASYMPTOTIC = (8, 12, 18, 27, 40, 60)


def rope(**changed):
    """Taut, and thrown: its springs swing. Nobody asks whether its links are rigid."""
    thrown = ((0.0, 0.0), *((1.0, -0.5),) * 7)
    given = {
        "num_nodes": 8, "start": (0.0, 0.0), "end": (-7.0, 1.75), "initial_velocity": thrown,
        "node_mass": 0.5, "stiffness": 200.0, "damping": 0.0, "gravity": (0.0, -9.81),
    }  # fmt: skip
    return Rope(**{**given, **changed}).problem(frames=2).changed(parameters={})


@pytest.fixture(scope="module")
def taut():
    return rope_reference(rope())


def verdict(folder, known, problem, stepper, steps, expected=None):
    made = write_runs(folder, problem, stepper, steps)
    report = grade(made, known, expected_order=expected, diagnose=False)
    return report.verdict, finding(report).line


def largest_eigenvalue(known):
    """Of the derivative of the right-hand side, along the motion."""
    problem, shape = known.problem, known.problem.y0.shape

    def flat(y):
        return problem.rhs(0.0, y.reshape(shape), problem.args).reshape(-1)

    with jax.enable_x64(True):
        matrices = jax.jit(jax.vmap(jax.jacfwd(flat)))(known.states.reshape(len(known.states), -1))
    return np.max(np.abs(np.linalg.eigvals(matrices)))


@pytest.mark.parametrize(
    "stepper", ["implicit-euler", pytest.param("xpbd:iterations=4", marks=pytest.mark.slow)]
)
def test_right_methods_with_steps_that_are_too_coarse(tmp_path, taut, stepper):
    """They damp the springs' oscillations, and for a while tend to a motion without these."""
    found, line = verdict(tmp_path, taut, rope(), stepper, PRE_ASYMPTOTIC)
    assert found == "undetermined"
    said = re.search(r"too coarse to tell: the fastest part .* changes at a rate of ([\d.]+)", line)
    assert float(said[1]) == pytest.approx(largest_eigenvalue(taut), rel=0.1)
    assert "three runs with dt <= 0.01 would resolve the first frame" in line
    assert "; add runs with" in line or "; the positions agree with" in line
    # Nor does a slope below 1 refute order 1.
    assert verdict(tmp_path, taut, rope(), stepper, (4, 6, 8), 1)[0] == "undetermined"


def test_a_lower_whole_order_is_wrong_at_any_step_size(tmp_path, taut):
    # Too coarse for an order, but the steps are those of a method of order 4.
    found, line = verdict(tmp_path, taut, rope(), "rk4", PRE_ASYMPTOTIC, 5)
    assert (found, "RK4" in line) == ("wrong", True), line
    found, line = verdict(tmp_path, taut, rope(), "velocity-verlet", (30, 40, 54, 72, 96), 4)
    assert found == "wrong", line


@pytest.mark.parametrize(
    ("stepper", "changed"),
    [
        pytest.param("implicit-euler", {"gravity": (0.0, -9.0)}, marks=pytest.mark.slow),
        ("velocity-verlet", {"node_mass": 0.6}),
    ],
)
def test_another_equation_stays_wrong(tmp_path, taut, changed, stepper):
    steps = (60, 90, 135, 200, 300, 450)
    assert verdict(tmp_path, taut, rope(**changed), stepper, steps)[0] == "wrong"


def test_single_precision_shows_in_velocities_alone(tmp_path):
    """A program may add an origin in double precision to its positions."""
    problem = rope()
    values = node_values(problem, simulate(problem, "velocity-verlet", 60).states)
    values = values.astype(np.float32) + np.array([0.1, 0.1, 0.0, 0.0])
    write_npz(tmp_path / "60.npz", problem.ts, values, 1 / 60)
    (run,) = read_runs([tmp_path / "60.npz"], problem, fewest=1)
    assert run.single
