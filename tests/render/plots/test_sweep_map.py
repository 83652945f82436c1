"""Maps of sweeps: numbers are coloured; cells without one are hatched, with a reason."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from matplotlib.collections import PathCollection, QuadMesh
from matplotlib.colors import LogNorm
from matplotlib.patches import Rectangle

from ropeode import plot_sweep
from ropeode.errors import InputError
from ropeode.sweep import COLUMNS
from tests.render.plots.legible import assert_legible

DAMPINGS, STEPS = (0.01, 0.1, 1.0), (16, 32, 64, 128)


def frame_of(rows):
    return pd.DataFrame([{**dict.fromkeys(COLUMNS), "problem": "rope", **row} for row in rows])


@pytest.fixture
def frame():
    """Two steppers; one case of the first diverged, one has no order, one is not there."""
    rows = [
        {
            "stepper": stepper,
            "damping": damping,
            "steps_per_frame": steps,
            "status": "ok",
            "resolved": True,
            "order_verdict": "converges",
            "observed_order": order + damping / 100,
            "error_max": damping / steps**order,
        }
        for stepper, order in (("rk4", 4), ("explicit-euler", 1))
        for damping in DAMPINGS
        for steps in STEPS
    ]
    bad = frame_of(rows)
    euler = bad.index[bad["stepper"] == "explicit-euler"]
    bad.loc[euler[0], ["status", "observed_order"]] = ["diverged", None]
    bad.loc[euler[1], ["order_verdict", "observed_order"]] = ["undetermined", None]
    return bad.drop(euler[2])


def test_cells_without_a_number_say_why(frame):
    figure = plot_sweep(frame, "damping", "steps_per_frame", "observed_order")
    euler, rk4 = [axes for axes in figure.axes if axes.get_title()]
    assert (euler.get_title(), rk4.get_title()) == ("explicit-euler", "rk4")
    assert not [p for p in rk4.patches if isinstance(p, Rectangle)]
    hatched = {(p.get_x(), p.get_y()): p.get_hatch() for p in euler.patches}
    assert len(hatched) == len(set(hatched.values())) == 3
    [legend] = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == [
        "diverged",
        "order undetermined",
        "not computed yet",
    ]
    assert {h.get_hatch() for h in legend.legend_handles} == set(hatched.values())
    [mesh] = [each for each in rk4.collections if isinstance(each, QuadMesh)]
    expected = [[4 + damping / 100 for damping in DAMPINGS]] * len(STEPS)
    np.testing.assert_allclose(np.ma.getdata(mesh.get_array()), expected)
    [mesh] = [each for each in euler.collections if isinstance(each, QuadMesh)]
    assert np.ma.getmaskarray(mesh.get_array()).sum() == 3


def test_both_axes_are_logarithmic_where_the_values_are(frame):
    figure = plot_sweep(frame, "damping", "steps_per_frame", "error_max", {"stepper": "rk4"})
    axes = figure.axes[0]
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    assert [text.get_text() for text in axes.get_xticklabels()] == ["0.01", "0.1", "1"]
    [mesh] = [each for each in axes.collections if isinstance(each, QuadMesh)]
    assert isinstance(mesh.norm, LogNorm)
    # Cells meet halfway between the values, as the axis shows them.
    np.testing.assert_allclose(
        mesh.get_coordinates()[0, :, 0], 0.01 * 10 ** np.array([-0.5, 0.5, 1.5, 2.5])
    )


@pytest.mark.parametrize(
    ("values", "scale", "labels"),
    [
        ([0.0, 0.5, 1.0], "linear", ["0", "0.5", "1"]),
        ([0.0, 0.001, 0.01, 0.1], "linear", ["0", "0.001", "0.01", "0.1"]),
        ([10.0], "linear", ["10"]),
    ],
)
def test_axes_of_other_values(values, scale, labels):
    rows = [
        {"stepper": "rk4", "damping": d, "steps_per_frame": 4, "status": "ok", "error_max": 1.0 + d}
        for d in values
    ]
    axes = plot_sweep(frame_of(rows), "damping", "steps_per_frame", "error_max").axes[0]
    assert axes.get_xscale() == scale
    assert [text.get_text() for text in axes.get_xticklabels()] == labels


def test_draws_that_never_meet_are_points():
    draws = np.random.default_rng(0)
    rows = [
        {
            "stepper": "rk4",
            "damping": draws.uniform(),
            "stiffness": draws.uniform(),
            "status": "ok" if i % 5 else "diverged",
            "error_max": draws.uniform() if i % 5 else None,
        }
        for i in range(40)
    ]
    figure = plot_sweep(frame_of(rows), "damping", "stiffness", "error_max")
    coloured, crossed = [c for c in figure.axes[0].collections if isinstance(c, PathCollection)]
    assert len(np.ma.getdata(coloured.get_offsets())) == 32
    assert len(np.ma.getdata(crossed.get_offsets())) == 8
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["diverged"]


@pytest.fixture
def draws():
    """A random design of two parameters, each draw with two numbers of steps."""
    random = np.random.default_rng(0)
    return frame_of(
        [
            {
                "stepper": "rk4",
                "seed": 0,
                "draw": draw,
                "steps_per_frame": steps,
                "damping": damping,
                "stiffness": stiffness,
                "status": "ok",
                "error_max": damping / steps,
            }
            for draw, (damping, stiffness) in enumerate(10 ** random.uniform(-2, 2, (30, 2)))
            for steps in (16, 64)
        ]
    )


def test_draws_that_differ_in_what_is_not_shown_are_refused(draws):
    with pytest.raises(InputError, match=r"differ in steps_per_frame, .*--where steps_per_frame"):
        plot_sweep(draws, "damping", "stiffness", "error_max")
    # A sweep that is not finished has a single row in each place, of different steps.
    unfinished = draws.drop_duplicates("draw").assign(steps_per_frame=[16, 64] * 15)
    with pytest.raises(InputError, match=r"differ in steps_per_frame, .*--where steps_per_frame"):
        plot_sweep(unfinished, "damping", "stiffness", "error_max")
    # What a draw decides is named where it is not shown.
    figure = plot_sweep(draws, "damping", "steps_per_frame", "error_max")
    assert "along the axes also change: draw, stiffness" in figure.get_suptitle()


def test_inputs_that_were_drawn_log_uniformly_have_log_axes(draws):
    at_16 = {"steps_per_frame": 16}
    axes = plot_sweep(draws, "damping", "stiffness", "error_max", at_16).axes[0]
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    uniform = draws.assign(damping=1.0 + np.log10(draws["damping"]))
    uniform["damping"] -= uniform["damping"].min() - 0.01
    axes = plot_sweep(uniform, "damping", "stiffness", "error_max", at_16).axes[0]
    assert (axes.get_xscale(), axes.get_yscale()) == ("linear", "log")


def test_orders_have_a_colour_for_each_whole_number_and_are_printed(frame):
    figure = plot_sweep(frame, "damping", "steps_per_frame", "observed_order")
    *panels, bar = figure.axes
    assert [text.get_text() for text in bar.get_yticklabels()] == ["1", "2", "3", "4"]
    printed = {text.get_text() for axes in panels for text in axes.texts}
    assert printed == {"1.00", "1.01", "4.00", "4.01"}
    (mesh,) = [each for each in panels[1].collections if isinstance(each, QuadMesh)]
    assert len({tuple(each) for each in mesh.to_rgba(mesh.get_array()).reshape(-1, 4)}) == 1


def test_errors_of_runs_that_blew_up_do_not_stretch_the_colours(frame):
    frame["motion_size"] = 0.5
    frame.loc[frame.index[3], "error_max"] = 1e200
    frame.loc[frame.index[4], "error_max"] = np.inf
    figure = plot_sweep(frame, "damping", "steps_per_frame", "error_max")
    (mesh,) = [each for each in figure.axes[0].collections if isinstance(each, QuadMesh)]
    assert mesh.norm.vmax == 5.0
    assert "above 5.0e+00, 10 × the motion" in figure.axes[-1].get_ylabel()
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    assert "infinite" in legend


def test_an_input_without_values_is_no_axis(frame):
    with pytest.raises(InputError, match="x: 'seed' given; allowed: an input that every"):
        plot_sweep(frame, "seed", "steps_per_frame", "error_max")
    twice = pd.concat([frame, frame])
    with pytest.raises(InputError, match="the same case several times"):
        plot_sweep(twice, "damping", "steps_per_frame", "error_max")


def test_a_map_of_no_numbers_at_all(frame):
    frame["observed_order"], frame["order_verdict"] = None, "undetermined"
    figure = plot_sweep(frame, "damping", "steps_per_frame", "observed_order", {"stepper": "rk4"})
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["order undetermined"]


def test_rows_that_would_share_a_cell_are_refused(frame):
    message = r"rows differ in damping, .*\(damping: 0.01, 0.1, 1.0\).*--where damping=0.01,"
    with pytest.raises(InputError, match=message):
        plot_sweep(frame, "stepper", "steps_per_frame", "error_max")


def test_one_value_of_each_input_that_matters_is_selected(frame):
    """The draw decides on the stiffness, and the seed on nothing alone."""
    frames = [
        frame.assign(seed=seed, draw=draw, stiffness=10.0 * seed + draw)
        for seed in (0, 1)
        for draw in (0, 1)
    ]
    with pytest.raises(InputError) as refused:
        plot_sweep(pd.concat(frames), "damping", "steps_per_frame", "error_max")
    [line] = refused.value.problems
    assert "differ in seed, draw, stiffness, " in line
    assert "for example --where seed=0 --where draw=0, " in line
    selected = {"seed": 0, "draw": 0}
    plot_sweep(pd.concat(frames), "damping", "steps_per_frame", "error_max", selected)


@pytest.mark.parametrize("value", ["observed_order", "error_max"])
def test_all_of_it_is_legible(frame, value):
    assert_legible(plot_sweep(frame, "damping", "steps_per_frame", value))


def test_a_sweep_without_rows(frame):
    with pytest.raises(InputError, match="^sweep: 'no finished case' given; .* run the sweep"):
        plot_sweep(frame.iloc[:0], "damping", "steps_per_frame", "error_max")
