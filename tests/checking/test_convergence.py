"""What a check says of an observed order."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from ropeode.analysis import observed_order
from ropeode.checking import Convergence, convergence_finding, falls_too_slowly


@pytest.mark.parametrize(
    ("bend", "status", "words"),
    [
        (0.0, "pass", "positions order 1.00 [0.99, 1.01]; expected 1"),
        (0.06, "pass", "positions order 1.00 [0.36, 1.64]; expected 1"),
        (0.1, "undetermined", "positions: order undetermined (the slope 1.00 has the interval"),
    ],
)
def test_an_interval_that_holds_a_lower_order_decides_nothing(bend, status, words):
    dts = (0.4, 0.2, 0.1)
    errors = tuple(dt * np.exp(bend * (k - 1) ** 2) for k, dt in enumerate(dts))
    order = observed_order(dts, errors, claimed=1)
    convergence = Convergence(
        problem="made up",
        dts=dts,
        errors={"position": errors},
        rounding={"position": (0.0,) * 3},
        resolution={"position": 0.0},
        orders={"position": order},
        expected=1,
        limits={},
    )
    finding = convergence_finding("order", convergence)
    assert finding.line.startswith(words)
    assert finding.status == status


@pytest.mark.parametrize(
    ("errors", "too_slowly"),
    [
        # A plateau that goes up and down, as where a time is rounded.
        (lambda dts: dts**2 + 1e-3 * (2.0 + np.cos(9.0 * np.arange(len(dts)))), True),
        # As fast as it should, but on no line.
        (lambda dts: dts**2 * np.exp(0.3 * np.cos(9.0 * np.arange(len(dts)))), False),
    ],
)
def test_errors_that_show_no_order_may_still_fall_too_slowly(errors, too_slowly):
    dts = 0.2 / 1.5 ** np.arange(14)
    found = tuple(errors(dts))
    order = observed_order(dts, found, claimed=2)
    assert order.verdict == "undetermined"
    convergence = Convergence(
        problem="made up",
        dts=tuple(dts),
        errors={"position": found},
        rounding={"position": (0.0,) * len(dts)},
        resolution={"position": 0.0},
        orders={"position": order},
        expected=2,
        limits={},
    )
    assert falls_too_slowly(convergence) is too_slowly
    lost = observed_order(dts, found, claimed=2, resolution=2e-3)
    convergence = dataclasses.replace(convergence, orders={"position": lost})
    assert not falls_too_slowly(convergence)


def test_errors_too_small_to_be_told_are_right():
    dts, errors = (0.4, 0.2, 0.1), (3e-12, 1e-12, 2e-12)
    order = observed_order(dts, errors, resolution=1e-11, claimed=4)
    convergence = Convergence(
        problem="made up",
        dts=dts,
        errors={"position": errors},
        rounding={"position": (0.0,) * 3},
        resolution={"position": 1e-11},
        orders={"position": order},
        expected=4,
        limits={},
    )
    finding = convergence_finding("order", convergence)
    assert finding.status == "pass"
    assert finding.line.startswith("positions as exact as the reference: errors below 1.0e-11")
    # One that can be told does not make an order, either.
    some = observed_order(dts, (3e-6, 1e-12, 2e-12), resolution=1e-11, claimed=4)
    finding = convergence_finding(
        "order", dataclasses.replace(convergence, orders={"position": some})
    )
    assert finding.status == "undetermined"
