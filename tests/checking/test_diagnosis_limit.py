"""Extrapolation to dt = 0, against exact limits."""

import numpy as np
import pytest

from ropeode.checking.richardson import limit_of
from ropeode.checking.written_precision import rounding_of

DTS = [0.1 / 2**k for k in range(6)]
TRUTH = np.array([[1.0, 2.0], [-0.5, 0.3], [4.0, 0.0]])


def series(dt, order, ratio=1.0):
    """Runs whose error has an expansion in powers of dt from the order on."""
    first, second = np.sin(np.arange(6.0)).reshape(3, 2), np.cos(np.arange(6.0)).reshape(3, 2)
    return TRUTH + dt**order * (first + ratio * dt * second + dt**2)


@pytest.mark.parametrize("order", [1, 2, 3, 4])
@pytest.mark.parametrize("dts", [DTS, DTS[:3], [0.1, 0.07, 0.05, 0.03], DTS[::-1]])
def test_the_limit_is_right_to_its_uncertainty(order, dts):
    limit = limit_of(dts, [series(dt, order) for dt in dts])
    assert limit is not None
    assert limit.order == order
    off = np.max(np.abs(limit.values - TRUTH), axis=1)
    assert np.all(off <= limit.uncertainty)
    # Many runs know it better than the finest of them; a guard against a term of order 1 that
    # hides among the others costs part of it. At order 4 the finest is wrong by 1e-10.
    if len(dts) == len(DTS) and order < 4:
        finest = np.max(np.abs(series(min(dts), order) - TRUTH))
        assert limit.uncertainty[-1] < finest


def test_an_order_that_only_looks_higher_is_in_the_uncertainty():
    # The error of order 1 is small beside that of order 2 at all these steps.
    dts = DTS[:4]
    runs = [TRUTH + 1e-3 * dt + dt**2 for dt in dts]
    limit = limit_of(dts, runs)
    assert limit is None or np.all(
        np.max(np.abs(limit.values - TRUTH), axis=1) <= limit.uncertainty
    )


def test_noise_ends_up_in_the_uncertainty():
    draw = np.random.default_rng(3)
    runs = [series(dt, 1) + 1e-7 * draw.uniform(-1.0, 1.0, TRUTH.shape) for dt in DTS]
    limit = limit_of(DTS, runs, 1e-7)
    assert limit is not None
    assert np.all(np.max(np.abs(limit.values - TRUTH), axis=1) <= limit.uncertainty)


def test_runs_that_do_not_depend_on_dt_are_their_own_limit():
    limit = limit_of(DTS, [TRUTH for _ in DTS])
    assert limit is not None
    assert limit.order is None
    assert np.array_equal(limit.values, TRUTH)


@pytest.mark.parametrize(
    "runs",
    [
        [TRUTH + 1.0 / dt for dt in DTS],  # runs away
        [TRUTH + np.log(dt) for dt in DTS],  # runs away slowly
        [TRUTH + np.sin(1.0 / dt) for dt in DTS],  # does as it likes
        [TRUTH + np.sqrt(dt) for dt in DTS],  # has a limit, but no whole order
        [np.full((3, 2), np.nan) for _ in DTS],
    ],
)
def test_what_has_no_limit_with_a_whole_order_has_none(runs):
    limit = limit_of(DTS, runs)
    assert limit is None or limit.uncertainty[-1] > 0.1


def test_two_runs_say_nothing():
    assert limit_of(DTS[:2], [series(dt, 1) for dt in DTS[:2]]) is None


@pytest.mark.parametrize(
    ("text", "rounding"),
    [("{:.6g}", 5e-6), ("{:.4f}", 5e-5), ("{:.3e}", 5e-4 * 10 ** np.floor(0.0)), ("{!r}", 0.0)],
)
def test_the_digits_of_printed_numbers_are_seen(text, rounding):
    values = np.random.default_rng(1).uniform(-9.9, 9.9, 120)
    printed = np.array([float(text.format(float(value))) for value in values])
    error = rounding_of(printed)
    assert error == pytest.approx(rounding, rel=1e-6)
    assert np.max(np.abs(printed - values)) <= error * (1 + 1e-9)
