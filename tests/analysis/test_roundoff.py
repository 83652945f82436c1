"""The round-off estimate against round-off that is known."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest

from ropeode import InextensibleRope, Problem, Rope, reference
from ropeode.analysis import in_other_units, round_off
from ropeode.norms import distance, norm_for
from ropeode.precision import in_float64
from ropeode.problems import PROBLEMS, ROPES
from ropeode.simulation import simulate
from ropeode.steppers import StormerVerlet, as_stepper
from tests.problems.shorter import SHORTER
from tests.steppers.every_variant import UNSTABLE, slow_if

LAGGED = "stormer-verlet:damping=lagged"


def also_slow(stepper):
    """What has one state and what has two positions; the others are measured in no other unit."""
    return stepper.label not in ("rk4", "stormer-verlet")


@pytest.mark.parametrize("stepper", slow_if(also_slow))
def test_other_units_change_nothing_but_rounding(stepper):
    if stepper.label in UNSTABLE:
        pytest.skip("makes rounding as large as the rope")
    problem = Rope(
        start=(0, 200, 0), end=(-400, 200, 0), gravity=(0, -1, 0), num_nodes=5,
        node_mass=(1, 2, 0.5, 1, 1), damping=0.2, initial_velocity=(1, -1, 0.5),
    ).problem(frames=3)  # fmt: skip
    run = simulate(problem, stepper, 400)
    found = round_off(run, in_other_units(problem), 4, [norm_for(problem)])[0]
    assert 0 < found < 1e-8


@pytest.mark.parametrize(
    "label",
    [
        "constraint-verlet",
        *(pytest.param(each, marks=pytest.mark.slow) for each in ("rattle", "rk4")),
    ],
)
def test_links_are_measured_in_the_other_unit_as_well(label):
    # A length or an acceleration left in the old unit would change the motion by 19 %.
    problem = InextensibleRope(
        start=(0, 200, 0), end=(-400, 200, 0), gravity=(0, -1, 0), num_nodes=5,
        node_mass=(1, 2, 0.5, 1, 1), damping=0.2, initial_velocity=(0, -1, 0.5),
    ).problem(frames=3)  # fmt: skip
    run = simulate(problem, label, 400)
    found = round_off(run, in_other_units(problem), 4, [norm_for(problem)])[0]
    assert 0 < found < 1e-8


@pytest.mark.parametrize("name", ROPES)
def test_links_in_other_units(name):
    problem = PROBLEMS[name](num_nodes=4, node_mass=(1, 2, 0.5, 1), damping=0.2)
    rescaled = in_other_units(problem)
    one, other = (in_float64(p.mechanics.links)(p.args) for p in (problem, rescaled))
    ratio = rescaled.y0[0, 0, -1] / problem.y0[0, 0, -1]
    for scaled in ("length", "acceleration"):
        np.testing.assert_allclose(getattr(other, scaled), ratio * getattr(one, scaled), rtol=1e-15)
    np.testing.assert_array_equal(other.inverse_mass, one.inverse_mass)
    np.testing.assert_array_equal(other.damping.rate, one.damping.rate)
    np.testing.assert_array_equal(other.damping.coefficient, one.damping.coefficient)


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        # An explicit method for each shape of state, and an implicit one.
        pytest.param(
            *pair,
            marks=() if pair in (("rope", "RK45"), ("forced", "Radau")) else pytest.mark.slow,
        )
        for pair in itertools.product(("rope", "forced"), ("DOP853", "RK23", "RK45", "Radau"))
    ],
)
def test_solvers_of_scipy_run_in_other_units(name, kind):
    problem = PROBLEMS[kind](frames=2, **({"num_nodes": 4} if kind == "rope" else {}))
    run = simulate(problem, f"scipy:{name}", 8)
    found = round_off(run, in_other_units(problem), 3, [norm_for(problem)])[0]
    assert 0 <= found < 1e-9


# The ropes are above. These have velocities and driving forces, and neither.
FEW = ("forced", "lorenz")


@pytest.mark.parametrize(
    "name",
    [each if each in FEW else pytest.param(each, marks=pytest.mark.slow) for each in PROBLEMS],
)
def test_every_problem_can_be_put_in_other_units(name):
    problem = PROBLEMS[name](**SHORTER.get(name, {}))
    run = simulate(problem, "rk4", 20)
    found = round_off(run, in_other_units(problem), len(problem.ts), [norm_for(problem)])[0]
    assert found < 1e-9 * problem.scale


def decay(t, y, args):
    return -y / 3.0


@pytest.mark.parametrize("steps", [2000, 5000, 30000])
def test_against_a_run_without_round_off(steps):
    # y' = -y/3 by explicit Euler is (1 - dt/3)^n y0, known to all digits.
    problem = Problem(decay, [1.0, 0.37], [0.0, 1.0, 2.0])
    run = simulate(problem, "explicit-euler", steps)
    n = steps * np.arange(3, dtype=np.longdouble)[:, None]
    exact = np.exp(n * np.log1p(-np.longdouble(1) / 3 / steps)) * problem.y0
    true = float(np.max(np.abs(run.states - exact)))
    found = round_off(run, in_other_units(problem), 3, [norm_for(problem)])[0]
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
    problem = Rope().problem(frames=20)
    grouped, ungrouped = (
        simulate(problem, stepper, 16384) for stepper in (as_stepper(LAGGED), Ungrouped())
    )
    norm = norm_for(problem)
    rescaled = in_other_units(problem)
    apart = float(np.max(distance(problem, norm, grouped.states, ungrouped.states)))
    assert apart > 5e-6
    assert apart < 30 * round_off(ungrouped, rescaled, 21, [norm])[0]
    assert round_off(grouped, rescaled, 21, [norm])[0] < apart / 5


@pytest.mark.slow
@pytest.mark.parametrize("label", ["stormer-verlet", LAGGED, "velocity-verlet"])
def test_excess_over_the_order_is_explained(label):
    problem = Rope().problem(frames=20)
    norm = norm_for(problem)
    known = reference(problem)
    order = 1 if label == LAGGED else 2
    error, noise = {}, {}
    for steps in (256, 512, 8192):
        run = simulate(problem, label, steps)
        error[steps] = distance(problem, norm, run.states, known.states)[-1]
        noise[steps] = round_off(run, in_other_units(problem), 21, [norm])[0]
    constant, bend = np.linalg.solve(
        [[256.0**-order, 256.0 ** -(order + 1)], [512.0**-order, 512.0 ** -(order + 1)]],
        [error[256], error[512]],
    )
    expected = constant * 8192.0**-order + bend * 8192.0 ** -(order + 1)
    assert abs(error[8192] - expected) < 30 * noise[8192] + 1e-3 * expected
