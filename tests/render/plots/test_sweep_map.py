"""What no file of `test_plot_pictures.py` shows of maps of sweeps."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from matplotlib.collections import QuadMesh

from ropeode import plot_sweep
from ropeode.errors import InputError
from tests.render.plots.studies import frame_of, sweep


@pytest.mark.parametrize(
    ("values", "scale", "labels"),
    [
        ([0.0, 0.5, 1.0], "linear", ["0", "0.5", "1"]),
        ([0.0, 0.001, 0.01, 0.1], "linear", ["0", "0.001", "0.01", "0.1"]),
        ([10.0], "linear", ["10"]),
    ],
)
def test_axes_are_logarithmic_where_the_values_are(values, scale, labels):
    rows = [
        {"stepper": "rk4", "damping": d, "steps_per_frame": 4, "status": "ok", "error_max": 1.0 + d}
        for d in values
    ]
    axes = plot_sweep(frame_of(rows), "damping", "steps_per_frame", "error_max").axes[0]
    assert axes.get_xscale() == scale
    assert [text.get_text() for text in axes.get_xticklabels()] == labels


@pytest.fixture
def draws():
    """A random design of two parameters, each draw with two numbers of steps."""
    random = np.random.default_rng(0)
    found = pd.DataFrame(10 ** random.uniform(-2, 2, (30, 2)), columns=["damping", "stiffness"])
    steps = pd.DataFrame({"steps_per_frame": [16, 64]})
    found = found.assign(stepper="rk4", seed=0, draw=range(30), status="ok").merge(steps, "cross")
    found = found.assign(error_max=found["damping"] / found["steps_per_frame"])
    return frame_of(found.to_dict("records"))


def test_draws_that_differ_in_what_is_not_shown_are_refused(draws):
    # A sweep that is not finished has a single row in each place, of different steps.
    unfinished = draws.drop_duplicates("draw").assign(steps_per_frame=[16, 64] * 15)
    for rows in (draws, unfinished):
        with pytest.raises(InputError, match="differ in steps_per_frame, .*--where steps_per_fr"):
            plot_sweep(rows, "damping", "stiffness", "error_max")
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


def test_orders_have_a_colour_for_each_whole_number():
    *panels, _ = plot_sweep(sweep(), "damping", "steps_per_frame", "observed_order").axes
    (mesh,) = [each for each in panels[1].collections if isinstance(each, QuadMesh)]
    assert len({tuple(each) for each in mesh.to_rgba(mesh.get_array()).reshape(-1, 4)}) == 1


DAMPINGS_DIFFER = r"rows differ in damping, .*\(damping: 0.01, 0.1, 1.0\).*--where damping=0.01,"


@pytest.mark.parametrize(
    ("changed", "x", "words"),
    [
        (lambda frame: frame, "seed", "x: 'seed' given; allowed: an input that every"),
        (lambda frame: frame, "stepper", DAMPINGS_DIFFER),
        (lambda frame: pd.concat([frame, frame]), "damping", "the same case several times"),
        (lambda frame: frame.iloc[:0], "damping", "^sweep: 'no finished case' .* run the sweep"),
    ],
)
def test_what_cannot_be_drawn_is_refused(changed, x, words):
    with pytest.raises(InputError, match=words):
        plot_sweep(changed(sweep()), x, "steps_per_frame", "error_max")


def test_one_value_of_each_input_that_matters_is_selected():
    """The draw decides on the stiffness, and the seed on nothing alone."""
    frames = pd.concat(
        sweep().assign(seed=seed, draw=draw, stiffness=10.0 * seed + draw)
        for seed in (0, 1)
        for draw in (0, 1)
    )
    with pytest.raises(InputError) as refused:
        plot_sweep(frames, "damping", "steps_per_frame", "error_max")
    [line] = refused.value.problems
    assert "differ in seed, draw, stiffness, " in line
    assert "for example --where seed=0 --where draw=0, " in line
    plot_sweep(frames, "damping", "steps_per_frame", "error_max", {"seed": 0, "draw": 0})
