"""What is wrong with a stepper is read off its step, and nothing is said of right ones."""

from __future__ import annotations

import jax
import numpy as np
import pytest

from ropeode.checking import Claims, Examination, diagnose_stepper
from ropeode.steppers import Stepper
from tests.checking.mutants.all import MUTANTS
from tests.checking.mutants.mutant import BY_HAND
from tests.checking.right_steppers import RIGHT
from tests.checking.steps import accelerations
from tests.theory.test_stability_function import Ramp


@jax.enable_x64(True)
def diagnosed(step, order):
    return diagnose_stepper(Examination(step, Claims(order)))


def mostly_slow(names, few):
    return [pytest.param(each, marks=[] if each in few else pytest.mark.slow) for each in names]


def semi_implicit(acceleration, change_dt=lambda dt: dt):
    """Semi-implicit Euler with an acceleration of its own, in NumPy, and another step size."""

    def step(_, t, x, v, dt, args):
        dt = change_dt(float(dt))
        v = v + dt * args.free[:, None] * acceleration(np.asarray(x), v, args)
        return x + dt * v, v

    return step


def with_args(**change):
    """The rope with other numbers."""
    return semi_implicit(
        lambda x, v, args: accelerations(
            x, v, args._replace(**{name: new(args) for name, new in change.items()})
        )
    )


def added(extra):
    return semi_implicit(lambda x, v, args: accelerations(x, v, args) + extra(x, v, args))


def springs(law):
    """Springs with another law for their force along the unit vector."""
    return semi_implicit(
        lambda x, v, args: accelerations(
            x, v, args, lambda length, args: law(length, args) / length
        )
    )


def at(time):
    """Semi-implicit Euler, with forces of another time."""

    def step(acceleration, t, x, v, dt, args):
        v = v + dt * acceleration(time(t), x, v, args)
        return x + dt * v, v

    return step


class OfItsRun(Stepper):
    """Explicit Euler, whose time starts from 0 in each run."""

    def init(self, system, t, y, dt):
        return y, 0.0 * dt

    def step(self, system, t, carried, dt):
        y, own = carried
        return y + dt * system.rhs(own, y), own + dt

    def state(self, system, t, carried, dt):
        return carried[0]

    def order(self, problem_class):
        return 1


# Steps, by what is said of them.
EQUATIONS = {
    "gravity is 30% too small; the damping is left out": with_args(
        damping=lambda a: 0 * a.damping, gravity=lambda a: 0.7 * a.gravity
    ),
    "the driving force is the one of 1000 t": at(lambda t: 1000 * t),
}
RARER = {
    "the mass is (1.3, 0.6, 1.7, 0.9) at 0, 2, 3 and 4 on every rope": with_args(
        mass=lambda a: np.array([1.3, 0.8, 0.6, 1.7, 0.9])
    ),
    "the driving force is the one of t = 0 at the start of each run": OfItsRun,
    "the mass is counted half at node 4 (": with_args(
        mass=lambda a: a.mass * np.where(np.arange(len(a.mass)) == 4, 0.5, 1.0)
    ),
    "gravity is (0, -9.81, 0) on every rope, whatever the problem says": with_args(
        gravity=lambda a: np.array([0.0, -9.81, 0.0])
    ),
    "at node 3 alone, and by no combination of factors": added(
        lambda x, v, args: 0.01 * np.eye(5)[:, 3:4] * np.sin(7.0 * x)
    ),
    "the spring force is counted twice": with_args(stiffness=lambda a: 2 * a.stiffness),
    "the spring force grows with the square of the stretch, and pulls": springs(
        lambda length, args: args.stiffness * (length - args.rest_length) ** 2
    ),
    "the stiffness is (3, 5.5, 4.2, 2.6) at 0, 1, 2 and 3 on every rope": with_args(
        stiffness=lambda a: np.array([3.0, 5.5, 4.2, 2.6])
    ),
    "a spring force that is no linear function of the length": springs(
        lambda length, args: args.stiffness * (length - args.rest_length) * length**2
    ),
    "constant acceleration (coefficient (0.5, 0, 0.2) * damping / mass)": added(
        lambda x, v, args: np.outer(args.damping / args.mass, [0.5, 0.0, 0.2])
    ),
    "only where the node's y is below a number between -0.2": added(
        lambda x, v, args: np.where(x[:, 1:2] < -0.2, -50 * x[:, 1:2] - 10, 0) * [0, 1, 0]
    ),
}


@pytest.mark.parametrize("words", mostly_slow(EQUATIONS | RARER, EQUATIONS))
def test_the_equation_that_is_solved_is_named(words):
    (found,) = diagnosed((EQUATIONS | RARER)[words], 1)
    assert found.cause == "equation"
    assert words in found.line


def natural_verlet(acceleration, t, x, v, dt, args):
    """The assignment's Verlet as a step from positions and velocities."""
    still = args._replace(damping=0.0 * args.damping)
    x_new = np.asarray(x) + (1 - 5e-5) * v * dt + dt**2 * acceleration(t, x, v, still)
    return x_new, (x_new - x) / dt


def test_both_faults_of_the_natural_verlet_are_named():
    per_step, equation = diagnosed(natural_verlet, 2)
    assert per_step.cause == "damping-per-step"
    assert "multiplies velocities by 0.99995," in per_step.line
    assert per_step.evidence["lost_per_step"] == pytest.approx(5e-5, rel=1e-7)
    assert equation.cause == "equation"
    assert "solves another equation: the damping is left out (all else" in equation.line


def smoothed(acceleration, t, x, v, dt, args):
    v = v + dt * acceleration(t, x, v, args)
    v[1:-1] = 0.8 * v[1:-1] + 0.1 * (v[:-2] + v[2:])
    return x + dt * v, v * args.free[:, None]


def swapped(acceleration, t, x, v, dt, args):
    return v + dt * acceleration(t, x, v, args), x + dt * v


def mean_velocity(acceleration, t, x, v, dt, args):
    x_new = np.asarray(x) + dt * v + dt**2 / 2 * acceleration(t, x, v, args)
    return x_new, (x_new - x) / dt


def weights_of(each):
    """Heun's method, with other weights."""

    def step(rhs, t, y, dt, args):
        k = rhs(t, y, args)
        return y + each * dt * (k + rhs(t + dt, y + dt * k, args))

    return step


def in_decimals(acceleration, t, x, v, dt, args):
    v = np.round(v + dt * accelerations(x, v, args), 7)
    return np.round(x + dt * v, 7), v


def with_dt(change):
    return semi_implicit(accelerations, change)


def float32(name):
    return with_args(**{name: lambda args: getattr(args, name).astype(np.float32).astype(float)})


def kicks(weights, times=1.0):
    """Parts of a step, kick-drift-kick each, with damping as an explicit force."""

    def step(acceleration, t, x, v, dt, args):
        for weight in weights:
            part = weight * dt
            v = v + part / 2 * acceleration(t, x, v, args)
            x, t = x + part * v, t + times * part
            v = v + part / 2 * acceleration(t, x, v, args)
        return x, v

    return step


def moving_pin(rhs, t, y, dt, args):
    """RK4, in whose second stage pinned nodes are elsewhere."""
    k1 = rhs(t, y, args)
    away = dt / 3 * (1 - args.free)[:, None] * np.ones_like(y)
    k2 = rhs(t + dt / 2, y + dt / 2 * k1 + away, args)
    k3 = rhs(t + dt / 2, y + dt / 2 * k2, args)
    k4 = rhs(t + dt, y + dt * k3, args)
    return y + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


YOSHIDA = np.array([1.0, -(2.0 ** (1 / 3)), 1.0]) / (2.0 - 2.0 ** (1 / 3))

# By what the first line says: the step, its order, and the causes.
CAUSES = {
    "right without damping: order 2; 1 with it": (kicks([1.0]), 2, ["lagged-damping"]),
    "returns the velocities first": (swapped, 1, ["swapped"]),
    "y_new = y + dt * (11/20 * k1 + 11/20 * k2) in": (weights_of(0.55), 2, ["pace"]),
    "this is explicit-euler; its order is 1": ("explicit-euler", 2, ["order"]),
    "dt is rounded to float32: the": (with_dt(lambda dt: float(np.float32(dt))), 1, ["float32"]),
    "above 0.0166667 give the same": (with_dt(lambda dt: min(dt, 1 / 60)), 1, ["step-size"]),
}
RARER_CAUSES = {
    "right without damping: order 4; 1 with it": (kicks(YOSHIDA), 4, ["lagged-damping"]),
    "damping and forces that depend on time: order 4": (kicks(YOSHIDA, times=0.0), 4, ["order"]),
    "coefficients with few digits": (kicks(YOSHIDA.round(3)), 4, ["lagged-damping"]),
    "right without pinned nodes: order 4; 1 with them": (moving_pin, 4, ["order"]),
    "velocity, which is (x_new - x)/dt": (mean_velocity, 2, ["equation"]),
    "start of the method is of order 2": (Ramp, 4, ["start"]),
    "of the beginning of the step": ("stormer-verlet:damping=lagged", 2, ["lagged-damping"]),
    "off by 2.0e-07 of itself": (weights_of(0.5000001), 2, ["digits"]),
    "changes the state by up to 0.2 of its size, at nodes 2 and 3": (smoothed, 1, ["identity"]),
    "forgets the initial velocity": ("stormer-verlet:start=rest", 2, ["start", "start"]),
    "whatever dt is": ("stormer-verlet:damping=per-step", 2, ["damping-per-step"]),
    "order 4 is expected": ("velocity-verlet", 4, ["order"]),
    "gravity is rounded to float32": (float32("gravity"), 1, ["float32"]),
    "mass is rounded to float32": (float32("mass"), 1, ["float32"]),
    "from 0.4645 to 0.4655 give the same": (with_dt(lambda dt: round(dt, 3)), 1, ["step-size"]),
    "below 0.001 change nothing": (with_dt(lambda dt: int(1000 * dt) / 1000), 1, ["step-size"]),
    "below 0.001 give the same": (with_dt(lambda dt: max(dt, 1e-3)), 1, ["step-size"]),
    "to the last bit, so dt is not used": (with_dt(lambda dt: 0.01), 1, ["step-size"]),
}
REMEDIES = {
    "velocity, which is (x_new - x)/dt": "v_new = (x_new - x) / dt + dt / 2 * a",
    "y_new = y + dt * (11/20 * k1 + 11/20 * k2) in": "y_new = y + dt * (1/2 * k1 + 1/2 * k2)",
    "right without damping: order 2; 1 with it": (
        "damping force: -damping * (v + v_new) / 2; or claim order 1 on problems with damping"
    ),
}


@pytest.mark.parametrize("words", mostly_slow(CAUSES | RARER_CAUSES, CAUSES))
def test_each_cause_is_named_with_the_line_that_is_right(words):
    step, order, expected = (CAUSES | RARER_CAUSES)[words]
    found = diagnosed(step, order)
    assert [each.cause for each in found] == expected
    assert words in found[0].line
    assert found[0].remedy == REMEDIES.get(words, found[0].remedy)
    if expected == ["pace"]:
        assert found[0].evidence["pace"] == pytest.approx(1.1, abs=1e-10)


@pytest.mark.slow
def test_rounding_to_decimals_is_no_other_equation():
    (found,) = diagnosed(in_decimals, 1)
    assert found.cause in ("unknown", "identity")
    assert "solves another equation" not in found.line


SAID = BY_HAND["diagnosis"]


@pytest.mark.parametrize("name", mostly_slow(SAID, ["own_euler: one-ended spring"]))
def test_mutants_are_named(name):
    mutant = MUTANTS[name]
    found = diagnosed(mutant.make(), mutant.claims["expected_order"])
    assert SAID[name] in "; ".join(each.line for each in found)


@pytest.mark.slow
@pytest.mark.parametrize("name", RIGHT)
def test_nothing_is_said_of_right_steppers(name):
    step, claims = RIGHT[name]
    (found,) = diagnosed(step, claims.get("expected_order"))
    assert found.cause == "unknown"
    assert "the step solves the right equation" in found.line
