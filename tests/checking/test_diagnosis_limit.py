"""Extrapolation to dt = 0, against exact limits."""

import numpy as np
import pytest

from ropeode.checking.richardson import limit_of
from ropeode.checking.written_precision import rounding_of

DTS = [0.1 / 2**k for k in range(6)]
NOISE = np.random.default_rng(3)
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


@pytest.mark.parametrize(
    ("run", "rounding"),
    [
        # The error of order 1 is small beside that of order 2 at all these steps.
        (lambda dt: TRUTH + 1e-3 * dt + dt**2, 0.0),
        (lambda dt: series(dt, 1) + 1e-7 * NOISE.uniform(-1.0, 1.0, TRUTH.shape), 1e-7),
    ],
)
def test_what_only_looks_like_an_order_ends_up_in_the_uncertainty(run, rounding):
    limit = limit_of(DTS, [run(dt) for dt in DTS], rounding)
    assert limit is not None
    assert np.all(np.max(np.abs(limit.values - TRUTH), axis=1) <= limit.uncertainty)


def test_runs_that_do_not_depend_on_dt_are_their_own_limit():
    limit = limit_of(DTS, [TRUTH for _ in DTS])
    assert limit is not None
    assert limit.order is None
    assert np.array_equal(limit.values, TRUTH)


@pytest.mark.parametrize(
    "run",
    [
        lambda dt: TRUTH + 1.0 / dt,  # runs away
        lambda dt: TRUTH + np.log(dt),  # runs away slowly
        lambda dt: TRUTH + np.sin(1.0 / dt),  # does as it likes
        lambda dt: TRUTH + np.sqrt(dt),  # has a limit, but no whole order
        lambda dt: np.nan * TRUTH,
    ],
)
def test_what_has_no_limit_with_a_whole_order_has_none(run):
    limit = limit_of(DTS, [run(dt) for dt in DTS])
    assert limit is None or limit.uncertainty[-1] > 0.1
    # Two runs say nothing.
    assert limit_of(DTS[:2], [series(dt, 1) for dt in DTS[:2]]) is None


@pytest.mark.parametrize(
    ("text", "rounding"),
    [("{:.6g}", 5e-6), ("{:.4f}", 5e-5), ("{:.3e}", 5e-4), ("{!r}", 0.0)],
)
def test_the_digits_of_printed_numbers_are_seen(text, rounding):
    values = np.random.default_rng(1).uniform(-9.9, 9.9, 120)
    printed = np.array([float(text.format(float(value))) for value in values])
    error = rounding_of(printed)
    assert error == pytest.approx(rounding, rel=1e-6)
    assert np.max(np.abs(printed - values)) <= error * (1 + 1e-9)
