"""What every type of plot keeps to; the types are taken from the list of them."""

from __future__ import annotations

import itertools
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import ropeode
from ropeode.cli import cli
from ropeode.errors import InputError
from ropeode.files import check_suffix
from ropeode.render import FIGURES, PLOTS, figure_bytes
from tests.render.plots.legible import assert_legible

ALL_CASES = ["rope", "diverged", "cut", "one step size", "long names", "still"]
MAGIC = {".png": b"\x89PNG", ".pdf": b"%PDF", ".svg": b"<?xml"}


def test_types_are_listed_on_the_command_line():
    (option,) = (each for each in cli.commands["plot"].params if each.name == "name")
    assert tuple(PLOTS) == tuple(option.type.choices)


# The layout with the longest words, and that with the most lines.
LEGIBLE = [("convergence", "long names"), ("error", "rope"), ("energy", "rope")]


@pytest.mark.parametrize(
    ("kind", "case"),
    [
        pytest.param(kind, case, marks=() if (kind, case) in LEGIBLE else pytest.mark.slow)
        for kind in PLOTS
        for case in ALL_CASES
    ],
)
def test_all_of_it_is_legible(kind, case, study):
    data = study(kind, case)
    figure = PLOTS[kind].draw(data)
    assert isinstance(figure, Figure)
    assert data.problem.name in figure.get_suptitle()
    assert_legible(figure)


# Where the pictures are tested that are no type of `ropeode plot`.
ELSEWHERE = {
    "plot_horizon": "tests/render/test_horizon_formats.py",
    "plot_stability": "tests/render/plots/test_stability_plot.py",
    "plot_sweep": "tests/render/plots/test_sweep_map.py",
    "plot_work_precision": "tests/render/test_work_precision_formats.py",
}


def test_every_public_plot_is_tested_for_legibility():
    public = {name for name in ropeode.__all__ if name.startswith("plot_")}
    assert public == {plot.draw.__name__ for plot in PLOTS.values()} | set(ELSEWHERE)
    for name, path in ELSEWHERE.items():
        assert re.search(rf"assert_legible\({name}\(", Path(path).read_text()), name


@pytest.mark.parametrize("kind", PLOTS)
def test_axes_have_labels_with_units(kind, study):
    for case, unit in (("rope", True), ("diverged", False)):
        figure = PLOTS[kind].draw(study(kind, case))
        labels = [(each.get_xlabel(), each.get_ylabel()) for each in figure.axes]
        labels.append(("", figure.get_supylabel()))
        assert any(x for x, _ in labels)
        assert any(y for _, y in labels)
        for label in itertools.chain(*labels):
            assert not label or ("[" in label) == unit


SAME = list(zip(PLOTS, FIGURES, strict=True))


@pytest.mark.parametrize(
    ("kind", "suffix"),
    [
        pytest.param(*each, marks=() if each in SAME else pytest.mark.slow)
        for each in itertools.product(PLOTS, FIGURES)
    ],
)
def test_files_are_of_their_format_and_the_same_each_time(kind, suffix, study):
    first, second = (
        figure_bytes(PLOTS[kind].draw(study(kind, "diverged")), each)
        for each in (suffix, suffix.upper())
    )
    assert first.startswith(MAGIC[suffix])
    assert first == second


def test_file_names_are_checked(tmp_path):
    assert check_suffix("out", tmp_path / "a.PNG", FIGURES) == tmp_path / "a.PNG"
    with pytest.raises(InputError, match=r"out: .* ends in .png, .pdf, .svg\. Fix: .* a.png"):
        check_suffix("out", tmp_path / "a.jpg", FIGURES)
    with pytest.raises(InputError, match="out: .* folder that exists"):
        check_suffix("out", tmp_path / "missing" / "a.png", FIGURES)


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


@pytest.mark.parametrize("kind", PLOTS)
def test_the_callers_settings_stay(kind, study):
    import matplotlib

    with matplotlib.rc_context({"font.size": 33.0}):
        figure = PLOTS[kind].draw(study(kind, "diverged"))
        assert matplotlib.rcParams["font.size"] == 33.0
    sizes = [text.get_fontsize() for legend in figure.legends for text in legend.get_texts()]
    assert np.max(sizes) < 12
