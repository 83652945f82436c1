"""References of level `extended`, held against exact solutions and against the other level."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ropeode import reference
from ropeode.errors import InputError, ReferenceRefused
from ropeode.norms import distance
from ropeode.problems import PROBLEMS, InextensibleRope, Problem, Rope
from ropeode.references import extended_solution, largest_norms, load_reference, save_reference
from tests.problems.exact import EXACT

pytest.importorskip("heyoka", reason="heyoka is an extra")

# Seconds that no run takes, however busy the machine is.
NEVER = 1e9


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=() if name == "forced" else pytest.mark.slow) for name in EXACT],
)
def test_it_is_the_exact_solution_rounded(name):
    problem = PROBLEMS[name](frames=3)
    known = reference(problem, level="extended", time_limit=NEVER)
    assert known.certificate.level == "extended"
    exact = problem.exact(problem.ts)
    for quantity, norm in largest_norms(problem).items():
        # The exact solution is computed to a unit or two in the last place itself.
        size = np.max(np.abs(problem.quantity(quantity, exact)))
        apart = distance(problem, norm, known.states, exact)
        assert np.all(apart <= known.bound(norm) + 4 * np.finfo(float).eps * size)
        assert known.bound(norm)[-1] <= 2 * np.finfo(float).eps * size


@pytest.mark.parametrize(
    "make",
    [
        # What other tests here compile as well.
        PROBLEMS["kepler"],
        pytest.param(
            Rope(
                num_nodes=4, node_mass=(1, 2, 0.5, 1), damping=0.1, initial_velocity=(0.3, 1)
            ).problem,
            marks=pytest.mark.slow,
        ),
        pytest.param(InextensibleRope(num_nodes=4, damping=0.3).problem, marks=pytest.mark.slow),
    ],
    ids=["kepler", "rope", "inextensible"],
)
def test_the_other_level_lies_within_its_bound(make):
    problem = make(frames=3)
    extended = reference(problem, level="extended", time_limit=NEVER)
    consensus = reference(problem)
    for norm in largest_norms(problem).values():
        apart = distance(problem, norm, consensus.states, extended.states)
        assert np.all(apart <= consensus.bound(norm))
        assert extended.bound(norm)[-1] < 0.1 * consensus.bound(norm)[-1]


@pytest.mark.slow
def test_it_comes_back_from_a_file(tmp_path):
    known = reference(PROBLEMS["kepler"](frames=3), level="extended", time_limit=NEVER)
    found = load_reference(save_reference(known, tmp_path / "kepler.nc"))
    np.testing.assert_array_equal(found.states, known.states)
    assert found.certificate.level == "extended"
    assert found.certificate.witnesses[0].role == "fewer digits"
    assert found.trusted == known.trusted


def test_a_pole_ends_it():
    """y' = y^2 from 1 has the solution 1/(1 - t)."""
    problem = Problem(lambda t, y, args: y**2, [1.0], [0.0, 0.5, 0.9, 1.1])
    known = reference(problem, level="extended", time_limit=NEVER)
    assert known.trusted == 3
    assert known.horizon == 1.1
    assert known.certificate.horizon_reason
    np.testing.assert_allclose(known.states[:3, 0], [1, 2, 10], rtol=4e-16)


def test_what_float64_solvers_contradict_is_refused(monkeypatch):
    """As it would be if both runs stepped over the same thing, or were translated wrongly."""

    def wrong(problem, **more):
        found = extended_solution(problem, **more)
        states = found.states.copy()
        states[2:] *= 1 + 1e-9
        return dataclasses.replace(found, states=states)

    monkeypatch.setattr("ropeode.references.extended.reference.extended_solution", wrong)
    with pytest.raises(ReferenceRefused, match=r"from t = 2 on it is further from that of float64"):
        reference(PROBLEMS["oscillator"](frames=4), level="extended", time_limit=NEVER)


def pulse(t, y, args):
    centre, width = args
    return jnp.exp(-(((t - centre) / width) ** 2)) / (width * np.sqrt(np.pi)) - y


@pytest.mark.usefixtures("looked_at_as_for_users")
def test_the_trust_ends_where_some_float64_runs_see_what_others_pass_by():
    """A pulse that the runs in extended precision pass by, as some of the others do."""
    ts = np.arange(11.0)
    known = reference(Problem(pulse, [1.0], ts, (6.4, 1e-3)), level="extended", time_limit=NEVER)
    assert (known.trusted, known.horizon) == (7, 7.0)
    assert "some float64 solvers see something" in known.certificate.horizon_reason
    np.testing.assert_allclose(known.states[:7, 0], np.exp(-ts[:7]), rtol=1e-15)
    early = Problem(pulse, [1.0], ts, (0.64, 1e-3))
    with pytest.raises(ReferenceRefused, match="some float64 solvers see .* already at t = 1"):
        reference(early, level="extended", time_limit=NEVER)


def test_float64_solvers_are_among_the_witnesses():
    known = reference(PROBLEMS["oscillator"](frames=4), level="extended", time_limit=NEVER)
    roles = [witness.role for witness in known.certificate.witnesses]
    assert roles == ["fewer digits", "independent"]
    assert known.certificate.witnesses[1].difference < 1e-10


def test_no_time_is_told():
    with pytest.raises(ReferenceRefused, match="time limit"):
        reference(PROBLEMS["forced"](frames=3, frequency=99), level="extended", time_limit=1e-9)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"rtol": 1e-9}, "rtol: .* none with level 'extended'"),
        ({"digits": 0}, "digits: 0 given"),
        ({"time_limit": -1}, "time_limit: -1 given"),
        ({"accuracy": 0}, "accuracy: 0 given"),
    ],
)
def test_faults(more, words):
    with pytest.raises(InputError, match=words):
        reference(PROBLEMS["oscillator"](), level="extended", **more)


def test_levels_that_do_not_exist():
    with pytest.raises(InputError, match="level: 'exact' given"):
        reference(PROBLEMS["oscillator"](), level="exact")


def test_what_cannot_be_translated_is_named():
    problem = Problem(lambda t, y, args: jax.lax.digamma(y), [2.0, 1.0], [0.0, 1.0])
    with pytest.raises(InputError, match="digamma"):
        reference(problem, level="extended")


def pulsed(centre):
    def rhs(t, y, args):
        return jnp.exp(-(((t - args) / 1e-3) ** 2)) - y

    return Problem(rhs, [1.0], np.arange(11.0), args=centre)


@pytest.mark.usefixtures("looked_at_as_for_users")
def test_a_pulse_that_both_runs_step_over_ends_it():
    known = reference(pulsed(6.4), level="extended", time_limit=NEVER)
    assert known.horizon == 7.0
    assert np.all(np.abs(known.states[:7, 0] - np.exp(-known.times[:7])) <= 1e-15)
    assert known.certificate.sampling.times > 2**20
    with pytest.raises(ReferenceRefused, match="for 'problem'"):
        reference(pulsed(0.64), level="extended", time_limit=NEVER)


@pytest.mark.slow
@pytest.mark.parametrize("width", [5.2e-3, 1.3e-3, 2.6e-3])
@pytest.mark.usefixtures("looked_at_as_for_users")
def test_pulses_longer_than_the_parts_of_a_step_are_found(width):
    """In a part they are smooth, and the Taylor series of the step has not a trace of them."""

    def rhs(t, y, args):
        pulse = args["height"] * jnp.exp(-(((t - 0.6113) / args["width"]) ** 2))
        return 0.5687 * (33.0 * y - 20.0) + pulse

    # As near to an unstable balance as float64 numbers are.
    args = {"height": 5.7e-11, "width": width}
    problem = Problem(rhs, [20.0 / 33.0], [0.0, 2.077], args)
    try:
        known = reference(problem, level="extended", accuracy=1e-3)
    except ReferenceRefused:
        return
    told = dataclasses.replace(problem, jump_times=0.6113 + width * np.array([-8.0, 0.0, 8.0]))
    apart = known.states - reference(told, level="extended", accuracy=1e-3).states
    assert abs(apart[-1, 0]) <= known.bound()[-1]
