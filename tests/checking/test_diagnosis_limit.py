"""Extrapolation to dt = 0, against exact limits."""

import numpy as np
import pytest

from ropeode.checking.richardson import limit_of
from ropeode.checking.written_precision import digits_of, rounding_of, single_precision

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


# The error of order 1 is small beside that of order 2 at all steps; or rounding covers the end.
HIDDEN = [
    (lambda dt: TRUTH + 1e-3 * dt + dt**2, 0.0),
    (lambda dt: series(dt, 1) + 1e-7 * NOISE.uniform(-1.0, 1.0, TRUTH.shape), 1e-7),
    (lambda dt: TRUTH, 0.0),
]


@pytest.mark.parametrize(("run", "rounding"), HIDDEN)
def test_what_only_looks_like_an_order_ends_up_in_the_uncertainty(run, rounding):
    limit = limit_of(DTS, [run(dt) for dt in DTS], rounding)
    assert limit is not None
    assert np.all(np.max(np.abs(limit.values - TRUTH), axis=1) <= limit.uncertainty)
    # Runs that do not depend on dt have no order.
    assert (limit.order is None) == np.array_equal(run(0.1), TRUTH)


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
    ("text", "digits", "rounding"),
    [("%.6g", 6, 5e-6), ("%.4f", 5, 5e-5), ("%.3e", 4, 5e-4), ("%r", 16, 0.0)],
)
def test_the_digits_of_printed_numbers_are_seen(text, digits, rounding):
    values = np.random.default_rng(1).uniform(-9.9, 9.9, 120)
    printed = np.array([float(text % float(value)) for value in values])
    assert digits_of(printed)[0] >= digits
    assert rounding_of(printed) == pytest.approx(rounding, rel=1e-6)
    assert np.max(np.abs(printed - values)) <= rounding * (1 + 1e-9)
    assert not single_precision(printed)


def test_single_precision_shows_in_all_digits_and_in_nine():
    values = NOISE.normal(size=999) * 100
    single = values.astype(np.float32)
    for each in (single.astype(np.float64), np.array([float(f"{x:.9g}") for x in single])):
        assert single_precision(each)
        assert np.max(np.abs(each - values)) <= rounding_of(each)
    assert not single_precision(np.arange(5.0))
    assert digits_of(np.array([1.25e-7, 3e20])) == (3, 9)
