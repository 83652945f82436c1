"""The studies of the open questions agree with theory."""

from __future__ import annotations

import numpy as np
import pytest

from docs.studies.growth import MeasuredGrowth, growth_scan
from docs.studies.plots import plot_besides, plot_growth, plot_rest_times, plot_sweeps
from docs.studies.projection_sweeps import sweep_study
from docs.studies.rest_time import RestTime, rest_times
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
    "steps_per_frame", [(16,), pytest.param((4, 48, 1000), marks=pytest.mark.slow)]
)
def test_growth_is_what_linear_theory_predicts(steps_per_frame):
    rope = Rope(num_nodes=4, stiffness=37.0, node_mass=1.3, damping=0.05)
    for each in growth_scan(rope, ["explicit-euler", "semi-implicit-euler"], steps_per_frame):
        assert each.measured == pytest.approx(each.predicted, rel=0.03)


def lines(axes):
    return [(list(line.get_xdata()), list(line.get_ydata())) for line in axes.get_lines()]


@pytest.mark.slow
def test_pictures_hold_the_numbers(study):
    errors, lengths = plot_sweeps(study).axes
    for each in study.swept:
        assert (list(each.dts), list(each.errors)) in lines(errors)
        assert (list(each.dts), list(each.violations)) in lines(lengths)
    rests = [
        RestTime("constraint", "per-step", 64, 0.5, 30),
        RestTime("constraint", "per-step", 128, 1.0, None),
    ]
    frames, products = plot_rest_times(rests).axes
    assert ([64], [30]) in lines(frames)
    assert ([64], [15.0]) in lines(products)
    scan = [MeasuredGrowth("rk4", 8, 0.3, 0.31), MeasuredGrowth("rk4", 16, -0.2, -0.21)]
    (axes,) = plot_growth(scan).axes
    assert ([8, 16], [0.3, -0.2]) in lines(axes)
    assert ([8, 16], [0.31, -0.21]) in lines(axes)
    # A case of a peer is a point between its least and its largest ratio.
    one, many = {"16 nodes": [(0.9, 0.8, 1.1)]}, {"64 ropes": [(20.0, 18.0, 24.0)]}
    axes, _ = plot_besides({"one rope": {"C++": one}, "many": {"NumPy": many}}).axes
    shown = [x for x, _ in lines(axes)]
    assert [0.9] in shown
    assert [0.8, 1.1] in shown
    assert axes.get_yticklabels()[0].get_text() == "C++"
