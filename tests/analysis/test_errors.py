"""Errors, as far as the reference can tell them."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from ropeode import Rope
from ropeode.analysis import RESOLUTION_FACTOR, error_series
from ropeode.errors import InputError
from ropeode.simulation import simulate
from tests.exact_reference import exact_reference


@pytest.fixture(scope="module")
def known():
    """A run as if it were exact, known to 1e-9."""
    problem = Rope(num_nodes=4).problem(frames=6)
    exact = exact_reference(problem, simulate(problem, "rk4", 8).states)
    return certified(exact, bounds=dict.fromkeys(problem.quantities, np.full(7, 1e-9)))


def certified(known, **facts):
    return dataclasses.replace(known, certificate=dataclasses.replace(known.certificate, **facts))


def moved(known, offsets):
    """The reference as a run that is wrong by given distances at one node."""
    states = known.states.copy()
    states[:, 0, :, 2] += np.outer(offsets, (0.6, -0.8))
    return dataclasses.replace(simulate(known.problem, "rk4", 8), states=states)


def test_summaries(known):
    offsets = [0.0, 0.1, 0.4, 0.2, 0.2, 0.1, 0.3]
    series = error_series(moved(known, offsets), known)
    np.testing.assert_allclose(series.values, offsets[1:], rtol=1e-12)
    assert series.times.tolist() == [1, 2, 3, 4, 5, 6]
    assert (series.final, series.max) == (pytest.approx(0.3), pytest.approx(0.4))
    assert series.rms == pytest.approx(np.sqrt(np.mean(np.square(offsets[1:]))))
    assert error_series(moved(known, offsets), known, "velocity-max").max is None


def test_what_the_reference_cannot_tell_is_no_number(known):
    bound = known.bound()[-1]
    for factor, told in [(9.9, False), (10.5, True)]:
        series = error_series(moved(known, [0.0] + [factor * bound] * 6), known)
        assert [each is not None for each in (series.max, series.final, series.rms)] == [told] * 3
    assert series.finest == RESOLUTION_FACTOR * bound
    series = error_series(moved(known, [0, 1.0, 0, 0, 0, 0, 0]), known)
    assert (series.max, series.final) == (pytest.approx(1.0), None)


def test_samples_past_the_horizon_are_not_judged(known):
    series = error_series(moved(known, [0, 1, 2, 3, 100, 100, 100]), certified(known, trusted=4))
    assert (series.max, series.final) == (pytest.approx(3.0), pytest.approx(3.0))


def test_huge_errors_stay_numbers(known):
    series = error_series(moved(known, [0] * 6 + [1e300]), known)
    assert np.all(np.isfinite([series.max, series.final, series.rms]))


def test_misuse(known):
    other = simulate(Rope(num_nodes=4, damping=0.1).problem(frames=6), "rk4", 8)
    run = moved(known, [0] * 7)
    short = {"states": run.states[:3], "times": run.times[:3]}
    diverged = dataclasses.replace(run, **short, status="diverged", diverged_at=3)
    for words, given in [
        ("another problem", (other, known)),
        ("norm: 'state-max' given", (run, known, "state-max")),
        ("diverged at frame 3", (diverged, known)),
    ]:
        with pytest.raises(InputError, match=words):
            error_series(*given)
