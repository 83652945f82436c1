"""The observed order, on errors whose order is known because they were made up."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy import stats

from ropeode.analysis import PRE_ASYMPTOTIC, ROUND_OFF, UNRESOLVED, UNSTABLE, observed_order
from ropeode.errors import InputError


def reasons(found):
    return {point.dt: point.reason for point in found.left_out}


@given(
    order=st.floats(0.6, 8),
    constant=st.floats(1e-3, 1e3),
    ratios=st.lists(st.floats(1.2, 4), min_size=2, max_size=8),
    data=st.data(),
)
def test_power_laws_are_found_exactly(order, constant, ratios, data):
    dts = np.cumprod([0.1, *(1 / r for r in ratios)])
    shuffled = data.draw(st.permutations(list(dts)))
    found = observed_order(shuffled, [constant * dt**order for dt in shuffled])
    assert found.verdict == "converges"
    assert found.observed == pytest.approx(order, abs=1e-6)
    assert found.ci95[0] - 1e-9 <= order <= found.ci95[1] + 1e-9
    assert found.used == tuple(sorted(dts, reverse=True))
    assert found.left_out == ()


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_interval_covers_the_order(noise):
    # C dt^p (1 + a dt + b dt^2) with random coefficients: bent, and scattered by the noise.
    rng = np.random.default_rng(5)
    covered, shown = [], []
    for _ in range(600):
        order = rng.integers(1, 5)
        dts = 0.2 / rng.uniform(1.4, 3) ** np.arange(rng.integers(4, 9))
        a, b = rng.normal(size=2) * [2, 4]
        errors = np.abs(dts**order * (1 + a * dts + b * dts**2))
        errors *= np.exp(noise * rng.normal(size=len(dts)))
        # Any order will do, so even a wide interval decides.
        found = observed_order(dts, errors, claimed=0)
        if found.verdict == "converges":
            covered.append(found.ci95[0] <= order <= found.ci95[1])
            shown.append(observed_order(dts, errors).verdict == "converges")
    assert len(covered) > 550
    assert np.mean(covered) > 0.95
    # Those with no more than one whole order are as honest as the others.
    assert np.mean(shown) > 0.9
    assert np.mean(np.array(covered)[shown]) > 0.95


DTS = 0.1 / 2.0 ** np.arange(10)


def test_round_off_at_the_finest_steps():
    noise = 1e-12 / DTS**2
    found = observed_order(DTS, DTS**2 + noise, rounding=noise)
    assert found.observed == pytest.approx(2, abs=0.02)
    left = reasons(found)
    assert set(left.values()) == {ROUND_OFF}
    assert set(left) == set(DTS[29 * noise > DTS**2])


def test_without_evidence_of_round_off_a_rise_is_no_convergence():
    noise = 1e-9 / DTS**2
    found = observed_order(DTS, DTS**2 + noise)
    assert found.verdict == "does not converge"
    assert found.observed == pytest.approx(-2, abs=0.05)


def test_unresolved():
    found = observed_order(DTS, DTS**4, resolution=1e-9)
    assert found.observed == pytest.approx(4)
    assert set(reasons(found)) == set(DTS[DTS**4 < 1e-9])
    assert set(reasons(found).values()) == {UNRESOLVED}


def test_unstable_and_diverged():
    errors = DTS.copy()
    errors[:3] = (np.inf, 1e30, 3.0)
    found = observed_order(DTS, [None, *errors[1:]], motion=1.0)
    assert found.observed == pytest.approx(1)
    assert reasons(found) == dict.fromkeys(DTS[:3], UNSTABLE)


def test_unsolved():
    """Whatever its error: there is none of a run that ended."""
    dts = [0.8, 0.4, 0.2, 0.1]
    order = observed_order(
        dts, [None, 0.16, 0.04, 0.01], motion=1.0, solved=[False, True, True, True]
    )
    assert [(each.dt, each.reason) for each in order.left_out] == [(0.8, "unsolved")]
    assert order.observed == pytest.approx(2.0)
    few = observed_order(dts[:3], [None, None, 0.04], motion=1.0, solved=[False, False, True])
    assert {each.reason for each in few.left_out} == {"unsolved", "too few to fit"}


def test_pre_asymptotic():
    errors = DTS**2 * (1 + 500 * DTS**2)
    found = observed_order(DTS, errors)
    left = reasons(found)
    assert set(left.values()) == {PRE_ASYMPTOTIC}
    assert min(left) > max(found.used)
    assert found.observed == pytest.approx(2, abs=0.1)


@given(level=st.floats(0.01, 100), order=st.integers(1, 4))
def test_plateau_does_not_converge(level, order):
    found = observed_order(DTS, level + 0.01 * level * (DTS / DTS[0]) ** order)
    assert found.verdict == "does not converge"
    assert abs(found.observed) < 0.05


@settings(max_examples=200)
@given(
    errors=st.lists(
        st.one_of(st.none(), st.floats(0, 1e300), st.just(np.inf)), min_size=1, max_size=12
    ),
    data=st.data(),
)
def test_never_a_number_without_evidence(errors, data):
    steps = data.draw(st.lists(st.floats(1e-6, 1), min_size=len(errors), max_size=len(errors)))
    assume(len({round(np.log(dt), 3) for dt in steps}) == len(steps))
    rounding = data.draw(st.floats(0, 1))
    found = observed_order(steps, errors, rounding=rounding, resolution=1e-10, motion=1e3)
    assert sorted([*found.used, *(point.dt for point in found.left_out)]) == sorted(steps)
    if found.verdict == "undetermined":
        assert found.observed is None
        assert found.ci95 is None
        assert found.used == ()
        assert found.why
    else:
        assert len(found.used) >= 3
        low, high = found.ci95
        assert low <= found.observed <= high
        assert (found.verdict == "converges") == (low > 0 and high >= 0.5)
        assert found.verdict != "converges" or np.floor(high) <= np.ceil(low)


@given(
    order=st.floats(0.6, 8),
    bend=st.floats(-0.5, 0.5),
    noise=st.lists(st.floats(-0.05, 0.05), min_size=4, max_size=4),
    claimed=st.sampled_from([None, 1, 2, 3, 4, 6]),
)
def test_an_interval_that_holds_another_order_gives_no_verdict(order, bend, noise, claimed):
    """The same line is fitted, whatever its interval may be; only the verdict is withheld."""
    dts = DTS[:4]
    errors = dts**order * np.exp(bend * dts / dts[0] + noise)
    fit = observed_order(dts, errors, claimed=0)
    assume(fit.verdict == "converges" and fit.ci95[0] > 0)
    low, high = fit.ci95
    limited = observed_order(dts, errors, claimed=claimed)
    if claimed is None:
        whole = np.floor(high) - np.ceil(low) + 1
        decides = whole == 1 or (whole == 0 and high - low <= 0.25)
    else:
        # It excludes the claimed order, or each lower one.
        decides = high < claimed - 0.25 or low > claimed - 1
    if decides:
        assert limited == fit
    else:
        assert limited.verdict == "undetermined"
        assert limited.observed is limited.ci95 is None
        assert {point.dt for point in limited.left_out} == set(dts)
        assert limited.add == tuple(dts[-1] / 2.0 ** np.arange(1, 3))
        assert f"{fit.observed:.2f} has the interval [{low:.2f}, {high:.2f}]" in limited.why


# Of rk4 on y' = |t - 0.737| - y, which is of order 2 there, with 16 to 4096 steps.
KINK = (7.989e-5, 2.559e-5, 5.195e-6, 4.655e-8, 2.109e-8, 1.083e-8, 4.888e-9, 2.941e-9)


@pytest.mark.parametrize("last", [6, 7, 8])
def test_a_few_of_many_points_on_a_line_decide_nothing(last):
    found = observed_order(DTS[:last], KINK[:last])
    assert found.verdict == "undetermined"
    assert f"of {last} usable step sizes" in found.why
    assert ("not smooth" in found.why) == (last == 8)
    assert {point.dt for point in found.left_out} == set(DTS[:last])


def test_points_on_a_line_after_a_smooth_bend_are_an_order():
    """Four, if the coarser ones are bent away; five, if they break off."""
    bent = DTS[:5] ** 2 * (1 + 100 * DTS[:5] ** 2)
    assert observed_order(DTS[:5], bent).used == tuple(DTS[1:5])
    assert observed_order(DTS[:4], bent[:4]).verdict == "undetermined"
    for kept, verdict in ((3, "undetermined"), (4, "undetermined"), (5, "converges")):
        broken = np.append(1.0, DTS[1 : kept + 1] ** 2)
        assert observed_order(DTS[: kept + 1], broken).verdict == verdict
    # Where an order is claimed, three points that have it are enough.
    assert observed_order(DTS[:4], [1.0, *DTS[1:4] ** 2], claimed=2).verdict == "converges"


def test_growing_errors_do_not_converge_however_wide_the_interval():
    found = observed_order(DTS[:3], [1.0, 8.0, 80.0])
    assert found.ci95[1] - found.ci95[0] > 1
    assert found.verdict == "does not converge"


@pytest.mark.parametrize("scattered", [1, 4, 13])
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
        # Of explicit Euler on the default rope.
        (DTS[:3], [4.211e-2, 1.715e-2, 8.566e-3], "[0.07, 2.23], which holds the orders 1 and 2"),
        # Of semi-implicit Euler on the rope without damping, over 300 frames, about as large as
        # errors can get: it has order 1.
        (DTS[:3], [38.79, 29.88, 21.61], "[0.09, 0.76], which holds no whole order"),
        # Of rk4 on Lorenz's equations: of order 4, and the local slopes go up and up to 5.2.
        (DTS[:4], [4.002e-1, 1.289e-2, 3.814e-4, 1.027e-5], "which holds the orders"),
        (DTS[:3], [1.0, 0.87, 0.86], "which holds the order 0"),
        (DTS[:2], [0.1, 0.05], "2 of 2 step sizes can be used, 3 are needed"),
        (DTS[:4], [1.0, 0.5, 2.0, 0.1], "do not lie on one power law"),
    ],
)
def test_what_decides_nothing_is_undetermined(dts, errors, why):
    found = observed_order(dts, errors)
    assert found.verdict == "undetermined"
    assert why in found.why


def test_one_step_size_more_decides():
    found = observed_order(DTS[:4], [4.211e-2, 1.715e-2, 8.566e-3, 4.281e-3])
    assert found.verdict == "converges"
    assert found.ci95 == pytest.approx((0.705, 1.310), abs=0.001)
    settling = observed_order(DTS[:4], DTS[:4] ** 4 * (1 + 3 * DTS[:4]))
    assert settling.ci95[0] <= 4 <= settling.ci95[1]


def test_no_error_at_all_is_unresolved():
    order = observed_order(DTS[:4], [1e-3, 1e-4, 1e-5, 0.0])
    assert reasons(order) == {DTS[3]: UNRESOLVED}


@pytest.mark.parametrize(
    ("dts", "errors"),
    [([0.1, 0.1], [1, 1]), ([0.1, np.nan], [1, 1]), ([0.1, 0.2], [1]), ([0.1, 0.2], [1, -1])],
)
def test_bad_input(dts, errors):
    with pytest.raises(InputError, match="(dts|errors): .* given; allowed: "):
        observed_order(dts, errors)
