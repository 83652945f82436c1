"""What pictures show of studies that are made up, held by files that a reviewer reads.

What they promise is in docs/howto/plots.md, docs/howto/work-precision.md and docs/howto/sweeps.md.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import matplotlib
import pytest

import ropeode
from ropeode import (
    Rope,
    plot_convergence,
    plot_energies,
    plot_errors,
    plot_horizon,
    plot_stability,
    plot_sweep,
    plot_work_precision,
)
from ropeode.analysis import REASONS
from ropeode.cli import cli
from ropeode.errors import InputError
from ropeode.files import check_suffix
from ropeode.render import FIGURES, PLOTS, figure_bytes
from ropeode.study import WorkPrecision
from tests.golden import check_golden
from tests.render.made_up import MADE_UP, made
from tests.render.plots import studies
from tests.render.plots.drawn import described
from tests.render.plots.legible import assert_legible

OVER_STEPS = ("damping", "steps_per_frame")
# A picture, what it is a picture of, and how it is asked for.
PICTURES = {
    "convergence": (plot_convergence, "every-reason"),
    "convergence-of-all-twice": (plot_convergence, studies.all_twice),
    "convergence-without-orders": (plot_convergence, "no-order"),
    "convergence-of-nothing": (plot_convergence, "still"),
    "errors": (plot_errors, "errors"),
    "errors-in-one-panel": (plot_errors, studies.errors_in_one_panel),
    "energies": (plot_energies, "energies"),
    "horizon": (plot_horizon, MADE_UP["horizon"]),
    "stability": (plot_stability, studies.stability),
    "work": (plot_work_precision, "work", "rhs_evaluations"),
    "work-time": (plot_work_precision, "work", "seconds", "error_final"),
    "work-energy": (plot_work_precision, "work", "steps", "energy_error"),
    "work-with-a-gap": (plot_work_precision, "gap", "rhs_evaluations"),
    "sweep-orders": (plot_sweep, studies.sweep, *OVER_STEPS, "observed_order"),
    "sweep-errors": (plot_sweep, studies.blown_up, *OVER_STEPS, "error_max"),
    "sweep-of-nothing": (plot_sweep, studies.without_orders, *OVER_STEPS, "observed_order"),
    "sweep-draws": (
        plot_sweep,
        lambda: studies.sweep("draws"),
        "damping",
        "stiffness",
        "error_max",
    ),
}


def drawn(name):
    plot, study, *asked = PICTURES[name]
    return plot(studies.study(study) if isinstance(study, str) else study(), *asked)


@pytest.mark.parametrize("name", PICTURES)
def test_a_picture_is_that_of_its_file_and_legible_whatever_the_callers_settings(name):
    with matplotlib.rc_context({"font.size": 33.0}):
        figure = drawn(name)
        assert matplotlib.rcParams["font.size"] == 33.0
    check_golden(f"{name}.picture.txt", described(figure))
    # Error bars and the front are lines of their own, which may lie on others.
    assert_legible(figure, [] if name.startswith("work") else None)


def test_no_public_plot_type_of_plot_or_reason_is_missing():
    (order, _) = studies.study("every-reason").orders
    assert {each.reason for each in order.order.left_out} == {*REASONS}
    known = {plot.__name__ for plot, *_ in PICTURES.values()}
    assert {name for name in ropeode.__all__ if name.startswith("plot_")} == known
    (option,) = (each for each in cli.commands["plot"].params if each.name == "name")
    assert tuple(PLOTS) == tuple(option.type.choices)


@pytest.mark.parametrize("calls", [[7], [90, 2000]])
def test_the_cost_axis_says_two_numbers(calls):
    rows = [
        {"method": "some", "effort": 1e-2 / each, "error": 1e-3 / each, "cost": each}
        for each in calls
    ]
    study = made(WorkPrecision, {**studies.DATA["gap"], "rows": rows})
    figure = plot_work_precision(study, "rhs_evaluations")
    figure.draw_without_rendering()
    (axes,) = figure.axes
    low, high = axes.get_xlim()
    labels = axes.xaxis.get_ticklabels()
    shown = [x for x, label in zip(axes.get_xticks(), labels, strict=True) if label.get_text()]
    assert sum(low <= x <= high for x in shown) >= 2


def test_a_region_of_stability_needs_one_and_steps():
    without = MADE_UP["explain"]()
    with pytest.raises(InputError, match="explanation: 'steps.py:heavy' given; .* Fix: "):
        plot_stability(without)
    with pytest.raises(InputError, match="steps_per_frame: .0. given"):
        plot_stability(studies.stability(), [0])


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


@pytest.mark.slow
def test_no_window_and_no_global_figure(tmp_path):
    code = (
        "import sys, ropeode\n"
        "rope = ropeode.Rope(num_nodes=4).problem(frames=3)\n"
        "ropeode.plot_convergence(ropeode.accuracy_table(rope, ['rk4'], [4, 8, 16]))\n"
        "ropeode.animate(ropeode.node_paths(rope, ['rk4'], 1)).save('a.gif')\n"
        "print('matplotlib.pyplot' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert done.stdout == "False\n"
