"""Why a stepper's order is too low, found by experiment and not by chance."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ropeode.checking.check_context import Examination
from ropeode.checking.diagnosis.stepper import diagnose_stepper
from ropeode.checking.report import Claims


@pytest.fixture(scope="module", autouse=True)
def _float64():
    with jax.enable_x64(True):
        yield


slow = pytest.mark.slow


@functools.cache
def diagnosed(step, order):
    return diagnose_stepper(Examination(step, Claims(order)))


def causes(step, order):
    return [each.cause for each in diagnosed(step, order)]


def forces(x, v, args):
    """Accelerations in NumPy, of springs and gravity and damping."""
    d = np.diff(x, axis=0)
    length = np.sqrt(np.sum(d * d, axis=1))
    pull = (args.stiffness * (1.0 - args.rest_length / length))[:, None] * d
    force = args.mass[:, None] * args.gravity - args.damping[:, None] * v
    force[:-1] += pull
    force[1:] -= pull
    return force / args.mass[:, None] * args.free[:, None]


def heun(rhs, t, y, dt, args):
    k = rhs(t, y, args)
    return y + dt / 2 * (k + rhs(t + dt, y + dt * k, args))


def stages_at_the_start(rhs, t, y, dt, args):
    k1 = rhs(t, y, args)
    k2 = rhs(t, y + dt / 2 * k1, args)
    k3 = rhs(t, y + dt / 2 * k2, args)
    k4 = rhs(t, y + dt * k3, args)
    return y + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def wrong_stage(rhs, t, y, dt, args):
    """One coefficient of RK4 is 1/3 in place of 1/2: right equations, but order 1."""
    k1 = rhs(t, y, args)
    k2 = rhs(t + dt / 2, y + dt / 3 * k1, args)
    k3 = rhs(t + dt / 2, y + dt / 2 * k2, args)
    k4 = rhs(t + dt, y + dt * k3, args)
    return y + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def weights_of_11_tenths(rhs, t, y, dt, args):
    """Weights whose sum is not 1: the clock of the rope runs fast."""
    k = rhs(t, y, args)
    return y + 0.55 * dt * (k + rhs(t + dt, y + dt * k, args))


def time_stands_still(rhs, t, y, dt, args):
    return y + dt * rhs(0.0, y, args)


def wrong_drift(acceleration, t, x, v, dt, args):
    """Positions run ahead of velocities."""
    v = v + dt * acceleration(t, x, v, args)
    return x + 1.05 * dt * v, v


def verlet_with_old_damping(acceleration, t, x, v, dt, args):
    a = acceleration(t, x, v, args)
    x = x + dt * v + dt**2 / 2 * a
    return x, v + dt / 2 * (a + acceleration(t + dt, x, v, args))


def one_ended(acceleration, t, x, v, dt, args):
    """Each spring pulls at its first node only."""
    d = x[1:] - x[:-1]
    length = jnp.sqrt(jnp.sum(d * d, axis=1))
    pull = (args.stiffness * (1.0 - args.rest_length / length))[:, None] * d
    force = args.mass[:, None] * args.gravity - args.damping[:, None] * v
    force = (force + jnp.concatenate([pull, jnp.zeros((1, 3))])) / args.mass[:, None]
    v = v + dt * args.free[:, None] * force
    return x + dt * v, v


def damping_on_each_step(acceleration, t, x, v, dt, args):
    """Takes a hundredth of the velocity at each step, whatever the problem's damping is."""
    still = args._replace(damping=jnp.zeros_like(args.damping))
    v = 0.99 * (v + dt * acceleration(t, x, v, still))
    return x + dt * v, v


def node_by_node(acceleration, t, x, v, dt, args):
    """Midpoint positions are overwritten while neighbours' forces still need the old ones.

    Of the first three nodes, for the others: what is compiled is smaller than with each in turn.
    """
    first = jnp.arange(len(x))[:, None] < 3
    middle = v + dt / 2 * acceleration(t, x, v, args)
    half = x + dt / 2 * v
    a = acceleration(t + dt / 2, half, middle, args)
    half = jnp.where(first, x + dt * middle, half)
    a = jnp.where(first, a, acceleration(t + dt / 2, half, middle, args))
    return x + dt * middle, v + dt * a


def in_single(acceleration, t, x, v, dt, args):
    x, v = x.astype(np.float32), v.astype(np.float32)
    v = v + np.float32(dt) * forces(x, v, args).astype(np.float32)
    return (x + np.float32(dt) * v).astype(np.float64), v.astype(np.float64)


def in_decimals(acceleration, t, x, v, dt, args):
    """Rounded, but to decimals, which is another mistake than float32."""
    v = np.round(v + dt * forces(x, v, args), 7)
    return np.round(x + dt * v, 7), v


@pytest.mark.parametrize(
    ("step", "order", "expected"),
    [
        ("stormer-verlet:start=rest", 2, ["parameters", "start"]),
        ("stormer-verlet:damping=lagged", 2, ["lagged-damping"]),
        pytest.param(
            "stormer-verlet:start=rest,damping=lagged",
            2,
            ["parameters", "start", "lagged-damping"],
            marks=slow,
        ),
        pytest.param("stormer-verlet:damping=per-step", 2, ["damping-per-step"], marks=slow),
        pytest.param(verlet_with_old_damping, 2, ["lagged-damping"], marks=slow),
        (damping_on_each_step, 1, ["damping-per-step"]),
        (stages_at_the_start, 4, ["stage-time"]),
        (node_by_node, 2, ["in-place"]),
        (in_single, 1, ["float32"]),
        (weights_of_11_tenths, 2, ["pace"]),
        (time_stands_still, 1, ["time"]),
    ],
)
def test_each_cause_is_named(step, order, expected):
    assert causes(step, order) == expected


@pytest.mark.parametrize(
    ("step", "order"),
    [
        (wrong_drift, 1),
        pytest.param(wrong_stage, 4, marks=slow),
        pytest.param(one_ended, 1, marks=slow),
        pytest.param(in_decimals, 1, marks=slow),
    ],
)
def test_other_mistakes_are_unknown(step, order):
    assert causes(step, order) == ["unknown"]


@pytest.mark.parametrize(
    ("step", "claimed", "lowest", "highest"),
    [
        (heun, 4, 1.9, 2.1),
        pytest.param(heun, 2, 1.9, 2.1, marks=slow),
        pytest.param("stormer-verlet", 4, 1.9, 2.1, marks=slow),
        pytest.param("semi-implicit-euler", 2, 0.9, 2.1, marks=slow),
    ],
)
def test_no_cause_is_named_for_right_steppers(step, claimed, lowest, highest):
    (found,) = diagnosed(step, claimed)
    assert found.cause == "unknown"
    assert "converges to the right solution on all" in found.line
    assert lowest <= found.evidence["lowest_order"] <= found.evidence["highest_order"] <= highest


def test_the_numbers_of_a_damping_per_step():
    (found,) = diagnosed(damping_on_each_step, 1)
    assert found.evidence["slope"] == pytest.approx(-1.0, abs=0.05)
    low, high = found.evidence["ci95"]
    assert low <= -1.0 <= high
    # A factor of 0.99 for each step.
    assert found.evidence["lost_per_step"] == pytest.approx(0.01, rel=0.05)


def test_the_number_of_a_pace():
    (found,) = diagnosed(weights_of_11_tenths, 2)
    assert found.evidence["pace"] == 1.1
    assert found.evidence["spread"] < 1e-6


def test_the_numbers_of_a_start():
    _, start = diagnosed("stormer-verlet:start=rest", 2)
    orders = start.evidence["orders"]
    assert orders["soft start"]["position"] == pytest.approx(2.0, abs=0.1)
    assert orders["hard start"]["position"] == pytest.approx(1.0, abs=0.1)
