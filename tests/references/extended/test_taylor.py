"""Solutions in extended precision, and what is claimed of them."""

from __future__ import annotations

import functools
from fractions import Fraction

import jax.numpy as jnp
import numpy as np
import pytest

from ropeode.errors import InputError
from ropeode.problems import PROBLEMS, InextensibleRope, Problem, Rope
from ropeode.references import extended_solution
from ropeode.references.defect import look_between
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


PI = 4 * np.arctan(heyoka.real(1, BITS))


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


def exact_chain(problem):
    mass, stiffness, damping = (real(number) for number in problem.args)
    n = problem.y0.shape[1]
    modes = np.array(
        [
            [np.sin(PI * (j * k % (2 * n + 2)) / (n + 1)) for k in range(1, n + 1)]
            for j in range(1, n + 1)
        ]
    ) * np.sqrt(heyoka.real(2, BITS) / (n + 1))
    springs = [4 * stiffness * np.sin(PI * j / (2 * n + 2)) ** 2 for j in range(1, n + 1)]
    x0, v0 = (np.sum(modes * row, axis=1) for row in reals(problem.y0))
    states = []
    for t in problem.ts:
        each = [damped(real(t), mass, springs[j], damping, x0[j], v0[j]) for j in range(n)]
        states.append([np.sum(modes.T * np.array(row), axis=1) for row in zip(*each, strict=True)])
    return states


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


def exact_forced(problem):
    rate, frequency = (real(number) for number in problem.args)
    states = []
    for t in problem.ts:
        fade, phase = np.exp(-rate * real(t)), frequency * real(t)
        pushed = rate * (np.cos(phase) - fade) + frequency * np.sin(phase)
        squares = rate * rate + frequency * frequency
        states.append([real(problem.y0[0]) * fade + rate * pushed / squares])
    return states


EXACT = {
    "oscillator": (exact_oscillator, {"damping": 0.3, "x0": 0.7, "v0": 0.1}),
    "linear-chain": (exact_chain, {"num_masses": 5, "damping": 0.1, "stiffness": 1.3}),
    "kepler": (exact_kepler, {"eccentricity": 0.7, "periods": 0.9}),
    "forced": (exact_forced, {"rate": 1.7, "frequency": 2.3, "y0": 0.2}),
}


@functools.cache
def problem_named(name):
    return PROBLEMS[name](**EXACT[name][1])


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


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=() if name in ("oscillator", "kepler") else pytest.mark.slow)
        for name in EXACT
    ],
)
def test_the_bound_holds_and_is_half_a_unit(name):
    problem = problem_named(name)
    known = extended_solution(problem, time_limit=NEVER)
    assert known.failure is None
    assert known.agreed == len(problem.ts)
    error = np.abs((reals(known.states) - exact_states(name)).astype(np.float64))
    for quantity, bound in known.bounds.items():
        found = problem.quantity(quantity, error)
        units = problem.quantity(quantity, np.spacing(np.abs(known.states)))
        nodes = np.sqrt(np.sum(found**2, axis=2)).max(axis=1)
        assert np.all(nodes <= bound)
        assert np.all(bound <= 0.51 * np.max(np.sqrt(np.sum(units**2, axis=2))))


def test_more_bits_are_more_digits():
    exact = exact_states("forced")
    problem = problem_named("forced")
    for bits in (53, 80, 160):
        error = largest(solve(problem, precision=bits).states - exact)
        # Twenty-odd steps with a unit or two of rounding each.
        assert error < 60 * 2.0**-bits


def test_rounding_is_to_the_nearest():
    run = solve(problem_named("forced"))
    for entry, rounded in zip(run.states.flat, run.rounded.flat, strict=True):
        assert rounded == float(Fraction(str(entry)))


def test_samples_are_steps():
    few = Problem(lambda t, y, a: y * (1 - y), [0.1], [0.0, 0.3, 4.0])
    many = Problem(few.rhs, [0.1], np.linspace(0.0, 4.0, 101))
    for problem in (few, many):
        exact = 1 / (1 + (1 / real(0.1) - 1) * np.exp(-reals(problem.ts)))
        # An interpolant of the order that the step has errs like the step.
        assert largest(solve(problem).states[:, 0] - exact) < 1e-32


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


@pytest.mark.slow
def test_two_precisions_agree_on_a_chaotic_rope():
    problem = Rope(damping=0.0).problem(frames=100)
    known = extended_solution(problem, time_limit=NEVER)
    assert known.failure is None
    assert known.coarse.precision + 24 == known.fine.precision
    # In float64 the bound is 8e-8 here: rounding is amplified 1e6 times.
    assert known.bounds["position"][-1] < 0.51 * np.sqrt(2) * np.spacing(400.0)


@pytest.mark.slow
def test_digits_grow_with_what_is_lost():
    # x' = 8 x from 1e-20 loses 11.5 bits in each unit of time, 69 in all, beside y = 1.
    problem = Problem(
        lambda t, y, a: jnp.stack([jnp.sin(8 * y[0]), -y[1]]), [1e-20, 1.0], np.arange(6.0)
    )
    known = extended_solution(problem, digits=30, time_limit=NEVER)
    assert known.failure is None
    assert np.all(known.differences["state"] <= 1e-30)
    assert known.coarse.precision > 100 + 20


def test_runs_agree_to_the_digits_asked_for_wherever_they_end():
    """However much of them an unstable balance has lost by then."""
    for end in np.arange(1.0, 6.0):
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


def test_branches_are_those_just_after_the_start():
    # A fall from rest with the drag |v| v: v = -tanh(t).
    problem = Problem(lambda t, y, a: -1.0 - jnp.abs(y) * y, [0.0], np.arange(4.0))
    run = solve(problem)
    assert run.failure is None
    assert run.choices == ("abs",)
    assert largest(run.states[:, 0] + np.tanh(reals(problem.ts))) < 1e-32


def test_the_time_limit_ends_a_run():
    problem = problem_named("forced")
    run = solve(problem, time_limit=1e-9)
    assert run.reached < len(problem.ts)
    assert "time limit" in run.failure
    known = extended_solution(problem, time_limit=1e-9)
    assert "time limit" in known.failure
    assert len(known.states) == known.agreed < len(problem.ts)


def test_a_pole_ends_a_run():
    # At t = 2; no step gets past it.
    problem = Problem(lambda t, y, a: y * y, [0.5], np.arange(4.0))
    run = solve(problem)
    assert run.reached == 2
    assert run.failure == "stopped after t = 2: its steps become too short"
    # Before it all is well.
    known = extended_solution(problem, time_limit=NEVER)
    assert (known.agreed, known.failure) == (2, run.failure)


def test_what_is_not_finite_ends_a_run():
    run = solve(Problem(lambda t, y, a: jnp.sqrt(y - 1), [1.5], [0.0, 1.0], jump_times=[0.5]))
    assert run.failure is None
    run = solve(Problem(lambda t, y, a: jnp.log(1.5 - t) * y, [1.0], np.arange(4.0)))
    assert run.reached == 2
    assert run.failure.startswith("stopped after t = 1.")


@pytest.mark.parametrize(
    ("name", "given"), [("precision", 3), ("tolerance", 0.0), ("digits", 0), ("time_limit", -1.0)]
)
def test_arguments_are_checked(name, given):
    function = extended_solution if name in ("digits", "time_limit") else solve
    with pytest.raises(InputError, match=f"{name}: .*allowed: .*Fix: "):
        function(problem_named("forced"), **{name: given})


@pytest.mark.usefixtures("looked_at_as_for_users")
def test_what_a_step_passes_over_is_found_in_its_parts():
    """Its steps last several radians, and a polynomial of order 16 is right for a part of them."""

    def kicked(t, y, args):
        return jnp.stack([y[1], -y[0] + jnp.exp(-(((t - args) / 1e-4) ** 2))])

    ts = np.linspace(0.0, 20.0, 3)
    bounds = {"state": np.full(len(ts), 1e-16)}
    for centre, found in ((-1.0, 0), (14.321, 1)):
        problem = Problem(kicked, [1.0, 0.0], ts, args=centre)
        path = solve(problem, looked_into=True).path
        turned = np.stack([np.cos(path.times), -np.sin(path.times)], axis=1)
        # Times have a unit of rounding of 3.6e-15.
        np.testing.assert_allclose(path.states, turned, rtol=0, atol=1e-14)
        np.testing.assert_allclose(path.slopes[:, 1, 0], turned[1:, 1], rtol=0, atol=1e-14)
        seen = look_between(problem, path, bounds)
        assert len(seen.times) == found
        assert np.all(np.abs(seen.times - centre) < 1e-3)
