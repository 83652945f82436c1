"""What is wrong with a stepper is read off its step, and nothing is said of right ones."""

from __future__ import annotations

import jax
import numpy as np
import pytest

from ropeode.checking import Claims, Examination, diagnose_stepper
from ropeode.steppers import Stepper
from tests.checking.mutants.all import MUTANTS
from tests.checking.right_steppers import RIGHT
from tests.theory.test_stability_function import Ramp

slow = pytest.mark.slow


@pytest.fixture(scope="module", autouse=True)
def _float64():
    with jax.enable_x64(True):
        yield


def diagnosed(step, order=None):
    return diagnose_stepper(Examination(step, Claims(order)))


def forces(x, v, args):
    """Forces in NumPy, of springs and gravity and damping."""
    d = np.diff(x, axis=0)
    length = np.sqrt(np.sum(d * d, axis=1))
    pull = (args.stiffness * (1.0 - args.rest_length / length))[:, None] * d
    force = args.mass[:, None] * args.gravity.ravel() - args.damping[:, None] * v
    force[:-1] += pull
    force[1:] -= pull
    return force


def semi_implicit(acceleration):
    """Semi-implicit Euler with an acceleration of its own, in NumPy."""

    def step(_, t, x, v, dt, args):
        v = v + dt * args.free[:, None] * acceleration(x, v, args)
        return x + dt * v, v

    return step


def right(x, v, args):
    return forces(x, v, args) / args.mass[:, None]


def with_args(**change):
    """The rope with other numbers."""
    return semi_implicit(
        lambda x, v, args: right(
            x, v, args._replace(**{name: new(args) for name, new in change.items()})
        )
    )


def added(extra):
    return semi_implicit(lambda x, v, args: right(x, v, args) + extra(x, v, args))


def springs(law):
    """Only the springs, by another law for their force along the unit vector."""

    def acceleration(x, v, args):
        d = np.diff(x, axis=0)
        length = np.sqrt(np.sum(d * d, axis=1))
        pull = law(length, args)[:, None] * d / length[:, None]
        force = args.mass[:, None] * args.gravity.ravel() - args.damping[:, None] * v
        force[:-1] += pull
        force[1:] -= pull
        return force / args.mass[:, None]

    return semi_implicit(acceleration)


EQUATIONS = {
    "gravity of its own": (
        with_args(gravity=lambda a: np.array([0.0, -9.81, 0.0])),
        "gravity is (0, -9.81, 0) on every rope, whatever the problem says",
    ),
    "a gravity 1% too large": (
        with_args(gravity=lambda a: 1.01 * a.gravity),
        "gravity is 1% too large",
    ),
    "no damping": (with_args(damping=lambda a: 0 * a.damping), "the damping is left out"),
    "springs twice": (
        with_args(stiffness=lambda a: 2 * a.stiffness),
        "the spring force is counted twice",
    ),
    "a stiffness 1% too large": (
        with_args(stiffness=lambda a: 1.01 * a.stiffness),
        "the spring force is 1% too large",
    ),
    "no mass": (semi_implicit(forces), "the mass is left out: forces are not divided by it"),
    "one mass for all": (
        with_args(mass=lambda a: np.full_like(a.mass, a.mass[0]), gravity=lambda a: a.gravity),
        "the mass of the first node is taken for all",
    ),
    "half a mass at the end": (
        with_args(mass=lambda a: a.mass * np.where(np.arange(len(a.mass)) == 4, 0.5, 1.0)),
        "the mass is counted half at node 4 (",
    ),
    "masses of the first rope": (
        with_args(mass=lambda a: np.array([1.3, 0.8, 0.6, 1.7, 0.9])),
        "the mass is (1.3, 0.6, 1.7, 0.9) at 0, 2, 3 and 4 on every rope",
    ),
    "stiffnesses of the first rope": (
        with_args(stiffness=lambda a: np.array([3.0, 5.5, 4.2, 2.6])),
        "the stiffness is (3, 5.5, 4.2, 2.6) at 0, 1, 2 and 3 on every rope",
    ),
    "whole rest lengths": (
        with_args(rest_length=lambda a: np.trunc(a.rest_length)),
        "the rest length is truncated to a whole number",
    ),
    "two at once": (
        with_args(damping=lambda a: 0 * a.damping, gravity=lambda a: 0.7 * a.gravity),
        "gravity is 30% too small; the damping is left out",
    ),
    "quadratic drag": (
        added(lambda x, v, args: -0.3 * np.linalg.norm(v, axis=1, keepdims=True) * v),
        "there is drag that grows with the square of the speed (coefficient -0.3)",
    ),
    "tension-only springs": (
        springs(lambda length, args: args.stiffness * np.maximum(length - args.rest_length, 0.0)),
        "a force of slack springs is left out",
    ),
    "another law": (
        springs(lambda length, args: args.stiffness * (length - args.rest_length) * length**2),
        "a spring force that is no linear function of the length",
    ),
    "a wind": (
        added(lambda x, v, args: np.outer(args.damping / args.mass, [0.5, 0.0, 0.2])),
        "there is a wind of (0.5, 0, 0.2)",
    ),
    "a ground": (
        added(lambda x, v, args: np.where(x[:, 1:2] < -0.2, -50 * x[:, 1:2] - 10, 0) * [0, 1, 0]),
        "only where the node's y is below a number between -0.2",
    ),
    "a time in milliseconds": (
        lambda acceleration, t, x, v, dt, args: (
            x + dt * v,
            v + dt * acceleration(1000 * t, x, v, args),
        ),
        "the driving force is the one of 1000 t",
    ),
    "one node": (
        added(lambda x, v, args: 0.01 * np.eye(5)[:, 3:4] * np.sin(7.0 * x)),
        "at node 3 alone, and by no combination of factors",
    ),
}


# A number of its own, a factor, two at once, another law, and what nobody knows.
FEW = ("gravity of its own", "one mass for all", "two at once", "another law", "one node")


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name in FEW else slow) for name in EQUATIONS]
)
def test_the_equation_that_is_solved_is_named(name):
    step, words = EQUATIONS[name]
    (found,) = diagnosed(step, 1)
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


def limited(acceleration, t, x, v, dt, args):
    v = np.clip(v + dt * np.asarray(acceleration(t, x, v, args)), -0.8, 0.8)
    return x + dt * v, v


def swapped(acceleration, t, x, v, dt, args):
    return v + dt * acceleration(t, x, v, args), x + dt * v


def mean_velocity(acceleration, t, x, v, dt, args):
    x_new = np.asarray(x) + dt * v + dt**2 / 2 * acceleration(t, x, v, args)
    return x_new, (x_new - x) / dt


def weights_of_11_tenths(rhs, t, y, dt, args):
    k = rhs(t, y, args)
    return y + 0.55 * dt * (k + rhs(t + dt, y + dt * k, args))


def in_decimals(acceleration, t, x, v, dt, args):
    v = np.round(v + dt * args.free[:, None] * right(x, v, args), 7)
    return np.round(x + dt * v, 7), v


def with_dt(change):
    """Semi-implicit Euler with another step size."""

    def step(acceleration, t, x, v, dt, args):
        dt = change(float(dt))
        v = v + dt * args.free[:, None] * right(np.asarray(x), v, args)
        return x + dt * v, v

    return step


@pytest.mark.parametrize(
    ("change", "cause", "words"),
    [
        (lambda dt: float(np.float32(dt)), "float32", "dt is rounded to float32: the result jumps"),
        (lambda dt: round(dt, 3), "step-size", "dt is rounded to the nearest multiple of 0.001"),
        (lambda dt: int(1000 * dt) / 1000, "step-size", "rounded down to a multiple of 0.001"),
        (lambda dt: min(dt, 1 / 60), "step-size", "above 0.0166667 give the same: there dt is cut"),
        (lambda dt: max(dt, 1e-3), "step-size", "below 0.001 give the same: there dt is made"),
        (lambda dt: 0.01, "step-size", "to the last bit, so dt is not used"),
    ],
)
def test_a_step_size_that_is_not_used_as_given(change, cause, words):
    (found,) = diagnosed(with_dt(change), 1)
    assert found.cause == cause
    assert words in found.line


@pytest.mark.parametrize("name", ["gravity", "mass"])
def test_a_parameter_in_float32_is_named(name):
    step = with_args(**{name: lambda args: getattr(args, name).astype(np.float32).astype(float)})
    (found,) = diagnosed(step, 1)
    assert found.cause == "float32"
    assert found.line.startswith(f"{name} is rounded to float32")


@pytest.mark.parametrize(
    ("step", "order", "expected", "words"),
    [
        (swapped, 1, ["swapped"], "returns the velocities first"),
        (limited, 1, ["identity"], "each component of the velocity is at most 0.8"),
        (smoothed, 1, ["identity"], "v3 becomes 0.1 v2 + 0.8 v3 + 0.1 v4"),
        (mean_velocity, 2, ["equation"], "velocity, which is (x_new - x)/dt"),
        (weights_of_11_tenths, 2, ["pace"], "its slopes times 11/10"),
        ("stormer-verlet:start=rest", 2, ["start", "start"], "forgets the initial velocity"),
        (Ramp, 4, ["start"], "start of the method is of order 2"),
        ("stormer-verlet:damping=lagged", 2, ["lagged-damping"], "of the beginning of the step"),
        ("stormer-verlet:damping=per-step", 2, ["damping-per-step"], "whatever dt is"),
        ("explicit-euler", 2, ["order"], "this is explicit-euler"),
        ("semi-implicit-euler", 2, ["order"], "this is semi-implicit-euler; its order is 1"),
        ("velocity-verlet", 4, ["order"], "order 4 is expected"),
    ],
)
def test_each_cause_is_named(step, order, expected, words):
    found = diagnosed(step, order)
    assert [each.cause for each in found] == expected
    assert words in found[0].line


@pytest.mark.parametrize(
    ("step", "order", "remedies"),
    [
        (EQUATIONS["two at once"][0], 1, ["a += gravity; a -= damping * v / mass"]),
        (mean_velocity, 2, ["v_new = (x_new - x) / dt + dt / 2 * a"]),
        (
            weights_of_11_tenths,
            2,
            ["y_new = y + dt * (1/2 * k1 + 1/2 * k2)"],
        ),
    ],
)
def test_the_line_that_is_right_is_named(step, order, remedies):
    assert [each.remedy for each in diagnosed(step, order)] == remedies


def test_the_pace_is_a_number():
    (found,) = diagnosed(weights_of_11_tenths, 2)
    assert found.evidence["pace"] == pytest.approx(1.1, abs=1e-10)


def short_sixth(rhs, t, y, dt, args):
    k = rhs(t, y, args)
    return y + 0.5000001 * dt * (k + rhs(t + dt, y + dt * k, args))


def test_a_weight_with_few_digits_is_no_other_pace():
    (found,) = diagnosed(short_sixth, 2)
    assert found.cause == "digits"
    assert "off by 2.0e-07 of itself" in found.line


def test_rounding_to_decimals_is_no_other_equation():
    (found,) = diagnosed(in_decimals, 1)
    assert found.cause in ("unknown", "identity")
    assert "solves another equation" not in found.line


# Mutants that change the equation, with what is said of them.
NAMED = {
    "own_euler: one-ended spring": "the spring force is left out at the second node of each spring",
    "own_euler: length in the plane": "divided by a length of x and y alone",
    "own_euler: gravity along y only": "the x component of gravity is left out; the z component",
    "own_euler: damping of the speed along the spring only": "there is a dashpot along each spring",
    "own_euler: only the first node pinned": "pinned nodes are accelerated; node 0 is held",
    "own_euler: mass times force": "the mass multiplies forces in place of dividing them",
    "own_euler: force not by direction": "direction is not divided by the length",
    "own_verlet: positions updated node by node, forces computed between": "updated in place",
    "semi_implicit_euler: time stands still": "the driving force is the one of t = 0",
    "semi_implicit_euler: growth of 1e-3": "0.001 times the velocity too much",
    "velocity_verlet: dt once": "positions change by 0.5 dt times the acceleration",
    "velocity_verlet: no second-order term": "0 in place of 1/2 as the factor of dt^2 k1",
    "leapfrog: half a drift": "positions move with 0.5 times the velocity",
    "heun: second stage at t": "with all slopes taken at time t",
    "heun: first slope only": "this is explicit-euler; its order is 1 (declared: 2)",
    "rk4: weights 1 2 2 2": "this is RK4 with b4 = 1/3 in place of 1/6",
    "rk4: weights 1 4 1": "k2 used twice in the result in place of k3",
    "StormerVerlet: velocity from behind": "its velocities are those of 0.5 dt earlier",
    "StormerVerlet: starts without acceleration": "velocities are off by 0.5 dt times the accel",
    "explicit_euler: velocity overwritten": "the new velocities do not contain the old ones",
}


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[] if "own_euler: one" in name else slow) for name in NAMED],
)
def test_mutants_are_named(name):
    mutant = MUTANTS[name]
    found = diagnosed(mutant.make(), mutant.claims["expected_order"])
    assert NAMED[name] in "; ".join(each.line for each in found)


QUICK = ("ropeode rk4",)


@pytest.mark.parametrize("name", [pytest.param(n, marks=[] if n in QUICK else slow) for n in RIGHT])
def test_nothing_is_said_of_right_steppers(name):
    step, claims = RIGHT[name]
    (found,) = diagnosed(step, claims.get("expected_order"))
    assert found.cause == "unknown"
    assert "the step solves the right equation" in found.line


def late_by(off):
    def step(acceleration, t, x, v, dt, args):
        v = v + dt * acceleration(t + off, x, v, args)
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


@pytest.mark.parametrize(
    ("step", "words"),
    [
        (late_by(1e-3), "the driving force is that of t + 0.001 ("),
        (late_by(-0.25), "the driving force is that of t - 0.25 ("),
        (OfItsRun, "the driving force is the one of t = 0 at the start of each run"),
    ],
)
def test_another_time_in_the_driving_force_is_found(step, words):
    (diagnosis,) = diagnose_stepper(Examination(step, Claims(order=1)))
    assert words in diagnosis.line
