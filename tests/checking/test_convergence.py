"""What is said of an observed order, on made-up errors."""

from __future__ import annotations

import numpy as np
import pytest

from ropeode.analysis import ROUND_OFF, observed_order
from ropeode.checking import Convergence, Quantity, convergence_finding, falls_too_slowly
from ropeode.checking.richardson import limit_of
from ropeode.checking.trajectories.coarse_steps import by_coarse_steps


def made_up(dts, errors, claimed, resolution=0.0, rounding=None, limit=(None, None)):
    """Positions with such errors."""
    rounding = np.zeros(len(dts)) if rounding is None else rounding
    order = observed_order(dts, errors, claimed=claimed, resolution=resolution, rounding=rounding)
    return Convergence(
        problem="made up",
        dts=tuple(dts),
        quantities={
            "position": Quantity(tuple(errors), tuple(rounding), resolution, *limit, order)
        },
        expected=claimed,
    )


HALVED = np.array([0.4, 0.2, 0.1])


@pytest.mark.parametrize(
    ("bend", "status", "words"),
    [
        (0.0, "pass", "positions order 1.00 [0.99, 1.01]; expected 1"),
        (0.06, "pass", "positions order 1.00 [0.36, 1.64]; expected 1"),
        (0.1, "undetermined", "positions: order undetermined (the slope 1.00 has the interval"),
    ],
)
def test_an_interval_that_holds_a_lower_order_decides_nothing(bend, status, words):
    errors = HALVED * np.exp(bend * np.array([1.0, 0.0, 1.0]))
    finding = convergence_finding("order", made_up(HALVED, errors, 1))
    assert finding.line.startswith(words)
    assert finding.status == status


@pytest.mark.parametrize(
    ("errors", "too_slowly"),
    [
        # A plateau that goes up and down, as where a time is rounded.
        (lambda dts, wave: dts**2 + 1e-3 * (2.0 + wave), True),
        # As fast as it should, but on no line.
        (lambda dts, wave: dts**2 * np.exp(0.3 * wave), False),
    ],
)
def test_errors_that_show_no_order_may_still_fall_too_slowly(errors, too_slowly):
    dts = 0.2 / 1.5 ** np.arange(14)
    found = errors(dts, np.cos(9.0 * np.arange(14)))
    convergence = made_up(dts, found, 2)
    assert convergence.orders["position"].verdict == "undetermined"
    assert falls_too_slowly(convergence) is too_slowly
    assert not falls_too_slowly(made_up(dts, found, 2, resolution=2e-3))


def test_errors_too_small_to_be_told_are_right():
    exact = convergence_finding("order", made_up(HALVED, (3e-12, 1e-12, 2e-12), 4, 1e-11))
    assert exact.status == "pass"
    assert exact.line.startswith("positions as exact as the reference: errors below 1.0e-11")
    # One that can be told does not make an order, either.
    some = convergence_finding("order", made_up(HALVED, (3e-6, 1e-12, 2e-12), 4, 1e-11))
    assert some.status == "undetermined"


DTS = 0.02 / 1.5 ** np.arange(7)
# The largest possible round-off, which is as large as all but one of the errors.
ROUNDING = 2e-5 * DTS**-1.5


def in_single_precision(errors, rounding=ROUNDING, limit=(None, None), claimed=None):
    """The order that is found in errors with so much round-off."""

    def observe(count, share=0.0):
        floor = share * rounding[:count]
        return made_up(DTS[:count], errors[:count], claimed, rounding=floor, limit=limit)

    return by_coarse_steps(observe, observe(len(DTS), 0.1), 0.1).orders["position"]


def test_round_off_at_fine_steps_leaves_the_order_of_the_coarse_ones():
    errors = DTS + np.where(DTS < 0.003, 0.005 * ROUNDING, 0.0)
    order = in_single_precision(errors)
    assert order.verdict == "converges"
    assert order.observed == pytest.approx(1.0, abs=0.02)
    assert len(order.used) >= 4
    assert {point.reason for point in order.left_out} == {ROUND_OFF}


SQUARES = DTS**2 * np.array([1.0, 1.5, 1.0, 1.5, 1.0, 1.0, 1.0])


@pytest.mark.parametrize(
    ("errors", "more", "verdict"),
    [
        # The runs tend to something else than the solution.
        (
            DTS + np.where(DTS < 0.003, 0.005 * ROUNDING, 0.0),
            {"limit": (2e-3, 1e-3)},
            "undetermined",
        ),
        # A plateau is no round-off, whether there may be much of it or little.
        (DTS + 2e-3, {}, "undetermined"),
        (DTS + 2e-3, {"rounding": 1e-9 * ROUNDING}, "undetermined"),
        # So much at the finest step leaves much at the others.
        (DTS + 0.05 * (DTS[-1] == DTS), {}, "undetermined"),
        # Errors that fall all the way are bent for another reason.
        (np.where(DTS > 0.005, DTS**2 / 0.005, DTS), {"rounding": 5 * ROUNDING}, "undetermined"),
        # Three steps on a line may be chance where round-off is as large.
        (SQUARES, {"rounding": 50.0 * ROUNDING, "claimed": 2}, "undetermined"),
        (SQUARES, {"rounding": 1e-9 * ROUNDING, "claimed": 2}, "converges"),
    ],
)
def test_what_round_off_cannot_explain_is_not_left_out(errors, more, verdict):
    assert in_single_precision(errors, **more).verdict == verdict


def test_the_uncertainty_of_a_limit_is_no_accident():
    """The error's terms are such that at the first sample one run fewer changes nothing."""
    dts = np.array([0.4, 0.2, 0.1])
    # Per unit of the cubic term, the extrapolation of all three is off by 0.008; that of the last
    # two by -0.006, and by -0.02 per unit of the quadratic term.
    quadratic, cubic = np.array([-0.7, 1.0]), np.ones(2)
    runs = [1.0 + 3.0 * dt + quadratic * dt**2 + cubic * dt**3 for dt in dts]
    limit = limit_of(list(dts), [run[:, None, None] for run in runs])
    assert limit is not None
    assert np.allclose(limit.values[:, 0, 0] - 1.0, 0.008)
    assert np.all(limit.uncertainty > 0.008)
