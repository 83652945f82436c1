"""References of level `extended`, held against exact solutions and against the other level."""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from ropeode.errors import InputError, ReferenceRefused
from ropeode.norms import distance
from ropeode.problems.inextensible_rope import InextensibleRope
from ropeode.problems.library import PROBLEMS
from ropeode.problems.problem import Problem
from ropeode.problems.rope import Rope
from ropeode.references.certificate import largest_norms
from ropeode.references.compute import reference
from ropeode.references.extended import reference as module
from ropeode.references.files.store import load_reference, save_reference
from tests.problems.exact import EXACT

pytest.importorskip("heyoka", reason="heyoka is an extra")

# Seconds that no run takes, however busy the machine is.
NEVER = 1e9


@pytest.fixture
def alone(monkeypatch):
    """References without the float64 witness, which other tests look at."""
    monkeypatch.setattr(module, "_consensus", lambda *_: None)


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=() if name in ("kepler", "forced") else pytest.mark.slow)
        for name in EXACT
    ],
)
@pytest.mark.usefixtures("alone")
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
    "rope",
    [
        Rope(num_nodes=4, node_mass=(1, 2, 0.5, 1), damping=0.1, initial_velocity=(0.3, 1)),
        pytest.param(InextensibleRope(num_nodes=4, damping=0.3), marks=pytest.mark.slow),
    ],
    ids=["rope", "inextensible"],
)
@pytest.mark.usefixtures("alone")
def test_the_other_level_lies_within_its_bound(rope):
    problem = rope.problem(3)
    extended = reference(problem, level="extended", time_limit=NEVER)
    consensus = reference(problem)
    for norm in largest_norms(problem).values():
        apart = distance(problem, norm, consensus.states, extended.states)
        assert np.all(apart <= consensus.bound(norm))
        assert extended.bound(norm)[-1] < 0.1 * consensus.bound(norm)[-1]


@pytest.mark.usefixtures("alone")
def test_it_comes_back_from_a_file(tmp_path):
    known = reference(PROBLEMS["kepler"](frames=3), level="extended", time_limit=NEVER)
    found = load_reference(save_reference(known, tmp_path / "kepler.nc"))
    np.testing.assert_array_equal(found.states, known.states)
    assert found.certificate.level == "extended"
    assert found.certificate.witnesses[0].role == "fewer digits"
    assert found.trusted == known.trusted


@pytest.mark.usefixtures("alone")
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
        found = solution(problem, **more)
        states = found.states.copy()
        states[2:] *= 1 + 1e-9
        return dataclasses.replace(found, states=states)

    solution = module.extended_solution
    monkeypatch.setattr(module, "extended_solution", wrong)
    with pytest.raises(ReferenceRefused, match=r"from t = 2 on it is further from that of float64"):
        reference(PROBLEMS["oscillator"](frames=4), level="extended", time_limit=NEVER)


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
    problem = Problem(lambda t, y, args: jnp.sort(y), [2.0, 1.0], [0.0, 1.0])
    with pytest.raises(InputError, match="sort"):
        reference(problem, level="extended")
