"""Files of problems that are no ropes: a ball, a planet, masses on springs."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from trajectory_writing import WRITERS, finding, write_runs
from written_programs import rk4

from ropeode import Problem, grade, reference
from ropeode.problems import PROBLEMS, LinearDamping
from tests.exact_reference import mechanics_reference


def falls(t, x, v, args, xp: Any = jnp):
    return xp.zeros_like(x) + xp.array([0.0, -9.81])


def pulls(t, x, v, args, xp: Any = jnp):
    """Of masses 1, 2 and 0.5 on springs that are not linear."""
    d = xp.diff(x, axis=-2)
    size = xp.sqrt(xp.sum(d * d, axis=-1, keepdims=True))
    pull = 40.0 * (size - 1.0) ** 3 * d / size
    return xp.diff(pull, axis=-2, prepend=0.0, append=0.0) / xp.array([[1.0], [2.0], [0.5]])


def slows(t, x, v, args, xp: Any = jnp):
    return -4.0 * x**3 - 0.3 * v


def orbits(t, x, v, args, xp: Any = jnp):
    return -x / xp.sum(x * x, axis=-1, keepdims=True) ** 1.5


BALL = Problem.second_order(falls, [[0.0, 1.0]], [[3.0, 4.0]], np.linspace(0.0, 2.0, 9))
CHAIN = Problem.second_order(
    pulls,
    [[0.0, 0.0], [1.2, 0.1], [2.1, 0.3]],
    [[0.5, 0.0], [0.0, -0.4], [0.2, 1.0]],
    np.linspace(0.0, 2.0, 9),
)
DAMPED = Problem.second_order(
    slows,
    [[1.0, 0.2]],
    [[0.5, -1.0]],
    np.linspace(0.0, 2.0, 9),
    damping=lambda args: LinearDamping(0.3, 0.3),
)
PROBLEM = {"ball": BALL, "planet": PROBLEMS["kepler"](9), "chain": CHAIN, "damped": DAMPED}
ACCELERATION = {"ball": falls, "planet": orbits, "chain": pulls, "damped": slows}


@pytest.fixture(scope="module")
def known():
    return {
        name: mechanics_reference(problem, ACCELERATION[name]) for name, problem in PROBLEM.items()
    }


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
    # There it is RK4 as well, which is not symplectic.
    assert grade(files, known["ball"], method=stepper).verdict == "right"


def test_what_is_too_precise_to_tell_its_order_is_not_called_exact(known, tmp_path):
    files = write_runs(tmp_path, PROBLEM["planet"], "rk4", (3072, 3584, 4096))
    report = grade(files, known["planet"], expected_order=4)
    # It is right by its numbers, which are those of RK4.
    assert report.verdict == "right"
    assert "exact on this problem" not in finding(report).line
    assert report.findings[1].convergence.orders["position"].observed is None


def test_methods_that_are_the_same_here_refute_none(known, tmp_path):
    """Few digits leave the order open; that the parabola is RK4's as well says nothing."""
    how = {"suffix": ".csv", "digits": "%.9g"}
    files = write_runs(tmp_path, BALL, "yoshida6", (8, 16, 32), **how)
    assert grade(files, known["ball"], method="yoshida6").verdict != "wrong"


STARTS = {
    ("ball", "stormer-verlet:start=rest"): ("start", "the initial velocity is forgotten"),
    ("chain", "stormer-verlet:start=rest"): ("start", "the initial velocity is forgotten"),
    ("planet", "semi-implicit-euler"): (
        "method",
        "the positions are those of semi-implicit Euler (or Störmer-Verlet with x(-dt) = x(0) - ",
    ),
    ("chain", "explicit-euler"): ("method", "the positions are those of explicit Euler, exactly"),
    # Verlet's planet falls into the sun, however small the steps are.
    ("planet", "stormer-verlet:start=rest"): ("start", "the initial velocity is forgotten"),
    ("damped", "stormer-verlet:start=rest,damping=lagged"): ("start", "the initial velocity is"),
}


@pytest.mark.parametrize(("problem", "stepper"), STARTS)
def test_a_wrong_start_is_named(known, tmp_path, problem, stepper):
    """One mass is in no reverse order, and no node stands still that does not exist."""
    cause, words = STARTS[problem, stepper]
    files = write_runs(tmp_path, PROBLEM[problem], stepper, (32, 64, 128), velocities=False)
    (diagnosis,) = grade(files, known[problem], expected_order=2).diagnosis
    assert diagnosis.cause == cause
    assert diagnosis.line.startswith(words)


def euler(x, v, a, dt):
    v = v + dt * a(x, v)
    return x + dt * v, v


def damped_euler(x, v, a, dt):
    x, v = euler(x, v, a, dt)
    return x, 0.9995 * v


def midpoint(x, v, a, dt):
    half, w = x + dt / 2 * v, v + dt / 2 * a(x, v)
    return x + dt * w, v + dt * a(half, w)


def without_new_force(x, v, a, dt):
    return x + dt * v + dt * dt / 2 * a(x, v), v + dt * a(x, v)


# What is said of a step, and by what it multiplies the acceleration and the initial velocity.
MISTAKES = {
    "the initial velocity is left out. With this change, the midpoint method": (midpoint, 1.0, 0.0),
    "the acceleration has the wrong sign": (euler, -1.0),
    "the acceleration is 0.5% too large. With this change, the midpoint method": (midpoint, 1.005),
    "each step keeps 0.9995 of the velocity, however long": (damped_euler, 1.0),
    "that takes the acceleration of the start for both": (without_new_force, 1.0),
}


@pytest.mark.parametrize("words", MISTAKES)
@pytest.mark.parametrize("problem", ["planet", "damped"])
def test_a_mistake_in_a_known_method_is_named(known, tmp_path, problem, words):
    (step, factor, *of_start), own = MISTAKES[words], known[problem].problem
    acceleration = jax.jit(own.mechanics.acceleration)

    def a(x, v):
        with jax.enable_x64(True):
            return factor * np.asarray(acceleration(0.0, x, v, own.args))

    files = []
    for n in (16, 32, 64):
        (x, v), dt = own.y0, float(own.ts[1]) / n
        v = np.prod(of_start) * v
        rows = [x]
        for _ in own.ts[1:]:
            for _ in range(n):
                x, v = step(x, v, a, dt)
            rows.append(x)
        files.append(WRITERS[".npz"](tmp_path / f"{n}.npz", own.ts, np.array(rows), dt))
    report = grade(files, known[problem], expected_order=2)
    assert report.verdict == "wrong"
    assert words in report.diagnosis[0].line


def orbit(problem, n, samples):
    """Kutta's method with n steps in a frame, and its samples as people take them."""
    dt = float(problem.ts[1]) / n
    x, v = problem.y0
    t, rows = 0.0, [np.hstack([x, v])]

    def step(h):
        far = samples == "cut" and np.linalg.norm(x) > 1.2
        return rk4(lambda x, v: (far - 1.0) * x / np.sum(x * x) ** 1.5, x, v, h)

    for end in problem.ts[1:]:
        before = rows[-1]
        while t < end - (0.0 if samples == "by time" else 1e-9):
            before, h = np.hstack([x, v]), min(dt, end - t) if samples == "shorter" else dt
            (x, v), t = step(h), t + h
        after = np.hstack([x, v])
        past = (t - end) / dt if samples == "line" else 0.0
        rows.append(after + past * (before - after))
    return problem.ts, np.array(rows), dt


SAMPLES = {
    "line": ((8.37, 16.37, 33.3, 64.37), "straight-line", "on a straight line"),
    "by time": ((10, 20, 40, 80), "extra-step", "there is a step too many in frame 2"),
    "cut": ((16, 32, 64), "departure", "the positions are those of rk4"),
    "shorter": ((8.37, 16.37, 33.3, 64.37), None, ""),
}


@pytest.mark.parametrize("samples", SAMPLES)
@pytest.mark.parametrize("digits", ["%.17g", "%.10g"])
def test_samples_between_steps_and_steps_counted_by_time(known, tmp_path, samples, digits):
    steps, cause, words = SAMPLES[samples]
    files = [
        WRITERS[".csv"](tmp_path / f"{i}.csv", *orbit(PROBLEM["planet"], n, samples), digits=digits)
        for i, n in enumerate(steps)
    ]
    report = grade(files, known["planet"], expected_order=4)
    assert [each.cause for each in report.diagnosis] == ([cause] if cause else [])
    assert words in " ".join(each.line for each in report.diagnosis)
    # What makes the last step shorter is not told to do so.
    assert cause or (report.verdict, report.notes) == ("right", ())


def test_methods_that_differ_only_at_a_wall_depart_from_nothing(tmp_path):
    """In free fall implicit Euler is semi-implicit Euler, which is far better at walls."""
    wall = Problem.second_order(
        lambda t, x, v, args: jnp.array([0.0, -9.81]) + 1e3 * jnp.maximum(0.0, -x),
        [[1.0, 1.0]],
        [[0.0, 0.0]],
        np.linspace(0.0, 3.0, 25),
    )
    files = write_runs(tmp_path, wall, "implicit-euler", (8, 16, 32))
    assert grade(files, wall, expected_order=1, accuracy=1e-5).verdict == "undetermined"


@pytest.mark.slow
def test_what_is_far_from_the_solution_is_not_unstable(tmp_path):
    """Of a planet that is seen once a period it is not known how far it came."""
    planet = reference(PROBLEMS["kepler"](4, periods=4))
    files = write_runs(tmp_path, planet.problem, "explicit-euler", (16, 24, 36))
    report = grade(files, planet, diagnose=False)
    assert finding(report).line.startswith(
        "far from the solution at dt = 0.3927, 0.2618 and 0.1745"
    )
    assert "unstable" not in finding(report).line
