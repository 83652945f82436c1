"""What a check says of an observed order."""

from __future__ import annotations

import numpy as np
import pytest

from ropeode.analysis.order import observed_order
from ropeode.checking.convergence import convergence_finding
from ropeode.checking.report import Convergence


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
        resolution={"position": 0.0},
        orders={"position": order},
        expected=1,
        limits={},
    )
    finding = convergence_finding("order", convergence)
    assert finding.line.startswith(words)
    assert finding.status == status
