"""What a check says of an observed order."""

from __future__ import annotations

import numpy as np
import pytest

from ropeode.analysis.order import observed_order
from ropeode.checking.convergence import convergence_finding
from ropeode.checking.report import Convergence


@pytest.mark.parametrize(
    ("bend", "words"),
    [
        (0.0, "positions order 1.00 [0.99, 1.01]; expected 1"),
        (0.06, "positions order between 0.36 and 1.64, all errors together fall with the power "),
    ],
)
def test_a_wide_interval_is_not_shown_as_an_order(bend, words):
    dts = (0.4, 0.2, 0.1)
    errors = tuple(dt * np.exp(bend * (k - 1) ** 2) for k, dt in enumerate(dts))
    order = observed_order(dts, errors, widest=np.inf)
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
    assert finding.status == "pass"
