"""How long a reference may take, where it ends then, and problems that no time suffices for."""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from ropeode import InputError, Problem, ReferenceRefused, reference
from ropeode.references import first_rung
from ropeode.references.certificate import bounds, witness
from ropeode.references.hints import coarse_times, hints, remarks, unresolved_motion
from ropeode.references.options import ReferenceOptions
from ropeode.references.solvers import diffrax_solver, jacobian_pattern, scipy_solver
from ropeode.references.solvers.jacobian_pattern import sparsity
from ropeode.references.solvers.solution import Solution
from ropeode.references.solvers.solver import DOPRI8, KVAERNO5, OWN_DOP853, SCIPY_BDF, SCIPY_RADAU
from ropeode.references.witnesses import witness_runs
from ropeode.render import describe_reference
from tests.references.scalar_problems import scalar

TS = np.linspace(0.0, 2.5, 6)
EPS64 = np.finfo(np.float64).eps


def steps_of(monkeypatch):
    """The steps of each run of the primary solver, as they are made."""
    steps, solve = [], diffrax_solver.solve

    def counted(problem, solver, *inputs, **more):
        run = solve(problem, solver, *inputs, **more)
        steps.append((solver, run.steps))
        return run

    monkeypatch.setattr(diffrax_solver, "solve", counted)
    return steps


@pytest.mark.parametrize(
    ("name", "y0", "number", "pole"),
    [("square", 1.0, 1.1, 1 / 1.1), ("square", 1.0, 0.7, 1 / 0.7), ("tan", 0.0, 1.0, np.pi / 2)],
)
def test_a_pole_ends_the_horizon_after_few_steps(monkeypatch, name, y0, number, pole):
    steps = steps_of(monkeypatch)
    known = reference(scalar(name, y0, TS, number))
    assert known.trusted == np.sum(pole > TS)
    assert "step size has become too small" in known.certificate.horizon_reason
    assert f"t = {pole:g}" in known.certificate.horizon_reason
    assert sum(count for _, count in steps) < 20_000


def test_a_pole_before_the_first_sample_is_a_refusal_after_one_run(monkeypatch):
    steps = steps_of(monkeypatch)
    with pytest.raises(ReferenceRefused, match="t = 0.25: the step size has become too small"):
        reference(scalar("square", 4.0, TS))
    assert len(steps) == 1
    assert steps[0][1] < 2000


@pytest.mark.parametrize("y0", [0.7, pytest.param(1.6, marks=pytest.mark.slow)])
def test_where_it_chatters_no_run_but_the_first_tries_to_go_on(monkeypatch, y0):
    """y' = -sign(y) comes to zero, and jumps back and forth from then on."""
    most = 10_000
    monkeypatch.setattr(first_rung, "_MOST_STEPS", most)
    steps = steps_of(monkeypatch)
    known = reference(scalar("sign", y0, TS))
    assert known.trusted == np.sum(y0 > TS)
    # Twice the explicit solver, the implicit one, and then only up to the last sample.
    assert steps[0] == (DOPRI8, most)
    assert sum(count for _, count in steps[1:]) < 0.8 * most


def long(monkeypatch, most, **more):
    """An oscillation for which the first run's steps do not suffice."""
    monkeypatch.setattr(first_rung, "_MOST_STEPS", most)
    return scalar("follows", 0.0, np.linspace(0.0, 1000.0, 6), 0.0, **more)


def test_a_steady_run_gets_the_steps_that_it_needs(monkeypatch):
    steps = steps_of(monkeypatch)
    known = reference(long(monkeypatch, 300))
    assert known.horizon is None
    assert not known.certificate.stiff
    np.testing.assert_allclose(known.states[:, 0], np.sin(known.problem.ts), atol=1e-9)
    assert steps[:2] == [(DOPRI8, 300), (KVAERNO5, 30)]
    assert max(count for _, count in steps) > 600


def test_what_gets_further_in_a_tenth_of_the_steps_is_stiff(monkeypatch):
    monkeypatch.setattr(first_rung, "_MOST_STEPS", 2000)
    known = reference(scalar("follows", 0.0, TS, -1e5), rtol=1e-6)
    assert known.certificate.stiff
    assert known.horizon is None


def test_the_time_limit_ends_the_horizon(monkeypatch):
    """As if each step took a millisecond."""
    solve = diffrax_solver.solve

    def slow(*inputs, **more):
        run = solve(*inputs, **more)
        return dataclasses.replace(run, seconds=1e-3 * run.steps)

    monkeypatch.setattr(diffrax_solver, "solve", slow)
    problem = long(monkeypatch, 10**6)
    known = reference(problem, time_limit=9.0)
    assert 2 <= known.trusted < len(problem.ts)
    assert "time limit of 9 s is spent" in known.certificate.horizon_reason
    np.testing.assert_allclose(
        known.states[: known.trusted, 0], np.sin(problem.ts[: known.trusted]), atol=1e-9
    )
    with pytest.raises(
        ReferenceRefused, match=r"time limit is 1 s. Allow more time \(time_limit\)"
    ):
        reference(problem, time_limit=1.0)


def test_a_run_stops_when_its_time_is_up():
    problem = scalar("follows", 0.0, np.linspace(0.0, 1e8, 6), 0.0)
    for solver in (DOPRI8, KVAERNO5):
        run = diffrax_solver.solve(problem, solver, 1e-8, 1e-8, seconds=0.05)
        assert run.ran_out
        assert run.failure.endswith("its time was up")
        assert run.seconds < 2.0
        assert 0.0 < run.reached < 1e8


def test_a_limit_that_is_not_reached_changes_nothing():
    problem = scalar("follows", 0.0, np.linspace(0.0, 4e3, 6), 0.0)
    free = diffrax_solver.solve(problem, DOPRI8, 1e-8, 1e-8)
    limited = diffrax_solver.solve(problem, DOPRI8, 1e-8, 1e-8, seconds=100.0)
    assert free.steps > 4096
    assert (limited.steps, limited.states.tobytes()) == (free.steps, free.states.tobytes())


def test_large_times_are_said_to_be_coarse():
    problem = scalar("follows", 0.0, 1e9 + np.linspace(0.0, 1e-3, 6), -1e5)
    with pytest.raises(ReferenceRefused, match="1.2e-07 apart.*let t start at 0") as refused:
        reference(problem, accuracy=1e-12)
    assert str(refused.value).count("apart") == 1
    for start, length in ((0.0, 1e-9), (1e6, 1e3), (-1e9, 1e6)):
        fine = scalar("follows", 0.0, start + np.linspace(0.0, length, 6))
        assert not coarse_times(fine, steps=100)
    growing = scalar("follows", 0.0, np.array([0.0, 1e-9, 1.0, 1e4, 1e8, 1e11]))
    assert not coarse_times(growing, steps=100)
    near = scalar("follows", 0.0, np.array([0.0, 1.0, 2.0, 3.0, 1e11, 1e11 + 1.0]))
    assert "samples that are further apart" in coarse_times(near, steps=100)


def test_components_of_different_size_are_named():
    run = solution(states=np.array([[1e3, 1e-6], [2e3, 0.0]]))
    assert "from 1.0e-06 to 2.0e+03" in hints(scalar("decay", 1.0, TS), run)
    for other in (
        solution(states=np.array([[1e3, 1.0], [2e3, 0.0]])),
        solution(states=np.array([[1e3, 1e-6]]), atol=np.array([1e-5, 1e-14])),
        solution(states=np.zeros((1, 2))),
    ):
        assert hints(scalar("decay", 1.0, TS), other) == ""


def solution(states, atol=1e-8):
    return Solution(DOPRI8, 1e-8, atol, states, steps=10, seconds=0.0)


def test_each_component_may_have_its_tolerance():
    problem = scalar("decay", 1.0, np.linspace(0.0, 50.0, 6))
    default = reference(problem, rtol=1e-8)
    assert default.certificate.atol == 1e-8
    known = reference(problem, rtol=1e-8, atol=[1e-40])
    np.testing.assert_array_equal(known.certificate.atol, [1e-40])
    exact = np.exp(-problem.ts)
    np.testing.assert_allclose(known.states[:, 0], exact, rtol=1e-6)
    assert abs(default.states[-1, 0] - exact[-1]) > exact[-1]
    with pytest.raises(InputError, match="atol.*one number, or an array of the state's shape"):
        reference(problem, atol=[1e-8, 1e-9])
    (_, again), *_ = witness_runs(known, roles=["neighbour"])
    assert again.steps == next(
        w.steps for w in known.certificate.witnesses if w.role == "neighbour"
    )


@pytest.mark.parametrize("atol", [0.0, -1e-8, np.nan, "much", [1e-8, 0.0]])
def test_bad_tolerances(atol):
    with pytest.raises(InputError, match="atol"):
        ReferenceOptions(atol=atol)


def test_options_say_what_would_be_allowed():
    for given, words in (
        ({"atol": np.inf}, "atol: inf given; .* Fix: for example 1e-20"),
        ({"atol": {"x": 1.0}}, "atol: {'x': 1.0} given; .* one number for each component"),
        ({"level": "extended", "digits": 301}, "digits: 301 given; .* whole number from 1 to 300"),
    ):
        with pytest.raises(InputError, match=words):
            ReferenceOptions(**given)
    problem = scalar("decay", 1.0, np.linspace(0.0, 50.0, 6))
    with pytest.raises(InputError, match="atol: 1e\\+300 given; .* finite when divided by rtol"):
        reference(problem, atol=1e300)


def test_no_tolerance_in_extended_precision():
    with pytest.raises(InputError, match="atol.*none with level 'extended'"):
        ReferenceOptions(atol=1e-20, level="extended")


def test_a_bound_larger_than_the_motion_is_told():
    """A clock of 1.7e9 in the state, in frames of 2e-7."""
    problem = scalar("follows", 1.7e9, 2e-7 * np.arange(6), 0.0)
    known = reference(problem)
    assert known.bound()[-1] > 1.2e-6
    (remark,) = remarks(known)
    assert "the solution moves by" in remark
    assert remark in " ".join(describe_reference(known).split())
    with pytest.raises(ReferenceRefused, match="which is not resolved by a bound of"):
        reference(problem, accuracy=1e-8)
    assert remarks(reference(scalar("follows", 1.7e9, TS, 0.0))) == ()


def test_of_what_rests_nothing_is_told():
    problem = scalar("decay", 1.0, TS)
    still, bound = np.ones((2, 1)), np.full(2, 1e-16)
    assert unresolved_motion(problem, still, bound) == ""
    moved = still - [[0.0], [0.5]]
    assert "moves by 5.0e-01 only" in unresolved_motion(problem, moved, np.ones(2))


def test_times_that_are_large_are_told_of_what_is_trusted():
    problem = scalar("decay", 1.0, 1e9 + 1e-3 * np.arange(6))
    assert ["let t start at 0" in remark for remark in remarks(reference(problem))] == [True]


def oscillator(ts):
    def rhs(t, y, args):
        return jnp.stack([y[1], -y[0]])

    return Problem(rhs, [1.0, 0.0], ts)


@pytest.mark.slow
def test_twenty_thousand_frames():
    problem = oscillator(0.1 * np.arange(20_001))
    known = reference(problem)
    assert known.horizon is None
    assert known.certificate.seconds < 10.0
    assert np.all(np.abs(known.states[:, 0] - np.cos(problem.ts)) <= known.bound())


@pytest.mark.slow
@pytest.mark.parametrize("samples", [2, 101])
def test_a_hundred_thousand_units_of_time(samples):
    problem = oscillator(np.linspace(0.0, 1e5, samples))
    # The work is allowed; how long it takes depends on the machine.
    known = reference(problem, time_limit=600.0)
    assert known.horizon is None
    assert OWN_DOP853 in [witness.solver for witness in known.certificate.witnesses]
    assert np.all(np.abs(known.states[:, 0] - np.cos(problem.ts)) <= known.bound())


@pytest.mark.slow
def test_what_takes_too_long_ends_where_the_time_does():
    problem = oscillator(np.linspace(0.0, 1e7, 1001))
    known = reference(problem, accuracy=1e-6, time_limit=20.0)
    assert 2 <= known.trusted < 1001
    assert "the time limit of 20 s is spent" in known.certificate.horizon_reason
    inside = problem.ts[: known.trusted]
    assert np.all(np.abs(known.states[: known.trusted, 0] - np.cos(inside)) <= known.bound())
    with pytest.raises(ReferenceRefused, match="time_limit"):
        reference(oscillator([0.0, 1e7]), time_limit=5.0)


@pytest.mark.slow
def test_friction_that_sticks():
    """From rest at 0.8; it sticks at t = pi."""

    def acceleration(t, x, v, args):
        return -x - jnp.sign(v) / 2

    problem = Problem.second_order(acceleration, [0.8], [0.0], np.arange(11.0))
    known = reference(problem)
    assert known.horizon == 4.0
    assert known.certificate.seconds < 10.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("acceleration", "x0", "v0", "pole"),
    [
        (lambda t, x, v, args: 6 * x * x, 1.0, 2.0, 1.0),
        (lambda t, x, v, args: -0.5 / (x * jnp.abs(x)), 1.0, 0.0, np.pi / 2),
    ],
)
def test_poles_and_collisions(acceleration, x0, v0, pole):
    ts = np.linspace(0.0, 2.0, 21)
    known = reference(Problem.second_order(acceleration, [x0], [v0], ts))
    assert known.horizon == ts[np.sum(ts < pole)]
    assert known.certificate.seconds < 3.0


def diffusion(points, end):
    def rhs(t, y, args):
        wide = jnp.pad(y, 1)
        return (wide[2:] - 2 * y + wide[:-2]) * (points + 1) ** 2

    x = np.arange(1, points + 1) / (points + 1)
    return Problem(rhs, np.sin(np.pi * x), [0.0, end])


@pytest.mark.slow
def test_a_large_stiff_problem():
    points = 2000
    known = reference(diffusion(points, 0.1))
    assert known.horizon is None
    assert_true(known, points)


@pytest.fixture
def forty_are_large(monkeypatch):
    """Problems of 40 unknowns are as large as those of 2000; Dopri8 gets 30 steps."""
    for module in (first_rung, scipy_solver):
        monkeypatch.setattr(module, "MOST_DENSE", 20)
    monkeypatch.setattr(first_rung, "_MOST_STEPS_IF_LARGE", 30)
    monkeypatch.setattr(first_rung, "_IMPLICIT_PART", 0.1)
    monkeypatch.setattr(jacobian_pattern, "_DENSE", 0.1)


def test_a_sparse_jacobian(forty_are_large):
    known = reference(diffusion(40, 0.1))
    assert (known.certificate.solver, known.certificate.stiff) == (SCIPY_BDF, True)
    assert known.horizon is None
    assert_true(known, 40)
    again = dict(witness_runs(known))
    for each in known.certificate.witnesses:
        assert each.solver == (SCIPY_RADAU if each.role == "independent" else SCIPY_BDF)
        assert again[each.role].steps > 0
    apart = np.max(np.abs(again["rounding"].states - known.states))
    assert 0.0 < apart < known.bound()[-1]


def test_steps_that_are_not_compensated_raise_the_floor_of_the_bound():
    problem, states = diffusion(40, 0.1), np.ones((2, 40))
    floors = []
    for solver in (KVAERNO5, SCIPY_BDF):
        run = Solution(solver, 1e-9, 1e-9, states, steps=1000, seconds=0.0)
        floors.append(bounds(problem, run, [witness(problem, run, run, "tighter")])["state"][-1])
    np.testing.assert_allclose(floors, [4 * EPS64, 4004 * EPS64])


def coupled():
    problem = diffusion(40, 0.1)
    return Problem(lambda t, y, args: problem.rhs(t, y, args) - jnp.mean(y), problem.y0, problem.ts)


def test_the_pattern_of_a_jacobian(forty_are_large):
    pattern = sparsity(diffusion(40, 0.1)).toarray()
    np.testing.assert_array_equal(pattern, np.tri(40, k=1) - np.tri(40, k=-2))
    assert sparsity(coupled()) is None


@pytest.mark.slow
def test_a_large_problem_whose_jacobian_is_not_sparse(forty_are_large):
    with pytest.raises(ReferenceRefused, match="only where the right-hand side is in JAX"):
        reference(coupled(), time_limit=1e-3)


def assert_true(known, points):
    """The first mode of the discrete equation decays, and keeps its shape."""
    rate = (2 * (points + 1) * np.sin(np.pi / 2 / (points + 1))) ** 2
    ts = known.problem.ts
    exact = np.exp(-rate * ts)[:, None] * known.problem.y0
    assert np.all(np.max(np.abs(known.states - exact), axis=1) <= known.bound())


@pytest.mark.slow
def test_a_large_wave():
    def acceleration(t, x, v, args):
        wide = jnp.pad(x, 1)
        return (wide[2:] - 2 * x + wide[:-2]) * 1001.0**2

    x = np.sin(np.pi * np.arange(1, 1001) / 1001)
    problem = Problem.second_order(acceleration, x, 0 * x, np.linspace(0.0, 1.0, 6))
    known = reference(problem)
    assert known.horizon is None
    omega = 2 * 1001 * np.sin(np.pi / 2002)
    exact = np.cos(omega * problem.ts)[:, None] * x
    error = np.max(np.abs(known.positions[:, :, 0] - exact), axis=1)
    assert np.all(error <= known.bound())


def _robertson(t, y, args):
    slow, back, fast = 0.04 * y[0], 1e4 * y[1] * y[2], 3e7 * y[1] ** 2
    return jnp.stack([back - slow, slow - back - fast, fast])


def test_a_component_too_small_for_the_bound_is_named():
    def decays(t, y, args):
        return -jnp.array([1.0, 0.01]) * y

    (remark,) = remarks(reference(Problem(decays, [1.0, 1.0], [0.0, 20.0, 30.0])))
    assert "number 0 (" in remark
    assert "number 1 (" not in remark
    assert "atol" in remark


@pytest.mark.slow
def test_components_of_a_stiff_problem_too_small_for_the_bound_are_named():
    known = reference(Problem(_robertson, [1.0, 0.0, 0.0], [0.0, 1.0, 1e5, 1e11]))
    (remark,) = remarks(known)
    assert "number 0 (2.1e-08), number 1 (8.3e-14)" in remark
    assert "atol" in remark


def _van_der_pol(t, y, args):
    return jnp.stack([y[1], ((1.0 - y[0] ** 2) * y[1] - y[0]) / args])


@pytest.mark.slow
def test_the_tolerances_that_a_refusal_names_suffice():
    """The velocity is large for a moment only, between the samples."""
    problem = Problem(_van_der_pol, [2.0, 0.0], np.linspace(0.0, 2.0, 5), 1e-10)
    with pytest.raises(ReferenceRefused, match="atol=") as refused:
        reference(problem)
    atol = str(refused.value).split("atol=[")[1].split("]")[0]
    assert reference(problem, atol=[float(each) for each in atol.split(",")]).horizon is None
