"""Files of problems that are no ropes: a ball, a planet, a pendulum."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest
from trajectory_writing import finding, write_runs

from ropeode import Problem, grade, reference
from ropeode.problems import PROBLEMS


def falls(t, x, v, args):
    return jnp.zeros_like(x) + jnp.array([0.0, -9.81])


BALL = Problem.second_order(falls, [[0.0, 1.0]], [[3.0, 4.0]], np.linspace(0.0, 2.0, 9))
PROBLEM = {"ball": BALL, "planet": PROBLEMS["kepler"](4), "pendulum": PROBLEMS["pendulum"](4)}


@pytest.fixture(scope="module")
def known():
    return {name: reference(problem) for name, problem in PROBLEM.items()}


@pytest.mark.parametrize(
    ("stepper", "order", "velocities", "said"),
    [
        ("stormer-verlet", 2, False, "positions exact on this problem"),
        ("velocity-verlet", None, True, "velocities exact on this problem"),
        ("rk4", 4, True, "positions exact on this problem"),
        ("semi-implicit-euler", 1, True, "velocities exact on this problem"),
    ],
)
def test_what_is_exact_on_a_parabola_is_right(known, tmp_path, stepper, order, velocities, said):
    files = write_runs(tmp_path, BALL, stepper, (8, 16, 32), velocities=velocities)
    report = grade(files, known["ball"], expected_order=order)
    assert report.verdict == "right"
    assert said in finding(report).line


def test_what_is_too_precise_to_tell_its_order_is_not_called_exact(known, tmp_path):
    files = write_runs(tmp_path, PROBLEM["planet"], "dormand-prince8", (512, 640, 768))
    report = grade(files, known["planet"], expected_order=8)
    assert report.verdict == "undetermined"
    assert "errors are so small" in finding(report).line


@pytest.mark.parametrize("problem", PROBLEM)
def test_one_mass_is_in_no_reverse_order_and_not_still(known, tmp_path, problem):
    """Nor does a node that does not exist stand still."""
    steps, dim = (32, 64, 128), known[problem].problem.y0.shape[-1]
    files = write_runs(tmp_path, PROBLEM[problem], "stormer-verlet:start=rest", steps, dim=dim)
    report = grade(files, known[problem], expected_order=2)
    assert not {each.cause for each in report.diagnosis} & {"fixed-node", "columns"}
