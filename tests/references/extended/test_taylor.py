"""Solutions in extended precision, and what is claimed of them."""

from __future__ import annotations

import functools
from fractions import Fraction

import jax.numpy as jnp
import numpy as np
import pytest

from ropeode import reference
from ropeode.problems import PROBLEMS, InextensibleRope, Problem, Rope
from ropeode.references import extended_solution
from ropeode.references.extended.taylor import solve
from tests.verification.extrapolation import rope_sizes, rope_solution

heyoka = pytest.importorskip("heyoka", reason="the extra 'extended' is not installed")

BITS = 200
# Seconds that no run takes, however busy the machine is.
NEVER = 1e9


def real(number):
    return heyoka.real(float(number), BITS)


def reals(array):
    """Numbers as `heyoka.real`, extended precision included, without rounding."""
    flat = [heyoka.real(number, BITS) for number in np.asarray(array, dtype=np.longdouble).flat]
    return np.array(flat).reshape(np.shape(array))


def largest(apart):
    return float(np.max(np.abs(apart.astype(np.float64))))


def damped(t, mass, stiffness, damping, x0, v0):
    """An oscillator that is damped less than critically, in any precision."""
    gamma = damping / (2 * mass)
    frequency = np.sqrt(stiffness / mass - gamma * gamma)
    decay, sine = np.exp(-gamma * t), np.sin(frequency * t) / frequency
    cosine = np.cos(frequency * t)
    return (
        decay * (x0 * cosine + (v0 + gamma * x0) * sine),
        decay * (v0 * cosine - (stiffness / mass * x0 + gamma * v0) * sine),
    )


def exact_oscillator(problem):
    args = [real(number) for number in problem.args]
    x0, v0 = reals(problem.y0.reshape(-1))
    return [damped(real(t), *args, x0, v0) for t in problem.ts]


def exact_kepler(problem):
    """Kepler's equation by Newton's iteration."""
    r, w = real(problem.y0[0, 0, 0]), real(problem.y0[1, 0, 1])
    e = r * w * w - 1
    axis = r / (1 - e)
    states = []
    for t in problem.ts:
        mean = real(t) / np.sqrt(axis) / axis
        anomaly = mean
        for _ in range(20):
            anomaly -= (anomaly - e * np.sin(anomaly) - mean) / (1 - e * np.cos(anomaly))
        sine, cosine, minor = np.sin(anomaly), np.cos(anomaly), np.sqrt(1 - e * e)
        speed = np.sqrt(1 / axis) / (1 - e * cosine)
        states.append(
            [
                [[axis * (cosine - e), axis * minor * sine]],
                [[-speed * sine, speed * minor * cosine]],
            ]
        )
    return states


EXACT = {
    "oscillator": (exact_oscillator, {"damping": 0.3, "x0": 0.7, "v0": 0.1}),
    "kepler": (exact_kepler, {"eccentricity": 0.7, "periods": 0.9}),
}


@functools.cache
def problem_named(name):
    return PROBLEMS[name](frames=7, **EXACT[name][1])


@functools.cache
def exact_states(name):
    exact, problem = EXACT[name][0], problem_named(name)
    return np.array(exact(problem)).reshape(len(problem.ts), *problem.y0.shape)


@pytest.mark.parametrize("name", EXACT)
def test_exact_solutions_to_thirty_digits(name):
    problem = problem_named(name)
    run = solve(problem)
    assert run.failure is None
    assert run.precision == 113
    # Twenty to fifty steps with errors of 2e-34 each; the planet's are amplified by its orbit.
    assert largest(run.states - exact_states(name)) < 1e-30


@pytest.mark.parametrize("name", EXACT)
def test_the_bound_holds_and_is_half_a_unit(name):
    problem = problem_named(name)
    known = reference(problem, level="extended", time_limit=NEVER)
    assert known.horizon is None
    error = np.abs((reals(known.states) - exact_states(name)).astype(np.float64))
    units = np.spacing(np.abs(known.states))
    for quantity, bound in known.certificate.bounds.items():
        wrong, rounded = (
            np.sqrt(np.sum(problem.quantity(quantity, each) ** 2, axis=2)).max(axis=1)
            for each in (error, units)
        )
        assert np.all(wrong <= bound)
        assert np.all(bound <= 0.51 * np.max(rounded))


def test_more_bits_are_more_digits():
    exact = exact_states("oscillator")
    problem = problem_named("oscillator")
    for bits in (53, 80, 160):
        error = largest(solve(problem, precision=bits).states - exact)
        # Twenty-odd steps with a unit or two of rounding each.
        assert error < 60 * 2.0**-bits


def test_rounding_is_to_the_nearest():
    run = solve(problem_named("oscillator"))
    for entry, rounded in zip(run.states.flat, run.rounded.flat, strict=True):
        assert rounded == float(Fraction(str(entry)))


@pytest.mark.parametrize(
    "problem",
    [
        Rope(num_nodes=4, damping=0.02).problem(frames=5),
        pytest.param(InextensibleRope(num_nodes=4).problem(frames=5), marks=pytest.mark.slow),
    ],
    ids=["rope", "inextensible"],
)
def test_ropes_against_extrapolation(problem):
    # The extrapolation knows positions to 1e-17 of their size, velocities to that of theirs.
    apart = solve(problem).states - reals(rope_solution(problem))
    assert largest(apart / reals(rope_sizes(problem.args, problem.y0))) < 4e-17


def test_runs_agree_to_the_digits_asked_for_wherever_they_end():
    """However much of them an unstable balance has lost by then."""
    for end in (1.0, 5.0):
        problem = Problem(lambda t, y, a: jnp.stack([3 * y[0], -y[1]]), [0.0, 1.0], [0.0, end])
        known = extended_solution(problem, digits=15, time_limit=NEVER)
        assert known.agreed == 2
        assert np.all(known.differences["state"] <= 1e-15)


def jump(t, y, a):
    return jnp.where(t < 1.3, y, -y)


def test_jumps_that_are_declared():
    problem = Problem(jump, [1.0], np.arange(4.0), jump_times=[1.3])
    run = solve(problem)
    assert run.failure is None
    ts, at = reals(problem.ts), real(1.3)
    exact = np.exp(np.where(problem.ts < 1.3, ts, 2 * at - ts))
    assert largest(run.states[:, 0] - exact) < 1e-32


def test_jumps_that_are_not_declared_end_the_run():
    problem = Problem(jump, [1.0], np.arange(4.0))
    run = solve(problem)
    assert run.reached == 2
    assert "'lt' in the right-hand side takes another branch" in run.failure
    known = extended_solution(problem, time_limit=NEVER)
    assert (known.agreed, len(known.states)) == (2, 2)
    assert "'lt'" in known.failure


def test_what_is_not_finite_ends_a_run():
    run = solve(Problem(lambda t, y, a: jnp.sqrt(y - 1), [1.5], [0.0, 1.0], jump_times=[0.5]))
    assert run.failure is None
    run = solve(Problem(lambda t, y, a: jnp.log(1.5 - t) * y, [1.0], np.arange(4.0)))
    assert run.reached == 2
    assert run.failure.startswith("stopped after t = 1.")
