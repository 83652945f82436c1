"""The studies of the open questions agree with theory."""

from __future__ import annotations

import numpy as np
import pytest

from docs.studies.growth import growth_scan
from docs.studies.projection_sweeps import sweep_study
from docs.studies.rest_time import rest_times
from ropeode.errors import InputError
from ropeode.problems import Rope


@pytest.mark.slow
def test_any_number_of_sweeps_has_order_one_and_nearly_one_constant(study):
    one, three = study.swept
    for each in study.swept:
        low, high = each.order.ci95
        assert low - 0.02 <= 1 <= high + 0.02
        assert each.constant == pytest.approx(each.errors[-1] / each.dts[-1])
        # Lengths are off by a multiple of the square of dt.
        slope = np.polyfit(np.log(each.dts), np.log(each.violations), 1)[0]
        assert slope == pytest.approx(2.0, abs=0.1)
    assert all(more < less for more, less in zip(three.violations, one.violations, strict=True))
    assert one.constant == pytest.approx(three.constant, rel=0.05)
    with pytest.raises(InputError, match="an inextensible rope"):
        sweep_study(Rope(num_nodes=3).problem(2))


@pytest.mark.slow
@pytest.mark.parametrize("rope", ["constraint", "force"])
def test_frames_to_rest(rope):
    """Per step they fall as one over the steps; per time they do not depend on the steps."""
    steps = (128, 192, 320)
    per_step = rest_times(rope, "per-step", steps, per_step=2e-4)
    # The last swing that is faster than the threshold is over after half a period, 53 frames.
    for each in per_step:
        assert abs(each.product - 15.0) <= 53 * each.rate / 2
    # At least what the threshold of a thousandth takes; the fall adds a little.
    assert 2 * np.log(1000) < np.mean([each.product for each in per_step]) < 18
    per_time = rest_times(rope, "lagged", steps, per_step=2e-4)
    assert np.ptp([each.settled_at for each in per_time]) <= 4
    assert {each.rate for each in per_time} == {2e-4 * 256}


@pytest.mark.parametrize(
    "steps_per_frame", [(4,), pytest.param((16, 48, 1000), marks=pytest.mark.slow)]
)
def test_growth_is_what_linear_theory_predicts(steps_per_frame):
    rope = Rope(num_nodes=4, stiffness=37.0, node_mass=1.3, damping=0.05)
    for each in growth_scan(rope, ["explicit-euler", "semi-implicit-euler"], steps_per_frame):
        assert each.measured == pytest.approx(each.predicted, rel=0.03)
