"""The observed order, on errors whose order is known because they were made up."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy import stats

from ropeode.analysis import PRE_ASYMPTOTIC, ROUND_OFF, UNRESOLVED, UNSTABLE, observed_order
from ropeode.errors import InputError


@given(
    order=st.floats(0.6, 8),
    constant=st.floats(1e-3, 1e3),
    ratios=st.lists(st.floats(1.2, 4), min_size=2, max_size=8),
    random=st.randoms(),
)
def test_power_laws_are_found_exactly(order, constant, ratios, random):
    dts = list(np.cumprod([0.1, *(1 / r for r in ratios)]))
    random.shuffle(dts)
    found = observed_order(dts, [constant * dt**order for dt in dts])
    assert found.verdict == "converges"
    assert found.observed == pytest.approx(order, abs=1e-6)
    assert found.ci95[0] - 1e-9 <= order <= found.ci95[1] + 1e-9
    assert found.used == tuple(sorted(dts, reverse=True))


def test_interval_covers_the_order():
    # C dt^p (1 + a dt + b dt^2) with random coefficients: bent, and every other one scattered.
    rng = np.random.default_rng(5)
    covered, shown = [], []
    for i in range(800):
        order = rng.integers(1, 5)
        dts = 0.2 / rng.uniform(1.4, 3) ** np.arange(rng.integers(4, 9))
        a, b = rng.normal(size=2) * [2, 4]
        errors = np.abs(dts**order * (1 + a * dts + b * dts**2))
        errors *= np.exp(0.02 * (i % 2) * rng.normal(size=len(dts)))
        # Any order will do, so even a wide interval decides.
        found = observed_order(dts, errors, claimed=0)
        if found.verdict == "converges":
            covered.append(found.ci95[0] <= order <= found.ci95[1])
            shown.append(observed_order(dts, errors).verdict == "converges")
    assert len(covered) > 740
    # Those with no more than one whole order are as honest as all.
    assert np.mean(shown) > 0.9
    assert min(np.mean(covered), np.mean(np.array(covered)[shown])) > 0.95


DTS = 0.1 / 2.0 ** np.arange(10)
NOISE = 1e-12 / DTS**2


@pytest.mark.parametrize(
    ("errors", "given", "order", "left", "reason"),
    [
        (DTS**2 + NOISE, {"rounding": NOISE}, 2, 29 * NOISE > DTS**2, ROUND_OFF),
        (DTS**4, {"resolution": 1e-9}, 4, DTS**4 < 1e-9, UNRESOLVED),
        # No error at all.
        ([*DTS[:9], 0.0], {}, 1, DTS[9] == DTS, UNRESOLVED),
        ([None, 1e30, 3.0, *DTS[3:]], {"motion": 1.0}, 1, DTS[3] < DTS, UNSTABLE),
        # Whatever its error: there is none of a run that ended.
        ([None, *DTS[1:]], {"motion": 1.0, "solved": DTS[0] > DTS}, 1, DTS[0] == DTS, "unsolved"),
        (DTS**2 * (1 + 500 * DTS**2), {}, 2, DTS[3] < DTS, PRE_ASYMPTOTIC),
    ],
)
def test_step_sizes_that_tell_nothing_are_left_out(errors, given, order, left, reason):
    found = observed_order(DTS, errors, **given)
    assert found.observed == pytest.approx(order, abs=0.02)
    assert {point.dt: point.reason for point in found.left_out} == dict.fromkeys(DTS[left], reason)


@pytest.mark.parametrize(
    ("errors", "order"), [(DTS**2 + 1e-9 / DTS**2, -2.0), ((1.0, 8.0, 80.0), -3.16)]
)
def test_growing_errors_do_not_converge(errors, order):
    """However wide the interval, and without evidence that they are round-off."""
    found = observed_order(DTS[: len(errors)], errors)
    assert found.verdict == "does not converge"
    assert found.observed == pytest.approx(order, abs=0.05)


@given(level=st.floats(0.01, 100), order=st.integers(1, 4))
def test_plateau_does_not_converge(level, order):
    found = observed_order(DTS, level + 0.01 * level * (DTS / DTS[0]) ** order)
    assert found.verdict == "does not converge"
    assert abs(found.observed) < 0.05


anything = st.one_of(st.none(), st.floats(0, 1e300), st.just(np.inf))


@settings(max_examples=150)
@given(st.lists(st.tuples(st.floats(1e-6, 1), anything), min_size=1, max_size=12), st.floats(0, 1))
def test_never_a_number_without_evidence(runs, rounding):
    steps, errors = zip(*runs, strict=True)
    assume(len({round(np.log(dt), 3) for dt in steps}) == len(steps))
    found = observed_order(steps, errors, rounding=rounding, resolution=1e-10, motion=1e3)
    assert sorted([*found.used, *(point.dt for point in found.left_out)]) == sorted(steps)
    if found.verdict == "undetermined":
        assert (found.observed, found.ci95, found.used) == (None, None, ())
        assert found.why
    else:
        assert len(found.used) >= 3
        low, high = found.ci95
        assert low <= found.observed <= high
        assert (found.verdict == "converges") == (low > 0 and high >= 0.5)
        assert found.verdict != "converges" or np.floor(high) <= np.ceil(low)


# Of rk4 on y' = |t - 0.737| - y, which is of order 2 there, with 16 to 4096 steps.
KINK = (7.989e-5, 2.559e-5, 5.195e-6, 4.655e-8, 2.109e-8, 1.083e-8, 4.888e-9, 2.941e-9)
# Of explicit Euler on the default rope.
EULER = (4.211e-2, 1.715e-2, 8.566e-3, 4.281e-3)


def test_points_on_a_line_after_a_smooth_bend_are_an_order():
    """Four, if the coarser ones are bent away; five, if they break off."""
    bent = DTS[:5] ** 2 * (1 + 100 * DTS[:5] ** 2)
    assert observed_order(DTS[:5], bent).used == tuple(DTS[1:5])
    assert observed_order(DTS[:4], bent[:4]).verdict == "undetermined"
    for kept, verdict in ((4, "undetermined"), (5, "converges")):
        broken = np.append(1.0, DTS[1 : kept + 1] ** 2)
        assert observed_order(DTS[: kept + 1], broken).verdict == verdict
    # Where an order is claimed, three points that have it are enough.
    assert observed_order(DTS[:4], [1.0, *DTS[1:4] ** 2], claimed=2).verdict == "converges"


def test_one_step_size_more_or_a_claim_decides():
    """A claim does where the interval holds no lower order."""
    assert observed_order(DTS[:4], EULER).verdict == "converges"
    assert observed_order(DTS[:3], EULER[:3], claimed=1).verdict == "converges"
    for claimed in (None, 2):
        undecided = observed_order(DTS[:3], EULER[:3], claimed=claimed)
        assert undecided.verdict == "undetermined"
        assert undecided.add == tuple(DTS[3:5])


@pytest.mark.parametrize("scattered", [1, 13])
def test_the_interval_is_that_of_a_line_through_scattered_points(scattered):
    """Where the finest steps bend no line, the scatter of the others alone makes the interval."""
    dts = 0.1 / 1.3 ** np.arange(scattered + 4)
    log_errors = 2 * np.log(dts)
    log_errors[:scattered] += 0.06 * (-1.0) ** np.arange(scattered)
    order = observed_order(dts, np.exp(log_errors))
    line = stats.linregress(np.log(dts), log_errors)
    half = stats.t.ppf(0.975, len(dts) - 2) * line.stderr
    assert half > 0.01
    assert order.observed == pytest.approx(line.slope)
    assert order.ci95 == pytest.approx((line.slope - half, line.slope + half))


@pytest.mark.parametrize(
    ("dts", "errors", "why"),
    [
        (DTS[:3], EULER[:3], "[0.07, 2.23], which holds the orders 1 and 2"),
        # Of semi-implicit Euler on the rope without damping, over 300 frames, about as large as
        # errors can get: it has order 1.
        (DTS[:3], [38.79, 29.88, 21.61], "[0.09, 0.76], which holds no whole order"),
        # Of rk4 on Lorenz's equations: of order 4, and the local slopes go up and up to 5.2.
        (DTS[:4], [4.002e-1, 1.289e-2, 3.814e-4, 1.027e-5], "which holds the orders"),
        (DTS[:3], [1.0, 0.87, 0.86], "which holds the order 0"),
        (DTS[:2], [0.1, 0.05], "2 of 2 step sizes can be used, 3 are needed"),
        (DTS[:4], [1.0, 0.5, 2.0, 0.1], "do not lie on one power law"),
        # A few of many points lie on a line.
        (DTS[:6], KINK[:6], "of 6 usable step sizes"),
        (DTS[:8], KINK, "not smooth"),
    ],
)
def test_what_decides_nothing_is_undetermined(dts, errors, why):
    found = observed_order(dts, errors)
    assert found.verdict == "undetermined"
    assert why in found.why


# From coarse to fine, as in `DTS`.
FIVE = DTS[:5]


def held(errors, constant, expected=4):
    """The verdict on errors whose leading term theory predicts as ``constant * dt**expected``."""
    return observed_order(FIVE[: len(errors)], errors, expected=expected, constant=constant)


def test_a_line_that_is_not_theorys_is_not_yet_asymptotic():
    """Order 4 with a small constant, beside a large term of order 5: a line of slope 5."""
    errors = FIVE**4 * (1 + 5000 * FIVE)
    assert observed_order(FIVE, errors).observed == pytest.approx(5, abs=0.02)
    found = held(errors, 1.0)
    assert (found.verdict, found.observed, found.ci95) == ("undetermined", None, None)
    # There the two terms differ by a factor of ten.
    assert "not yet asymptotic: theory says order 4 from about dt = 2e-05 on" in found.why
    assert found.add == (FIVE[-1] / 2, FIVE[-1] / 4)
    # Coarse errors may cross the predicted line, and be close to it at one step size by accident.
    assert "not yet asymptotic" in held(FIVE**5 / FIVE[-1], 1.0).why
    # Three points on the line are enough, whatever coarser ones are.
    bent = [1.0, 0.1, *FIVE[2:] ** 4]
    assert observed_order(FIVE, bent).verdict == "undetermined"
    assert held(bent, 1.0).verdict == "converges"


@pytest.mark.parametrize("bend", [[1.5], [1.4, 1.4]])
def test_one_run_does_not_say_whether_finer_ones_come_closer(bend):
    why = held(FIVE[: len(bend)] ** 4 * bend, 1.0).why
    assert "; theory says order 4" in why
    assert ("come no closer" in why) == (len(bend) > 1)


def test_theory_excuses_no_wrong_stepper():
    """Its own theory says what order it has. Errors that go away from its line refute theory."""
    for found in (held(3 * FIVE, 3.0, 1), held(FIVE, 1.0)):
        assert (found.verdict, round(found.observed, 3)) == ("converges", 1.0)


BENT, WIDE = FIVE**2 * (1 + 6 * FIVE), FIVE**2 * (1 + 20 * FIVE)


@pytest.mark.parametrize(
    ("errors", "expected", "verdict"),
    [
        # A corner of the solution makes such an order, but the slopes are then all the same.
        (FIVE**1.5, 2, "converges"),
        (FIVE**2, 3, "converges"),
        # The intervals are [1.88, 2.24] and [1.44, 2.86].
        (BENT, 3, "converges"),
        (WIDE, 3, "undetermined"),
        (WIDE, 5, "converges"),
        (WIDE, 2, "converges"),
        # Errors that are not yet asymptotic often fall too quickly.
        (BENT, 1, "undetermined"),
        # Errors that are as large as they can get say nothing of small ones.
        ([1.0, 1.1, 1.4, 1.8], 4, "undetermined"),
        (FIVE**0, 4, "does not converge"),
        # What grows steadily is no such error. The interval is [-1.12, -0.76].
        (BENT / FIVE**3, 2, "does not converge"),
    ],
)
def test_a_wide_interval_refutes_no_order_close_by(errors, expected, verdict):
    found = observed_order(FIVE[: len(errors)], errors, expected=expected)
    assert found.verdict == verdict
    holds = found.ci95 is not None and found.ci95[0] <= expected <= found.ci95[1]
    assert found.refutes(expected) == (verdict != "undetermined" and not holds)
    # Who claims less than there is claims nothing wrong.
    claimed = observed_order(FIVE[: len(errors)], errors, claimed=expected)
    assert claimed.verdict == ("converges" if expected == 1 else verdict)
    assert claimed.refutes(expected) == found.refutes(expected)
    # 0 stands for no convergence to this solution.
    assert observed_order(FIVE, BENT, expected=0) == observed_order(FIVE, BENT)


@pytest.mark.parametrize(
    ("dts", "errors"),
    [([0.1, 0.1], [1, 1]), ([0.1, np.nan], [1, 1]), ([0.1, 0.2], [1]), ([0.1, 0.2], [1, -1])],
)
def test_bad_input(dts, errors):
    with pytest.raises(InputError, match="(dts|errors): .* given; allowed: "):
        observed_order(dts, errors)


@pytest.mark.parametrize(("constant", "expected"), [(1.0, None), (-1.0, 2), (np.nan, 2), (1.0, 0)])
def test_a_constant_needs_an_order(constant, expected):
    with pytest.raises(InputError, match="constant: .* beside an expected order"):
        observed_order(FIVE, FIVE, constant=constant, expected=expected)
