"""References between their samples: the true error, the order, and what would be caught."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import BPoly

from ropeode import reference
from ropeode.errors import InputError
from ropeode.norms import NORMS, distance
from ropeode.problems import PROBLEMS, Problem
from ropeode.references import (
    Dense,
    largest_norms,
    load_reference,
    save_reference,
    time_derivatives,
    verify_reference,
)

RANDOM = np.random.default_rng(7)
TS = np.linspace(0.0, 2.5, 6)


def random_times(known, count=400):
    return np.sort(RANDOM.uniform(known.dense.times[0], known.dense.end, count))


def errors_over_bounds(known, times, truth):
    """The true errors of all quantities at these times, over their bounds."""
    problem = dataclasses.replace(known.problem, ts=times, jump_times=())
    values = known.at(times)
    return {
        quantity: distance(problem, norm, values, truth) / known.bound_at(times, norm)
        for quantity, norm in largest_norms(problem).items()
    }


def something_at(t, y, args):
    """Two equations of which something happens at a time, so that one compilation serves both."""
    is_root, at = args
    return jax.lax.cond(
        is_root,
        lambda: jnp.sqrt(jnp.abs(t - at)) + 0.0 * y,
        lambda: jnp.where(t < at, y, -y),
    )


def near(what, at, y0, **more):
    return Problem(something_at, [y0], TS, (what == "root", at), **more)


@pytest.fixture(scope="module")
def oscillator():
    return reference(PROBLEMS["oscillator"](frames=4), dense=True)


@pytest.fixture(scope="module")
def jumping():
    """y' = y, and -y from t = 1.3 on: the solution has a corner, between two samples."""
    return reference(near("turn", 1.3, y0=1.0, jump_times=[1.3]), dense=True)


def test_bound_covers_the_true_error_of_an_exact_solution(oscillator):
    known = oscillator
    times = random_times(known)
    for quantity, over in errors_over_bounds(known, times, known.problem.exact(times)).items():
        assert np.max(over) <= 1.0
        # Nothing that is much worse than at the samples.
        samples = known.certificate.bounds[quantity][-1]
        assert samples <= known.dense.bounds[quantity][-1] <= 3.0 * samples
        assert np.all(np.diff(known.dense.bounds[quantity]) >= 0)


def test_both_sides_of_a_jump(jumping):
    times = np.append(random_times(jumping), [np.nextafter(1.3, 0), 1.3, np.nextafter(1.3, 2)])
    exact = np.where(times < 1.3, np.exp(times), np.exp(2.6 - times))[:, None]
    apart = np.abs(jumping.at(times) - exact)[:, 0]
    assert np.all(apart <= jumping.bound_at(times))
    assert {np.nextafter(1.3, 0), 1.3} <= set(jumping.dense.times.tolist())
    slopes = jumping.dense.derivatives[np.searchsorted(jumping.dense.times, 1.3) - np.array([1, 0])]
    np.testing.assert_allclose(slopes[:, 1, 0], [np.exp(1.3), -np.exp(1.3)], rtol=1e-12)


def test_samples_are_the_samples_to_the_last_bit(oscillator, jumping):
    for known in (oscillator, jumping):
        np.testing.assert_array_equal(known.at(known.times), known.states)
        shuffled = [2, 0, 3, 1]
        np.testing.assert_array_equal(known.at(known.times[shuffled]), known.states[shuffled])
        for norm in largest_norms(known.problem).values():
            assert np.all(known.bound_at(known.times, norm) >= known.bound(norm))


def test_extended_level_is_good_to_the_last_digits():
    pytest.importorskip("heyoka", reason="heyoka is an extra")
    problem = PROBLEMS["oscillator"](frames=4)
    known = reference(problem, level="extended", dense=True, time_limit=1e9)
    times = random_times(known)
    for quantity, over in errors_over_bounds(known, times, problem.exact(times)).items():
        assert np.max(over) <= 1.0
        # A bound of some 4 units of rounding, and three times as much for the polynomials.
        size = np.max(np.abs(problem.quantity(quantity, known.at(times))))
        assert known.dense.bounds[quantity][-1] <= 20 * np.finfo(float).eps * size
    np.testing.assert_array_equal(known.at(known.times), known.states)


def test_derivatives_are_those_of_the_solution():
    """y' = t y has y'' = (1 + t^2) y, y''' = (3 t + t^3) y, y'''' = (3 + 6 t^2 + t^4) y."""
    problem = Problem(lambda t, y, args: t * y, [2.0], [0.0, 1.0])
    t, y = np.linspace(0, 1, 300), np.linspace(1, 2, 300)[:, None]
    found = time_derivatives(problem, t, y, 4)[..., 0]
    factors = [1 + 0 * t, t, 1 + t**2, 3 * t + t**3, 3 + 6 * t**2 + t**4]
    np.testing.assert_allclose(found, np.stack(factors, 1) * y, rtol=1e-14)


def test_polynomials_are_those_of_scipy():
    nodes = np.array([0.0, 0.5, 2.0, 2.25])
    values = RANDOM.normal(size=(4, 5, 3))
    times = np.linspace(0, 2.25, 50)
    other = BPoly.from_derivatives(nodes, list(values))
    found = Dense(nodes, values, {}).at(times)
    np.testing.assert_allclose(found, other(times), rtol=1e-12, atol=1e-12)


def test_it_comes_back_from_a_file_and_verifies(oscillator, jumping, tmp_path):
    for known in (oscillator, jumping):
        path = save_reference(known, tmp_path / "x.nc")
        found = load_reference(path)
        assert found.dense == known.dense
        times = random_times(known)
        np.testing.assert_array_equal(found.at(times), known.at(times))
    verified = verify_reference(save_reference(oscillator, tmp_path / "y.nc"))
    assert verified.agrees
    assert verified.samples > len(oscillator.times)


def test_wrong_derivatives_do_not_verify(oscillator, tmp_path):
    derivatives = oscillator.dense.derivatives.copy()
    derivatives[:, 3] *= 1 + 1e-6
    wrong = dataclasses.replace(oscillator.dense, derivatives=derivatives)
    path = save_reference(dataclasses.replace(oscillator, dense=wrong), tmp_path / "x.nc")
    found = verify_reference(path)
    assert not found.agrees
    assert found.outside["position"] not in oscillator.times


@pytest.mark.parametrize(
    ("times", "words"),
    [
        (2.6, "times: 2.6 given; allowed: a number, or a list of numbers, from 0 to 2.5"),
        ([0.1, np.nan], "times: "),
        ([[0.1]], r"times: \(1, 1\) given"),
        ("now", "times: "),
    ],
)
def test_times_that_are_not_covered(jumping, times, words):
    for ask in (jumping.at, jumping.bound_at):
        with pytest.raises(InputError, match=words):
            ask(times)


def test_no_dense_output_unless_asked_for():
    known = reference(PROBLEMS["oscillator"](frames=4))
    assert known.dense is None
    for ask in (known.at, known.bound_at):
        with pytest.raises(InputError, match=r"dense: None given.*dense=True"):
            ask(0.5)


def test_it_ends_with_the_horizon():
    problem = PROBLEMS["oscillator"](frames=4, damping=0.0)
    accuracy = float(reference(problem, rtol=1e-9, accuracy=1.0).bound()[2]) * 1.2
    known = reference(problem, rtol=1e-9, accuracy=accuracy, dense=True)
    assert known.horizon == 3.0
    assert known.dense.end <= known.times[known.trusted - 1]
    assert known.bound_at(known.dense.end, NORMS["position-max"]) <= accuracy
    with pytest.raises(InputError, match="trusted at any time"):
        known.at(known.horizon)


@pytest.mark.slow
@pytest.mark.parametrize(("at", "rtol"), [(1.0, 1e-6), (0.7, 1e-6), (0.0, 1e-6), (0.0, None)])
def test_a_singular_derivative(at, rtol):
    """At a sample, at the start, and between samples: y' = sqrt(|t - at|)."""
    problem = near("root", at, y0=0.0)
    made = reference(problem, rtol=rtol, dense=True)
    assert made.dense.end == made.times[made.trusted - 1]
    close = at + np.array([-1e-3, -1e-7, 0.0, 1e-12, 1e-7, 1e-3])
    times = np.append(close[close >= 0], np.random.default_rng(3).uniform(0, made.dense.end, 500))

    def integral(t):
        return 2 / 3 * np.sign(t - at) * np.abs(t - at) ** 1.5

    error = np.abs(made.at(times)[:, 0] - integral(times) + integral(0.0))
    assert np.all(error <= made.bound_at(times))
