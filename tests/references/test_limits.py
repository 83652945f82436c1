"""How long a reference may take, where it ends then, and problems that no time suffices for."""

from __future__ import annotations

import re

import jax.numpy as jnp
import numpy as np
import pytest

from ropeode import InputError, Problem, ReferenceRefused, reference
from ropeode.references import (
    DOPRI8,
    KVAERNO5,
    OWN_DOP853,
    SCIPY_BDF,
    SCIPY_RADAU,
    ReferenceOptions,
    remarks,
    solve,
    witness_runs,
)
from ropeode.render import describe_reference
from tests.references.scalar_problems import scalar

TS = np.linspace(0.0, 2.5, 6)
EPS64 = np.finfo(np.float64).eps


def said_by(problem, **options):
    """What is reported of the runs of a reference, and the reference, if there is one."""
    said = []
    try:
        known = reference(problem, progress=lambda text, fraction: said.append(text), **options)
    except ReferenceRefused as refusal:
        return said, refusal
    return said, known


def steps_of(known):
    """The steps of all its runs that arrived."""
    return known.certificate.steps + sum(each.steps for each in known.certificate.witnesses)


@pytest.mark.parametrize(
    ("name", "y0", "number", "pole"),
    [("square", 1.0, 1.1, 1 / 1.1), ("square", 1.0, 0.7, 1 / 0.7), ("tan", 0.0, 1.0, np.pi / 2)],
)
def test_a_pole_ends_the_horizon_after_few_steps(name, y0, number, pole):
    known = reference(scalar(name, y0, TS, number))
    assert known.trusted == np.sum(pole > TS)
    assert "step size has become too small" in known.certificate.horizon_reason
    assert f"t = {pole:g}" in known.certificate.horizon_reason
    assert steps_of(known) < 20_000


def test_a_pole_before_the_first_sample_is_a_refusal_after_one_run():
    said, refusal = said_by(scalar("square", 4.0, TS))
    assert "t = 0.25: the step size has become too small" in str(refusal)
    assert len(said) == 1


@pytest.mark.slow
@pytest.mark.parametrize("y0", [0.7, 1.6])
def test_where_it_chatters_no_run_but_the_first_tries_to_go_on(y0):
    """y' = -sign(y) comes to zero, and jumps back and forth from then on."""
    said, known = said_by(scalar("sign", y0, TS))
    assert known.trusted == np.sum(y0 > TS)
    # Twice the explicit solver, the implicit one, and then only up to the last sample.
    assert len(said) <= 16
    assert steps_of(known) < 200_000


def test_the_time_limit_is_told_before_it_is_spent():
    problem = scalar("follows", 0.0, np.linspace(0.0, 1e7, 6), 0.0)
    said, refusal = said_by(problem, time_limit=1.0)
    assert len(said) <= 3
    assert re.search(r"time limit is 1 s. Allow more time \(time_limit\)", str(refusal))


def test_a_run_stops_when_its_time_is_up():
    problem = scalar("follows", 0.0, np.linspace(0.0, 1e8, 6), 0.0)
    for solver in (DOPRI8, KVAERNO5):
        run = solve(problem, solver, 1e-8, 1e-8, seconds=0.05)
        assert run.ran_out
        assert run.failure.endswith("its time was up")
        assert run.seconds < 2.0
        assert 0.0 < run.reached < 1e8


def test_a_limit_that_is_not_reached_changes_nothing():
    problem = scalar("follows", 0.0, np.linspace(0.0, 4e3, 6), 0.0)
    free = solve(problem, DOPRI8, 1e-8, 1e-8)
    limited = solve(problem, DOPRI8, 1e-8, 1e-8, seconds=100.0)
    assert free.steps > 4096
    assert (limited.steps, limited.states.tobytes()) == (free.steps, free.states.tobytes())


def test_large_times_are_said_to_be_coarse():
    problem = scalar("follows", 0.0, 1e9 + np.linspace(0.0, 1e-3, 6), -1e5)
    with pytest.raises(ReferenceRefused, match="1.2e-07 apart.*let t start at 0") as refused:
        reference(problem, accuracy=1e-12)
    assert str(refused.value).count("apart") == 1
    for start, length in ((0.0, 1e-9), (1e6, 1e3), (-1e9, 1e6)):
        fine = scalar("decay", 1.0, start + np.linspace(0.0, length, 6), 1.0 / length)
        assert remarks(reference(fine)) == ()
    growing = scalar("decay", 1.0, np.array([0.0, 1e-9, 1.0, 1e4, 1e8, 1e11]), 1e-11)
    assert remarks(reference(growing)) == ()
    near = scalar("decay", 1.0, np.array([0.0, 1.0, 2.0, 3.0, 1e11, 1e11 + 1.0]), 1e-11)
    (remark,) = remarks(reference(near))
    assert "samples that are further apart" in remark


def decays(t, y, args):
    return -jnp.array([1.0, 0.01]) * y


@pytest.mark.parametrize(
    ("y0", "options", "told"),
    [
        ([1e3, 1e-6], {}, True),
        ([1e3, 1.0], {}, False),
        ([1e3, 1e-6], {"atol": [1e-10, 1e-19]}, False),
        ([1e3, 0.0], {}, False),
    ],
)
def test_components_of_different_size_are_named(y0, options, told):
    _, refusal = said_by(Problem(decays, y0, [0.0, 1.0, 2.0]), accuracy=1e-30, **options)
    assert ("from 1.0e-06 to 1.0e+03" in str(refusal)) == told


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
    assert remarks(reference(scalar("decay", 0.0, TS))) == ()


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


SMALLEST_LARGE = 301


@pytest.mark.slow
def test_a_sparse_jacobian():
    known = reference(diffusion(SMALLEST_LARGE, 1.0))
    assert (known.certificate.solver, known.certificate.stiff) == (SCIPY_BDF, True)
    assert known.horizon is None
    assert_true(known, SMALLEST_LARGE)
    # Steps that are not compensated lose a unit of rounding each.
    assert known.bound()[-1] >= 4 * known.certificate.steps * EPS64
    again = dict(witness_runs(known))
    for each in known.certificate.witnesses:
        assert each.solver == (SCIPY_RADAU if each.role == "independent" else SCIPY_BDF)
        assert again[each.role].steps > 0
    apart = np.max(np.abs(again["rounding"].states - known.states))
    assert 0.0 < apart < known.bound()[-1]


@pytest.mark.slow
def test_a_large_problem_whose_jacobian_is_not_sparse():
    problem = diffusion(SMALLEST_LARGE, 0.1)
    coupled = problem.changed(rhs=lambda t, y, args: problem.rhs(t, y, args) - jnp.mean(y))
    with pytest.raises(ReferenceRefused, match="only where the right-hand side is in JAX"):
        reference(coupled, time_limit=1e-3)


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
