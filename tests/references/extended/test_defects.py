"""What is far below float64's rounding, and what decides where errors grow by many digits."""

from __future__ import annotations

import importlib

import jax.numpy as jnp
import numpy as np
import pytest

from ropeode import reference
from ropeode.problems import Problem, Rope
from ropeode.references import extended_solution
from ropeode.references.extended.taylor import solve

pytest.importorskip("heyoka", reason="heyoka is an extra")

TS = np.linspace(0.0, 12.0, 4)
CENTRE, WIDTH = 7.77, 1e-3


def turn(t, y, args):
    """A rotation, with a pulse of any height."""
    pulse = args * jnp.exp(-(((t - CENTRE) / WIDTH) ** 2))
    return jnp.stack([y[1], pulse - y[0]])


@pytest.fixture(scope="module")
def hanging():
    problem = Rope(num_nodes=2, damping=0.2).problem(frames=2)
    return problem, extended_solution(problem, time_limit=1e9)


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


def test_steps_solve_the_equation_to_the_tolerance_of_the_run(hanging):
    """Up to what the forces of a stiff rope lose when they cancel."""
    problem, run = hanging[0], hanging[1].fine
    look = run.defects.look(problem, {"position": np.ones(3), "velocity": np.ones(3)})
    moved = np.ptp(problem.ts) * np.max(np.abs(run.path.slopes))
    assert 0.0 < np.sum(look.share) < 1e6 * run.tolerance * moved
    inside = (look.t > look.low[look.step]) & (look.t < look.high[look.step])
    assert np.all(inside)


def test_an_unstable_balance_does_not_agree_with_itself():
    """From exactly zero nothing grows, but in the coarser run, which starts a little beside it."""
    problem = Problem(lambda t, y, a: 3.0 * y * (1.0 - y), [0.0], np.arange(21.0))
    known = extended_solution(problem, time_limit=1e9)
    assert known.agreed == 21
    np.testing.assert_array_equal(known.states, 0.0)
    growth = known.differences["state"][1:] / known.differences["state"][:-1]
    np.testing.assert_allclose(growth, np.exp(3.0), rtol=1e-6)
    # 26 digits are lost.
    assert known.coarse.precision > 60 + 86


def test_what_is_held_stays(hanging):
    _, known = hanging
    velocities = (known.coarse.states - known.fine.states)[:, 1].astype(float)
    np.testing.assert_array_equal(velocities[:, :, 0], 0.0)
    assert np.all(velocities[:, :, 1:] != 0.0)


@pytest.mark.slow
def test_what_grows_by_many_digits_ends_the_trust(monkeypatch):
    """Without the float64 solvers, which lose all digits sooner."""
    module = importlib.import_module("ropeode.references.extended.reference")
    monkeypatch.setattr(module, "_consensus", lambda *_: module._Evidence(None, None, ()))

    def rhs(t, y, args):
        pulse = 1e-24 * jnp.exp(-(((t - args) / 1e-3) ** 2))
        return jnp.stack([-y[0], 3.0 * y[1] + pulse])

    problem = Problem(rhs, [1.0, 0.0], np.linspace(0.0, 20.0, 5), args=2.2)
    known = reference(problem, level="extended", time_limit=1e9)
    assert known.certificate.witnesses[-1].role == "close look"
    assert known.horizon == 20.0
    grown = 1e-27 * np.sqrt(np.pi) * np.exp(3.0 * (problem.ts - 2.2))
    assert np.all(known.bound()[1:4] > grown[1:4])
    assert "near t = 2.199" in known.certificate.horizon_reason


def test_choices_at_the_start_do_not_hang_on_the_shift():
    """Drag that is quadratic in the velocity, from rest: it moves down, but the shift is up."""
    problem = Problem(
        lambda t, y, a: jnp.stack([y[1], -9.81 - 0.1 * y[1] * jnp.abs(y[1])]),
        [0.0, 0.0],
        [0.0, 0.5, 1.0],
    )
    known = extended_solution(problem, time_limit=1e9)
    assert known.agreed == 3
    limit = np.sqrt(9.81 / 0.1)
    exact = -limit * np.tanh(9.81 / limit * problem.ts)
    np.testing.assert_allclose(known.states[:, 1], exact, rtol=4e-16, atol=0)


def test_what_starts_from_rest_is_moved_by_a_part_of_its_own_speed():
    problem = Problem.second_order(
        lambda t, x, v, a: 1e-60 * x, [1.0], [0.0], np.linspace(0.0, 2.0, 3)
    )
    known = extended_solution(problem, time_limit=1e9)
    assert known.agreed == 3
    np.testing.assert_allclose(known.states[:, 1, 0], 1e-60 * problem.ts, rtol=2e-16)
