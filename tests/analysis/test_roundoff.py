"""The round-off estimate against round-off that is known."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from ropeode import InextensibleRope, Problem, Rope
from ropeode.analysis import in_other_units, round_off
from ropeode.norms import distance, norm_for
from ropeode.problems import PROBLEMS
from ropeode.simulation import simulate
from ropeode.steppers import StormerVerlet
from tests.problems.shorter import SHORTER
from tests.steppers.every_variant import UNSTABLE, slow_if

SLOW = pytest.mark.slow


def also_slow(stepper):
    """What has one state and what has two positions; the others are measured in no other unit."""
    return stepper.label not in ("rk4", "stormer-verlet")


# Of every kind of number that has a unit.
MOVING = {
    "start": (0, 200, 0), "end": (-400, 200, 0), "gravity": (0, -1, 0), "num_nodes": 5,
    "node_mass": (1, 2, 0.5, 1, 1), "damping": 0.2, "initial_velocity": (0, -1, 0.5),
}  # fmt: skip


def measured(problem, stepper, steps):
    """The estimate, at the last sample."""
    run = simulate(problem, stepper, steps)
    return round_off(run, in_other_units(problem), len(problem.ts), [norm_for(problem)])[0]


@pytest.mark.parametrize("stepper", slow_if(also_slow))
def test_other_units_change_nothing_but_rounding(stepper):
    if stepper.label in UNSTABLE:
        pytest.skip("makes rounding as large as the rope")
    assert 0 < measured(Rope(**MOVING).problem(frames=3), stepper, 400) < 1e-8


@pytest.mark.parametrize(
    "label", ["constraint-verlet", *(pytest.param(each, marks=SLOW) for each in ("rattle", "rk4"))]
)
def test_links_are_measured_in_the_other_unit_as_well(label):
    # A length or an acceleration left in the old unit would change the motion by 19 %.
    assert 0 < measured(InextensibleRope(**MOVING).problem(frames=3), label, 400) < 1e-8


@pytest.mark.parametrize("name", ["Radau", pytest.param("RK45", marks=SLOW)])
def test_solvers_of_scipy_run_in_other_units(name):
    assert 0 <= measured(PROBLEMS["forced"](frames=2), f"scipy:{name}", 8) < 1e-9


# The ropes are above. These have velocities and driving forces, and neither.
FEW = ("forced", "lorenz")


@pytest.mark.parametrize(
    "name", [each if each in FEW else pytest.param(each, marks=SLOW) for each in PROBLEMS]
)
def test_every_problem_can_be_put_in_other_units(name):
    problem = PROBLEMS[name](**SHORTER.get(name, {}))
    assert measured(problem, "rk4", 20) < 1e-9 * problem.scale


def decay(t, y, args):
    return -y / 3.0


@pytest.mark.parametrize("steps", [2000, 30000])
def test_against_a_run_without_round_off(steps):
    # y' = -y/3 by explicit Euler is (1 - dt/3)^n y0, known to all digits.
    problem = Problem(decay, [1.0, 0.37], [0.0, 1.0, 2.0])
    run = simulate(problem, "explicit-euler", steps)
    n = steps * np.arange(3, dtype=np.longdouble)[:, None]
    exact = np.exp(n * np.log1p(-np.longdouble(1) / 3 / steps)) * problem.y0
    true = float(np.max(np.abs(run.states - exact)))
    found = measured(problem, "explicit-euler", steps)
    assert true < 30 * found
    assert found < 100 * true


@dataclasses.dataclass(frozen=True)
class Ungrouped(StormerVerlet):
    """Lagged damping, summed from left to right: dt^2 a is rounded to a unit of x itself."""

    def step(self, system, t, x, dt):
        a = system.undamped_acceleration(t, x.now)
        moved = x.now - x.before
        ahead = x.now + (1 - system.damping.rate * dt) * moved + dt**2 * a
        return x._replace(now=ahead, before=x.now)


def test_errors_that_repeat_from_step_to_step_are_seen():
    # Noise that is added to the steps does not show these: they do not average out.
    problem = Rope(num_nodes=6).problem(frames=20)
    norm, rescaled = norm_for(problem), in_other_units(problem)
    steppers = "stormer-verlet:damping=lagged", Ungrouped()
    grouped, ungrouped = (simulate(problem, each, 16384) for each in steppers)
    apart = float(np.max(distance(problem, norm, grouped.states, ungrouped.states)))
    assert apart > 5e-6
    assert apart < 30 * round_off(ungrouped, rescaled, 21, [norm])[0]
    assert round_off(grouped, rescaled, 21, [norm])[0] < apart / 5
