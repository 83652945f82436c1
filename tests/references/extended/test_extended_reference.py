"""References of level `extended`, held against the other level and what both may miss."""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from ropeode import reference
from ropeode.errors import ReferenceRefused
from ropeode.norms import distance
from ropeode.problems import PROBLEMS, InextensibleRope, Problem, Rope
from ropeode.references import extended_solution, largest_norms
from tests.references.scalar_problems import scalar

pytest.importorskip("heyoka", reason="heyoka is an extra")

# Seconds that no run takes, however busy the machine is.
NEVER = 1e9


def extended(problem, **options):
    return reference(problem, level="extended", time_limit=NEVER, **options)


@pytest.mark.slow
@pytest.mark.parametrize(
    "make",
    [
        Rope(num_nodes=4, node_mass=(1, 2, 0.5, 1), damping=0.1, initial_velocity=(0.3, 1)).problem,
        InextensibleRope(num_nodes=4, damping=0.3).problem,
    ],
    ids=["rope", "inextensible"],
)
def test_the_other_level_lies_within_its_bound(make):
    problem = make(frames=3)
    known, consensus = extended(problem), reference(problem)
    for norm in largest_norms(problem).values():
        apart = distance(problem, norm, consensus.states, known.states)
        assert np.all(apart <= consensus.bound(norm))
        assert known.bound(norm)[-1] < 0.1 * consensus.bound(norm)[-1]


def test_a_pole_ends_it():
    """y' = y^2 from 1 has the solution 1/(1 - t)."""
    ts = np.array([0.0, 0.3, 0.5, 0.9, 1.1, 1.2])
    known = extended(scalar("square", 1.0, ts))
    assert (known.trusted, known.horizon) == (4, 1.1)
    assert "its steps become too short" in known.certificate.horizon_reason
    np.testing.assert_allclose(known.states[:4, 0], 1 / (1 - ts[:4]), rtol=1e-15)


def test_float64_solvers_are_among_the_witnesses_and_none_may_contradict(monkeypatch):
    """As they would if both runs stepped over the same thing, or were translated wrongly."""
    problem = PROBLEMS["oscillator"](frames=4)
    fewer, independent = extended(problem).certificate.witnesses
    assert (fewer.role, independent.role) == ("fewer digits", "independent")
    assert independent.difference < 1e-10

    def wrong(problem, **more):
        found = extended_solution(problem, **more)
        states = found.states.copy()
        states[2:] *= 1 + 1e-9
        return dataclasses.replace(found, states=states)

    monkeypatch.setattr("ropeode.references.extended.reference.extended_solution", wrong)
    with pytest.raises(ReferenceRefused, match=r"from t = 2 on it is further from that of float64"):
        extended(problem)


@pytest.mark.usefixtures("looked_at_as_for_users")
@pytest.mark.parametrize(
    ("equation", "reason"),
    [
        ("tall pulse", "some float64 solvers see something"),
        pytest.param("pulse", "", marks=pytest.mark.slow),
    ],
)
def test_the_trust_ends_at_a_pulse_that_both_runs_pass_by(equation, reason):
    """At t = 3.3; some of the float64 runs pass by it too."""
    ts = np.arange(6.0)
    known = extended(scalar(equation, 0.0, ts, 1e-3))
    assert (known.trusted, known.horizon) == (4, 4.0)
    assert reason in known.certificate.horizon_reason
    np.testing.assert_allclose(known.states[:4, 0], -np.expm1(-ts[:4]), rtol=1e-15)
    with pytest.raises(ReferenceRefused, match=f"for '{equation}'.*{reason}"):
        extended(scalar(equation, 0.0, 2.66 + ts, 1e-3))


def test_no_time_is_told():
    problem = PROBLEMS["forced"](frames=3, frequency=99)
    with pytest.raises(ReferenceRefused, match="time limit"):
        reference(problem, level="extended", time_limit=1e-9)


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
