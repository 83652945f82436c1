"""What pictures show of made-up studies, in files that a reviewer reads; and what no file shows.

What they promise is in docs/howto/plots.md, docs/howto/work-precision.md and docs/howto/sweeps.md.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import matplotlib
import numpy as np
import pandas as pd
import pytest
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

import ropeode
from ropeode import Rope
from ropeode.analysis import REASONS
from ropeode.cli import cli
from ropeode.errors import InputError
from ropeode.files import check_suffix
from ropeode.render import FIGURES, PLOTS, figure_bytes
from tests.golden import check_golden
from tests.render.made_up import MADE_UP, table_of
from tests.render.plots import studies
from tests.render.plots.drawn import described, look
from tests.render.plots.legible import assert_legible

OVER_STEPS = ("damping", "steps_per_frame")
# A picture, what it is a picture of, and how it is asked for.
PICTURES = {
    "convergence": (ropeode.plot_convergence, "every-reason"),
    "convergence-of-all-twice": (ropeode.plot_convergence, studies.all_twice),
    "convergence-without-orders": (ropeode.plot_convergence, "no-order"),
    "convergence-of-nothing": (ropeode.plot_convergence, "still"),
    "errors": (ropeode.plot_errors, "errors"),
    "errors-in-one-panel": (ropeode.plot_errors, studies.errors_in_one_panel),
    "energies": (ropeode.plot_energies, "energies"),
    "horizon": (ropeode.plot_horizon, MADE_UP["horizon"]),
    "stability": (ropeode.plot_stability, studies.stability),
    "work": (ropeode.plot_work_precision, "work", "rhs_evaluations"),
    "work-time": (ropeode.plot_work_precision, "work", "seconds", "error_final"),
    "work-energy": (ropeode.plot_work_precision, "work", "steps", "energy_error"),
    "work-with-a-gap": (ropeode.plot_work_precision, "gap", "rhs_evaluations"),
    "sweep-orders": (ropeode.plot_sweep, studies.sweep, *OVER_STEPS, "observed_order"),
    "sweep-errors": (ropeode.plot_sweep, studies.blown_up, *OVER_STEPS, "error_max"),
    "sweep-of-nothing": (ropeode.plot_sweep, studies.without_orders, *OVER_STEPS, "observed_order"),
    "sweep-draws": (
        ropeode.plot_sweep,
        lambda: studies.sweep("draws"),
        "damping",
        "stiffness",
        "error_max",
    ),
}


def drawn(name):
    plot, study, *asked = PICTURES[name]
    return plot(studies.named(study) if isinstance(study, str) else study(), *asked)


@pytest.mark.parametrize("name", PICTURES)
def test_a_picture_is_that_of_its_file_and_legible_whatever_the_callers_settings(name):
    with matplotlib.rc_context({"font.size": 33.0}):
        figure = drawn(name)
        assert matplotlib.rcParams["font.size"] == 33.0
    check_golden(f"{name}.picture.txt", described(figure))
    # Error bars and the front are lines of their own, which may lie on others.
    assert_legible(figure, [] if name.startswith("work") else None)


def test_no_public_plot_type_of_plot_or_reason_is_missing():
    (order, _) = studies.named("every-reason").orders
    assert {each.reason for each in order.order.left_out} == {*REASONS}
    known = {plot.__name__ for plot, *_ in PICTURES.values()}
    assert {name for name in ropeode.__all__ if name.startswith("plot_")} == known
    (option,) = (each for each in cli.commands["plot"].params if each.name == "name")
    assert tuple(PLOTS) == tuple(option.type.choices)


@pytest.mark.parametrize("calls", [[7], [90, 2000]])
def test_the_cost_axis_says_two_numbers(calls):
    gap = studies.named("gap")
    rows = tuple(dataclasses.replace(gap.rows[0], rhs_evaluations=each) for each in calls)
    study = dataclasses.replace(gap, rows=rows)
    figure = ropeode.plot_work_precision(study, "rhs_evaluations")
    figure.draw_without_rendering()
    (axes,) = figure.axes
    low, high = axes.get_xlim()
    labels = axes.xaxis.get_ticklabels()
    shown = [x for x, label in zip(axes.get_xticks(), labels, strict=True) if label.get_text()]
    assert sum(low <= x <= high for x in shown) >= 2


def test_a_region_of_stability_needs_one_and_steps():
    without = MADE_UP["explain"]()
    with pytest.raises(InputError, match="explanation: 'steps.py:heavy' given; .* Fix: "):
        ropeode.plot_stability(without)
    with pytest.raises(InputError, match="steps_per_frame: .0. given"):
        ropeode.plot_stability(studies.stability(), [0])


BEGINNINGS = {".png": b"\x89PNG", ".pdf": b"%PDF", ".svg": b"<?xml"}


@pytest.mark.parametrize("suffix", FIGURES)
def test_files_are_of_their_format_and_the_same_each_time(suffix):
    begins = BEGINNINGS[suffix]
    first, second = (figure_bytes(drawn("stability"), each) for each in (suffix, suffix.upper()))
    assert first.startswith(begins)
    assert first == second


def test_file_names_are_checked():
    assert check_suffix("out", "a.PNG", FIGURES) == Path("a.PNG")
    with pytest.raises(InputError, match=r"out: .* ends in .png, .pdf, .svg\. Fix: .* a.png"):
        check_suffix("out", "a.jpg", FIGURES)


ROPE = Rope(num_nodes=4, damping=0.0)
DENSE = (4, 8, 33, 66, 132, 1000, 3000, 30000)
# Many orders, round-off and some that blow up; a reference that ends before the frames do.
STUDIES = {
    "convergence": (["stormer-verlet", "rk4", "explicit-euler"], DENSE, {}),
    "error": (["rk4", "explicit-euler"], (40, 60, 90), {"rtol": 1e-6, "accuracy": 3e-4}),
    "energy": (["stormer-verlet", "rk4", "explicit-euler"], DENSE, {}),
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", PLOTS)
def test_what_is_computed_is_legible(kind):
    steppers, steps, options = STUDIES[kind]
    plot, problem = PLOTS[kind], ROPE.problem(frames=3)
    study = plot.study(problem, steppers, steps_per_frame=steps, norm=None, **options)
    assert_legible(plot.draw(study))


def test_triangles_have_the_slopes_of_the_orders():
    (axes,) = ropeode.plot_convergence(studies.named("every-reason")).axes
    to_data = axes.transAxes + axes.transData.inverted()
    slopes = []
    for triangle in (patch for patch in axes.patches if isinstance(patch, Polygon)):
        (x0, y0), _, (x1, y1) = np.log(to_data.transform(triangle.get_xy()[:3]))
        slopes.append((y1 - y0) / (x1 - x0))
    assert slopes == pytest.approx([2, 4], rel=1e-6)


def test_many_steppers_all_look_different():
    names = [f"stepper {i}" for i in range(56)]
    found = studies.named("no-order")
    rows, orders = (
        [dataclasses.replace(each[0], stepper=name) for name in names]
        for each in (found.rows, found.orders)
    )
    axes = Figure().subplots()
    ropeode.plot_convergence(table_of(rows, orders), ax=axes)
    legend = axes.get_legend()
    looks = {
        look(handle)
        for handle, text in zip(legend.legend_handles, legend.get_texts(), strict=True)
        if text.get_text().startswith("stepper ")
    }
    assert len(looks) == len(names)


def test_it_draws_in_axes_of_the_users():
    table = studies.named("every-reason")
    figure = Figure(figsize=(12, 4), layout="constrained")
    left, right = figure.subplots(1, 2)
    assert ropeode.plot_convergence(table, ax=right) is figure
    (own,) = ropeode.plot_convergence(table).axes
    drawn = [[(look(line), line.get_xydata().tolist()) for line in ax.lines] for ax in (own, right)]
    assert drawn[0] == drawn[1]
    assert not left.lines
    assert right.get_legend()
    assert table.problem.name in right.get_title()
    figure_bytes(figure, ".png")


@pytest.mark.parametrize("values", [[0.0, 0.001, 0.01, 0.1], [10.0]])
def test_axes_are_linear_where_there_is_zero_or_a_single_value(values):
    known = {"stepper": "rk4", "steps_per_frame": 4, "status": "ok"}
    rows = [{**known, "damping": each, "error_max": 1.0 + each} for each in values]
    axes = ropeode.plot_sweep(studies.frame_of(rows), *OVER_STEPS, "error_max").axes[0]
    assert axes.get_xscale() == "linear"
    assert [text.get_text() for text in axes.get_xticklabels()] == [f"{x:g}" for x in values]


@pytest.fixture
def draws():
    """A random design of two parameters, each draw with two numbers of steps."""
    random = np.random.default_rng(0)
    found = pd.DataFrame(10 ** random.uniform(-2, 2, (30, 2)), columns=["damping", "stiffness"])
    steps = pd.DataFrame({"steps_per_frame": [16, 64]})
    found = found.assign(stepper="rk4", seed=0, draw=range(30), status="ok").merge(steps, "cross")
    found = found.assign(error_max=found["damping"] / found["steps_per_frame"])
    return studies.frame_of(found.to_dict("records"))


def test_draws_that_differ_in_what_is_not_shown_are_refused(draws):
    # A sweep that is not finished has a single row in each place, of different steps.
    unfinished = draws.drop_duplicates("draw").assign(steps_per_frame=[16, 64] * 15)
    for rows in (draws, unfinished):
        with pytest.raises(InputError, match="differ in steps_per_frame, .*--where steps_per_fr"):
            ropeode.plot_sweep(rows, "damping", "stiffness", "error_max")
    # What a draw decides is named where it is not shown.
    figure = ropeode.plot_sweep(draws, *OVER_STEPS, "error_max")
    assert "along the axes also change: draw, stiffness" in figure.get_suptitle()


def test_inputs_that_were_drawn_log_uniformly_have_log_axes(draws):
    at_16 = {"steps_per_frame": 16}
    axes = ropeode.plot_sweep(draws, "damping", "stiffness", "error_max", at_16).axes[0]
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    uniform = draws.assign(damping=1.0 + np.log10(draws["damping"]))
    uniform["damping"] -= uniform["damping"].min() - 0.01
    axes = ropeode.plot_sweep(uniform, "damping", "stiffness", "error_max", at_16).axes[0]
    assert (axes.get_xscale(), axes.get_yscale()) == ("linear", "log")


def test_orders_have_a_colour_for_each_whole_number():
    *panels, _ = ropeode.plot_sweep(studies.sweep(), *OVER_STEPS, "observed_order").axes
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
        ropeode.plot_sweep(changed(studies.sweep()), x, "steps_per_frame", "error_max")


def test_one_value_of_each_input_that_matters_is_selected():
    """The draw decides on the stiffness, and the seed on nothing alone."""
    frames = pd.concat(
        studies.sweep().assign(seed=seed, draw=draw, stiffness=10.0 * seed + draw)
        for seed in (0, 1)
        for draw in (0, 1)
    )
    with pytest.raises(InputError) as refused:
        ropeode.plot_sweep(frames, *OVER_STEPS, "error_max")
    [line] = refused.value.problems
    assert "differ in seed, draw, stiffness, " in line
    assert "for example --where seed=0 --where draw=0, " in line
    ropeode.plot_sweep(frames, *OVER_STEPS, "error_max", {"seed": 0, "draw": 0})
