"""Runs that are too coarse, or in single precision: what decides nothing, and what does."""

from __future__ import annotations

import re

import jax
import numpy as np
import pytest
from trajectory_writing import node_values, write_npz

from ropeode import grade, reference
from ropeode.analysis import ROUND_OFF, observed_order
from ropeode.checking import Convergence, read_runs
from ropeode.checking.trajectories.coarse_steps import by_coarse_steps
from ropeode.problems import Rope
from ropeode.simulation import simulate

PRE_ASYMPTOTIC = (8, 12, 18, 27, 40, 60)


def rope(**changed):
    """Taut, and thrown: its springs swing."""
    given = {"num_nodes": 8, "start": (0.0, 0.0), "end": (-7.0, 1.75), "node_mass": 0.5}
    thrown = ((0.0, 0.0), *((1.0, -0.5),) * 7)
    rest = {"gravity": (0.0, -9.81), "stiffness": 200.0, "damping": 0.0, "initial_velocity": thrown}
    return Rope(**{**given, **rest, **changed}).problem(frames=2)


@pytest.fixture(scope="module")
def taut():
    return reference(rope())


def verdict(tmp_path, known, problem, stepper, steps, expected=None):
    made = [
        write_npz(tmp_path / f"{n}.npz", problem.ts, node_values(problem, run.states), run.dt)
        for n in steps
        for run in [simulate(problem, stepper, n)]
    ]
    report = grade(made, known, expected_order=expected, diagnose=False)
    return report.verdict, next(each.line for each in report.findings if each.check == "order")


def largest_eigenvalue(known):
    """Of the derivative of the right-hand side, along the motion."""
    problem, shape = known.problem, known.problem.y0.shape

    def flat(y):
        return problem.rhs(0.0, y.reshape(shape), problem.args).reshape(-1)

    with jax.enable_x64(True):
        matrices = [jax.jacfwd(flat)(state.reshape(-1)) for state in known.states]
    return max(np.max(np.abs(np.linalg.eigvals(each))) for each in matrices)


@pytest.mark.parametrize(
    "stepper", [pytest.param("implicit-euler", marks=pytest.mark.slow), "xpbd:iterations=4"]
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
    found, line = verdict(tmp_path, taut, rope(), "rk4", PRE_ASYMPTOTIC, 5)
    assert found == "undetermined", line
    found, line = verdict(tmp_path, taut, rope(), "velocity-verlet", (30, 40, 54, 72, 96), 4)
    assert found == "wrong", line


@pytest.mark.parametrize("changed", [{"gravity": (0.0, -9.0)}, {"node_mass": 0.6}])
@pytest.mark.parametrize("stepper", ["implicit-euler", "velocity-verlet"])
def test_another_equation_stays_wrong(tmp_path, taut, changed, stepper):
    steps = (60, 90, 135, 200, 300, 450)
    assert verdict(tmp_path, taut, rope(**changed), stepper, steps)[0] == "wrong"
    assert verdict(tmp_path, taut, rope(), stepper, steps)[0] != "wrong"


DTS = 0.02 / 1.5 ** np.arange(7)
# The largest possible round-off, which is as large as all but one of the errors.
ROUNDING = 2e-5 * DTS**-1.5


def in_single_precision(errors, rounding=ROUNDING, limits=None, claimed=None):
    """The order that `by_coarse_steps` finds in errors with so much round-off."""

    def observe(count, floor=0.0 * ROUNDING):
        order = observed_order(DTS[:count], errors[:count], claimed=claimed, rounding=floor[:count])
        orders = {"position": order}
        return Convergence(
            problem="made up",
            dts=tuple(DTS[:count]),
            errors={"position": tuple(errors[:count])},
            rounding={"position": tuple(floor)},
            resolution={"position": 0.0},
            orders=orders,
            expected=None,
            limits=limits or {},
        )

    return by_coarse_steps(observe, observe(len(DTS), 0.1 * rounding), 0.1).orders["position"]


def test_round_off_at_fine_steps_leaves_the_order_of_the_coarse_ones():
    errors = DTS + np.where(DTS < 0.003, 0.005 * ROUNDING, 0.0)
    order = in_single_precision(errors)
    assert order.verdict == "converges"
    assert order.observed == pytest.approx(1.0, abs=0.02)
    assert len(order.used) >= 4
    assert {point.reason for point in order.left_out} == {ROUND_OFF}
    off = {"position": (2e-3, 1e-3)}
    assert in_single_precision(errors, limits=off).verdict == "undetermined"


def test_what_round_off_cannot_explain_is_not_left_out():
    plateau = DTS + 2e-3
    assert in_single_precision(plateau).verdict == "undetermined"
    assert in_single_precision(plateau, 1e-9 * ROUNDING).verdict != "converges"
    # So much at the finest step leaves much at the others.
    assert in_single_precision(DTS + 0.05 * (DTS[-1] == DTS)).verdict == "undetermined"
    # Errors that fall all the way are bent for another reason.
    bent = np.where(DTS > 0.005, DTS**2 / 0.005, DTS)
    assert in_single_precision(bent, 5.0 * ROUNDING).verdict == "undetermined"


def test_three_steps_on_a_line_may_be_chance_where_round_off_is_as_large():
    errors = DTS**2 * np.array([1.0, 1.5, 1.0, 1.5, 1.0, 1.0, 1.0])
    assert observed_order(DTS, errors, claimed=2).verdict == "converges"
    assert in_single_precision(errors, 50.0 * ROUNDING, claimed=2).verdict == "undetermined"
    assert in_single_precision(errors, 1e-9 * ROUNDING, claimed=2).verdict == "converges"


def test_single_precision_shows_in_velocities_alone(tmp_path):
    """A program may add an origin in double precision to its positions."""
    problem = rope()
    values = node_values(problem, simulate(problem, "velocity-verlet", 60).states)
    values = values.astype(np.float32) + np.array([0.1, 0.1, 0.0, 0.0])
    write_npz(tmp_path / "60.npz", problem.ts, values, 1 / 60)
    (run,) = read_runs([tmp_path / "60.npz"], problem, fewest=1)
    assert run.single
