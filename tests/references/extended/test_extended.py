"""Solutions in extended precision: how accurate they are, and what ends the trust in them."""

from __future__ import annotations

import dataclasses
import importlib
from fractions import Fraction

import jax.numpy as jnp
import numpy as np
import pytest

from ropeode import reference
from ropeode.errors import ReferenceRefused
from ropeode.problems import PROBLEMS, InextensibleRope, Problem, Rope
from ropeode.references import extended_solution
from ropeode.references.extended.taylor import solve
from tests.references.covered import assert_covered
from tests.references.scalar_problems import scalar
from tests.verification.extrapolation import rope_sizes, rope_solution

heyoka = pytest.importorskip("heyoka", reason="heyoka is an extra")

BITS = 200
# Seconds that no run takes, however busy the machine is.
NEVER = 1e9


def extended(problem, **options):
    return reference(problem, level="extended", time_limit=NEVER, **options)


def solved(problem):
    """The two runs in extended precision, without a float64 solver beside them."""
    return extended_solution(problem, time_limit=NEVER)


# How accurate they are.


def reals(array):
    """Numbers as `heyoka.real`, extended precision included, without rounding."""
    flat = [heyoka.real(number, BITS) for number in np.asarray(array, dtype=np.longdouble).flat]
    return np.array(flat).reshape(np.shape(array))


def largest(apart):
    return float(np.max(np.abs(apart.astype(np.float64))))


# x'' = 2 x^3, with x = 1 / (1 - t): the exact states are fractions.
BODY = Problem.second_order(
    lambda t, x, v, args: 2.0 * x**3, [1.0], [1.0], [0.0, 0.1, 0.3, 0.5], name="body"
)


def wrong(states):
    """How far states of `BODY` are from the exact ones, ``(times, 2)``."""
    exact = [(1 / (1 - t), 1 / (1 - t) ** 2) for t in map(Fraction, BODY.ts)]
    found = [Fraction(each if isinstance(each, float) else str(each)) for each in states.flat]
    return np.abs(np.array(found).reshape(-1, 2) - exact).astype(np.float64)


def test_an_exact_solution_to_thirty_digits():
    run = solve(BODY)
    assert run.failure is None
    assert run.precision == 113
    # Some ten steps with errors of 2e-34 each.
    assert np.max(wrong(run.states)) < 1e-31
    assert np.max(wrong(solve(BODY, precision=160).states)) < 1e-44
    for entry, rounded in zip(run.states.flat, run.rounded.flat, strict=True):
        assert rounded == float(Fraction(str(entry)))


def test_the_bound_holds_and_is_half_a_unit():
    """Float64 solvers are among the witnesses."""
    known = extended(BODY)
    assert known.horizon is None
    bounds = np.stack([*known.certificate.bounds.values()], axis=1)
    assert np.all(wrong(known.states) <= bounds)
    assert np.all(bounds <= 0.51 * np.spacing(known.states[..., 0]))
    fewer, independent = known.certificate.witnesses
    assert (fewer.role, independent.role) == ("fewer digits", "independent")
    assert independent.difference < 1e-10


@pytest.mark.parametrize("kind", [Rope, pytest.param(InextensibleRope, marks=pytest.mark.slow)])
def test_ropes_against_extrapolation(kind):
    """Both levels: the one to the last digits, the other within its bound."""
    problem = kind(num_nodes=4, damping=0.02).problem(frames=3)
    truth = rope_solution(problem)
    # The extrapolation knows positions to 1e-17 of their size, velocities to that of theirs.
    apart = solve(problem).states - reals(truth)
    assert largest(apart / reals(rope_sizes(problem.args, problem.y0))) < 4e-17
    assert_covered(reference(problem), truth)


def test_runs_agree_to_the_digits_asked_for_wherever_they_end():
    """However much of them an unstable balance has lost by then."""
    for end in (1.0, 5.0):
        problem = Problem(lambda t, y, a: jnp.stack([3 * y[0], -y[1]]), [0.0, 1.0], [0.0, end])
        known = extended_solution(problem, digits=15, time_limit=NEVER)
        assert known.agreed == 2
        assert np.all(known.differences["state"] <= 1e-15)


# What ends them.


def test_a_pole_ends_it():
    """y' = y^2 from 1 has the solution 1/(1 - t)."""
    ts = np.array([0.0, 0.3, 0.5, 0.9, 1.1, 1.2])
    known = extended(scalar("square", 1.0, ts))
    assert (known.trusted, known.horizon) == (4, 1.1)
    assert "its steps become too short" in known.certificate.horizon_reason
    np.testing.assert_allclose(known.states[:4, 0], 1 / (1 - ts[:4]), rtol=1e-15)


def test_jumps_are_declared_or_end_the_run():
    def jump(t, y, a):
        return jnp.where(t < 1.3, y, -y)

    problem = Problem(jump, [1.0], np.arange(4.0), jump_times=[1.3])
    run = solve(problem)
    assert run.failure is None
    ts, at = reals(problem.ts), reals(1.3)
    exact = np.exp(np.where(problem.ts < 1.3, ts, 2 * at - ts))
    assert largest(run.states[:, 0] - exact) < 1e-32
    found = solved(Problem(jump, [1.0], np.arange(4.0)))
    assert (found.agreed, len(found.states)) == (2, 2)
    assert "'lt' in the right-hand side takes another branch" in found.failure


def test_what_is_not_finite_ends_a_run_and_so_does_its_time():
    run = solve(Problem(lambda t, y, a: jnp.sqrt(y - 1), [1.5], [0.0, 1.0], jump_times=[0.5]))
    assert run.failure is None
    run = solve(Problem(lambda t, y, a: jnp.log(1.5 - t) * y, [1.0], np.arange(4.0)))
    assert run.reached == 2
    assert run.failure.startswith("stopped after t = 1.")
    with pytest.raises(ReferenceRefused, match="time limit"):
        reference(PROBLEMS["forced"](frequency=99), level="extended", time_limit=1e-9)


def test_float64_solvers_must_not_contradict(monkeypatch):
    """As they would if both runs stepped over the same thing, or were translated wrongly."""

    def wrong(problem, **more):
        found = extended_solution(problem, **more)
        found.states[2:] *= 1 + 1e-9
        return found

    monkeypatch.setattr("ropeode.references.extended.reference.extended_solution", wrong)
    with pytest.raises(
        ReferenceRefused, match=r"from t = .* on it is further from that of float64"
    ):
        extended(BODY)


@pytest.mark.slow
@pytest.mark.usefixtures("looked_at_as_for_users")
def test_the_trust_ends_at_a_pulse_that_both_runs_pass_by():
    """At t = 3.3; some of the float64 runs pass by it too."""
    ts, reason = np.arange(6.0), "some float64 solvers see something"
    known = extended(scalar("tall pulse", 0.0, ts, 1e-3))
    assert (known.trusted, known.horizon) == (4, 4.0)
    assert reason in known.certificate.horizon_reason
    np.testing.assert_allclose(known.states[:4, 0], -np.expm1(-ts[:4]), rtol=1e-15)
    with pytest.raises(ReferenceRefused, match=f"for 'tall pulse'.*{reason}"):
        extended(scalar("tall pulse", 0.0, 2.66 + ts, 1e-3))


@pytest.mark.slow
@pytest.mark.usefixtures("looked_at_as_for_users")
def test_a_pulse_longer_than_the_parts_of_a_step_is_found():
    """In a part it is smooth, and the Taylor series of the step has not a trace of it."""
    width = 2.6e-3

    def rhs(t, y, args):
        pulse = args * jnp.exp(-(((t - 0.6113) / width) ** 2))
        return 0.5687 * (33.0 * y - 20.0) + pulse

    # As near to an unstable balance as float64 numbers are.
    problem = Problem(rhs, [20.0 / 33.0], [0.0, 2.077], 5.7e-11)
    try:
        known = reference(problem, level="extended", accuracy=1e-3)
    except ReferenceRefused:
        return
    told = dataclasses.replace(problem, jump_times=0.6113 + width * np.array([-8.0, 0.0, 8.0]))
    apart = known.states - reference(told, level="extended", accuracy=1e-3).states
    assert abs(apart[-1, 0]) <= known.bound()[-1]


# What is far below float64's rounding, and what decides where errors grow by many digits.

TS = np.linspace(0.0, 12.0, 4)
CENTRE, WIDTH = 7.77, 1e-3


def turn(t, y, args):
    """A rotation, with a pulse of any height."""
    pulse = args * jnp.exp(-(((t - CENTRE) / WIDTH) ** 2))
    return jnp.stack([y[1], pulse - y[0]])


def test_a_pulse_far_below_rounding_is_found():
    height = 1e-24
    problem = Problem(turn, [1.0, 0.0], TS, args=height)
    run = solve(problem, looked_into=True)
    area = height * WIDTH * np.sqrt(np.pi)
    for units in (0.5, 2.0):
        look = run.defects.look(problem, {"state": np.full(4, units * area)})
        assert np.sum(look.share > 1e-3) == 1
        # Its whole area is seen, and nothing else.
        np.testing.assert_allclose(np.sum(look.share), 1 / units, rtol=1e-3)
        assert abs(look.t[np.argmax(look.size)] - CENTRE) < WIDTH
    # Where the solution is not trusted, it does not matter.
    short = run.defects.look(problem.until(2), {"state": np.full(2, area)})
    assert np.sum(short.share) < 1e-6


def test_an_unstable_balance_does_not_agree_with_itself():
    """From exactly zero nothing grows, but in the coarser run, which starts a little beside it."""
    problem = Problem(lambda t, y, a: 3.0 * y * (1.0 - y), [0.0], np.arange(21.0))
    known = solved(problem)
    assert known.agreed == 21
    np.testing.assert_array_equal(known.states, 0.0)
    growth = known.differences["state"][1:] / known.differences["state"][:-1]
    np.testing.assert_allclose(growth, np.exp(3.0), rtol=1e-6)
    # 26 digits are lost.
    assert known.coarse.precision > 60 + 86


def test_what_is_held_stays_and_steps_solve_the_equation():
    """Up to what the forces of a stiff rope lose when they cancel."""
    problem = Rope(num_nodes=2, damping=0.2).problem(frames=2)
    known = solved(problem)
    velocities = (known.coarse.states - known.fine.states)[:, 1].astype(float)
    np.testing.assert_array_equal(velocities[:, :, 0], 0.0)
    assert np.all(velocities[:, :, 1:] != 0.0)
    run = known.fine
    look = run.defects.look(problem, {"position": np.ones(3), "velocity": np.ones(3)})
    moved = np.ptp(problem.ts) * np.max(np.abs(run.path.slopes))
    assert 0.0 < np.sum(look.share) < 1e6 * run.tolerance * moved


@pytest.mark.slow
def test_what_grows_by_many_digits_ends_the_trust(monkeypatch):
    """Without the float64 solvers, which lose all digits sooner."""
    module = importlib.import_module("ropeode.references.extended.reference")
    monkeypatch.setattr(module, "_consensus", lambda *_: module._Evidence(None, None, ()))

    def rhs(t, y, args):
        pulse = 1e-24 * jnp.exp(-(((t - args) / 1e-3) ** 2))
        return jnp.stack([-y[0], 3.0 * y[1] + pulse])

    problem = Problem(rhs, [1.0, 0.0], np.linspace(0.0, 20.0, 5), args=2.2)
    known = extended(problem)
    assert known.certificate.witnesses[-1].role == "close look"
    assert known.horizon == 20.0
    grown = 1e-27 * np.sqrt(np.pi) * np.exp(3.0 * (problem.ts - 2.2))
    assert np.all(known.bound()[1:4] > grown[1:4])
    assert "near t = 2.199" in known.certificate.horizon_reason


def test_what_starts_from_rest_is_moved_by_a_part_of_its_own_speed():
    known = solved(Problem.second_order(lambda t, x, v, a: 1e-60 * x, [1.0], [0.0], TS))
    assert known.agreed == 4
    np.testing.assert_allclose(known.states[:, 1, 0], 1e-60 * TS, rtol=2e-16)

    # Drag that is quadratic in the velocity: it moves down, but the shift is up.
    def falls(t, y, args):
        return jnp.stack([y[1], -9.81 - 0.1 * y[1] * jnp.abs(y[1])])

    known = solved(Problem(falls, [0.0, 0.0], TS / 12))
    assert known.agreed == 4
    limit = np.sqrt(9.81 / 0.1)
    exact = -limit * np.tanh(9.81 / limit * TS / 12)
    np.testing.assert_allclose(known.states[:, 1], exact, rtol=4e-16, atol=0)
