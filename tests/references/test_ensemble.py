"""References of many problems at a time: what each gets alone, whoever stands beside it."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

from ropeode import InputError, Problem, ReferenceRefused, each_reference, reference
from ropeode.problems import Ensemble
from ropeode.references import SCIPY_DOP853, solve, witness_runs
from ropeode.references.solvers.dop853 import solve as solve_side_by_side
from tests.references.covered import assert_covered
from tests.references.scalar_problems import scalar

TS = np.linspace(0.0, 2.0, 6)


def grows(rate, y0=1.0):
    """``y' = a sqrt(|y|)``, with ``y = (sqrt(y0) + a t / 2)^2``; from 0 it is not unique."""
    return scalar("root", y0, TS, rate)


def exact(problem):
    return (np.sqrt(problem.y0[0]) + problem.args[1] * problem.ts / 2) ** 2


RATES = (0.7, -0.6)
REFUSED = 2


@pytest.fixture(scope="module")
def many():
    return Ensemble.of([*map(grows, RATES), grows(0.5, y0=0.0)])


@pytest.fixture(scope="module")
def together(many):
    return reference(many)


def series(known):
    return {
        (w.role, w.tolerance): w.differences["state"].tobytes() for w in known.certificate.witnesses
    }


def test_each_member_has_the_states_that_it_has_alone(many, together):
    assert len(together) == len(many)
    with pytest.raises(ReferenceRefused) as alone:
        reference(many[REFUSED])
    assert str(together[REFUSED]) == str(alone.value)
    for problem, member in zip(list(many)[:REFUSED], together[:REFUSED], strict=True):
        alone = reference(problem)
        assert member.problem is problem
        assert member.states.tobytes() == alone.states.tobytes()
        differing = set(series(member).items()) ^ set(series(alone).items())
        assert {role for (role, _), _ in differing} <= {"independent", "more digits"}
        assert_covered(member, exact(problem)[:, None])


def test_a_member_does_not_depend_on_the_others(many, together):
    found = list(each_reference(Ensemble.of(list(many)[1::-1]), workers=2))[::-1]
    for once, again in zip(together, found, strict=False):
        assert once.states.tobytes() == again.states.tobytes()
        assert series(once) == series(again)
        assert once.bound().tobytes() == again.bound().tobytes()


def test_witnesses_can_be_made_again(together):
    known = together[0]
    ((_, run),) = witness_runs(known, roles=["independent"])
    again = np.abs(run.states - known.states)[:, 0]
    assert again.tobytes() == series(known)["independent", run.rtol]


def test_a_jump_is_left_to_the_solver_that_stops_there():
    jumps = [scalar("turns", y0, TS, 1.3, jump_times=[1.3]) for y0 in (1.0, 2.0)]
    for member in reference(Ensemble.of(jumps)):
        assert {w.solver for w in member.certificate.witnesses if w.role == "independent"} == {
            SCIPY_DOP853
        }
        assert abs(member.states[-1, 0] - member.problem.y0[0] * np.exp(0.6)) <= member.bound()[-1]


@pytest.mark.parametrize("name", ["rtol", "workers"])
def test_wrong_arguments_are_refused_before_anything_is_solved(many, name):
    with pytest.raises(InputError, match=name):
        each_reference(many, **{name: 0})


# The solver of many problems.


def swing(t, y, args):
    return jnp.stack([y[1], -args * jnp.sin(y[0])])


def pendulums(count):
    return [
        Problem(swing, [0.1 + 2.0 * k / count, 0.0], np.linspace(0.0, 5.0, 6), args=1.0 + k)
        for k in range(count)
    ]


def side_by_side(problems, rtols, max_steps=500):
    atols = [rtol * problem.scale for rtol, problem in zip(rtols, problems, strict=True)]
    return solve_side_by_side(problems, rtols, atols, max_steps=[max_steps] * len(problems))


def test_it_is_scipys_method_but_for_rounding():
    problems = pendulums(7)
    for problem, run in zip(problems, side_by_side(problems, [1e-10] * 7), strict=True):
        scipys = solve(problem, SCIPY_DOP853, 1e-10, 1e-10 * problem.scale, max_steps=1000)
        assert run.failure is None
        assert run.steps == scipys.steps
        # Rounding of each step, grown by no more than a few.
        np.testing.assert_allclose(run.states, scipys.states, rtol=0, atol=1e-13 * problem.scale)


def test_lanes_do_not_feel_each_other():
    """More problems than lanes, so that those that wait take the places of those that end."""
    many = 140
    problems, rtols = pendulums(many), np.logspace(-12, -4, many)

    def states(order):
        runs = side_by_side([problems[k] for k in order], rtols[order])
        return {k: (run.states.tobytes(), run.steps) for k, run in zip(order, runs, strict=True)}

    whole = states(list(range(many)))
    assert states(np.random.default_rng(1).permutation(many).tolist()) == whole
    for k in (0, many // 2, many - 1):
        assert states([k]) == {k: whole[k]}


def test_what_fails_says_where_and_holds_up_nobody():
    # y' = a y^2, with y = y0/(1 - a y0 t), which has a pole.
    problems = [scalar("square", 1.0, TS, a) for a in (0.3, 0.75, -1.0)]
    limits = [1000, 10**5, 3]
    fine, pole, short = solve_side_by_side(problems, [1e-10] * 3, [1e-10] * 3, max_steps=limits)
    assert fine.failure is None
    assert "t = 1.33" in str(pole.failure)
    assert len(pole.states) == 4
    assert "3 steps did not suffice" in str(short.failure)
    assert short.steps == 3
