"""Films show each sample as it was computed, and are written whole or not at all."""

from __future__ import annotations

import dataclasses
import itertools
import os

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex
from PIL import Image

from ropeode.errors import InputError
from ropeode.problems.rope import Rope
from ropeode.render.plots import animation
from ropeode.render.plots.animation import animate, check_fps
from ropeode.render.plots.film import film
from ropeode.study.node_paths import node_paths


@pytest.fixture(scope="module")
def short():
    """Soft springs, for which explicit Euler stays in sight."""
    rope = Rope(num_nodes=4, stiffness=1.0).problem(frames=3)
    return node_paths(rope, ["rk4", "explicit-euler"], 4)


@pytest.fixture(scope="module")
def cut():
    """The reference ends before the frames do."""
    rope = Rope(num_nodes=4, damping=0.0).problem(frames=3)
    return node_paths(rope, ["rk4"], 4, rtol=1e-7, accuracy=1.6e-7)


def nodes_and_trace(axes):
    nodes = [line for line in axes.lines if line.get_marker() == "o"]
    traces = [line for line in axes.lines if line.get_marker() == "None"]
    assert len(nodes) == len(traces) == 1
    return nodes[0].get_xydata(), traces[0].get_xydata()


def words(axes):
    return axes.get_title(loc="left").splitlines()


def test_each_sample_is_shown_as_computed(short):
    figure, show = film(short)
    known, *others = figure.axes
    for sample in (0, 3, len(short.times) - 1, 1):
        show(sample)
        nodes, trace = nodes_and_trace(known)
        assert np.array_equal(nodes, short.reference.positions[sample])
        assert np.array_equal(trace, short.reference.positions[: sample + 1, -1])
        assert f"frame {sample / short.samples_per_frame:.2f} of 3" in figure.get_suptitle()
        assert words(known)[0] == "reference"
        for axes, path in zip(others, short.paths, strict=True):
            nodes, trace = nodes_and_trace(axes)
            assert np.array_equal(nodes, path.positions[sample])
            assert np.array_equal(trace, path.positions[: sample + 1, -1])
            assert words(axes)[0] == path.stepper
            if path.errors[sample] >= short.resolution[sample]:
                assert words(axes)[1] == f"error {path.errors[sample]:.2e}"
            else:
                assert words(axes)[1] == f"error < {short.resolution[sample]:.1e}"
    assert len({(each.get_xlim(), each.get_ylim()) for each in figure.axes}) == 1
    assert len({to_hex(each.lines[0].get_color()) for each in figure.axes}) == len(figure.axes)


def test_titles_stay_inside_their_panels(cut):
    """The longest that there are: a stepper with its options, and what is not known."""
    name = "stormer-verlet:start=rest,damping=per-step"
    path = dataclasses.replace(cut.paths[0], stepper=name)
    figure, show = film(dataclasses.replace(cut, paths=(path, path)))
    show(len(cut.times) - 1)
    renderer = FigureCanvasAgg(figure).get_renderer()
    figure.draw_without_rendering()
    boxes = [each.get_tightbbox(renderer) for each in figure.axes]
    for one, other in itertools.combinations(boxes, 2):
        assert not one.overlaps(other)
    assert max(box.x1 for box in boxes) <= figure.bbox.width


def test_reference_ends_at_its_horizon(cut):
    figure, show = film(cut)
    trusted, parts = cut.reference.trusted, cut.samples_per_frame
    assert trusted < len(cut.times)
    show(trusted - 1)
    assert len(nodes_and_trace(figure.axes[0])[0]) == 4
    assert words(figure.axes[1])[1].startswith("error ")
    show(trusted)
    nodes, trace = nodes_and_trace(figure.axes[0])
    assert len(nodes) == 0
    assert len(trace) == trusted
    assert words(figure.axes[0])[1] == f"ended: trusted before frame {trusted / parts:g}"
    assert words(figure.axes[1])[1] == "error unknown: no reference"
    assert np.array_equal(nodes_and_trace(figure.axes[1])[0], cut.paths[0].positions[trusted])


def test_diverged_run_stays_at_its_last_finite_state(short):
    positions = short.paths[0].positions[:6].copy()
    positions[-1, -1] = 1e200
    path = dataclasses.replace(short.paths[0], positions=positions, diverged_at=2)
    figure, show = film(dataclasses.replace(short, paths=(path,)))
    show(len(path.positions))
    assert words(figure.axes[1])[1] == "diverged at frame 2"
    nodes, trace = nodes_and_trace(figure.axes[1])
    last, near = positions[-1], np.array([True, True, True, False])
    assert np.array_equal(nodes[near], last[near])
    assert np.all(np.isnan(nodes[~near]))
    assert len(trace) == len(path.positions)


def test_three_components_are_seen_from_the_third_axis():
    rope = Rope(start=[0, 0, 0], end=[0, -3, 1], num_nodes=5, stiffness=1, gravity=[0, 0, -1])
    paths = node_paths(rope.problem(frames=3), ["rk4"], 1)
    figure, show = film(paths)
    show(2)
    assert "x and y of 3 components" in " ".join(figure.get_suptitle().split())
    assert np.array_equal(nodes_and_trace(figure.axes[1])[0], paths.paths[0].positions[2, :, :2])


def test_the_traced_node_moves():
    paths = node_paths(Rope(num_nodes=4, pinned=[0, 2, 3]).problem(frames=3), ["rk4"], 4)
    figure, show = film(paths)
    show(len(paths.times) - 1)
    assert np.array_equal(nodes_and_trace(figure.axes[0])[1], paths.reference.positions[:, 1])


def test_gif_has_a_picture_for_each_sample(short, tmp_path):
    said = []
    path = animate(short, tmp_path / "a.gif", fps=25, progress=lambda *each: said.append(each))
    with Image.open(path) as image:
        assert image.n_frames == len(short.times) == 3 * 4 + 1
        assert image.info["duration"] == 40
        sizes = set()
        for k in range(image.n_frames):
            image.seek(k)
            sizes.add(image.convert("RGB").size)
        assert len(sizes) == 1
    assert [fraction for _, fraction in said] == pytest.approx(np.linspace(0, 1, 14))
    assert os.listdir(tmp_path) == ["a.gif"]


def test_mp4_has_a_picture_for_each_sample(short, tmp_path):
    import imageio_ffmpeg

    path = animate(short, tmp_path / "a.mp4", fps=10)
    frames, seconds = imageio_ffmpeg.count_frames_and_secs(path)
    assert frames == len(short.times)
    assert seconds == pytest.approx(1.3, abs=0.05)
    assert os.listdir(tmp_path) == ["a.mp4"]


@pytest.mark.parametrize("suffix", animation.FILMS)
def test_what_fails_half_way_leaves_the_old_file(suffix, short, tmp_path, monkeypatch):
    out = tmp_path / f"a{suffix}"
    out.write_bytes(b"old")
    figure, show = film(short)

    def broken(sample):
        show(sample)
        if sample == 2:
            raise RuntimeError("half way")

    monkeypatch.setattr(animation, "film", lambda paths: (figure, broken))
    with pytest.raises(RuntimeError, match="half way"):
        animate(short, out)
    assert out.read_bytes() == b"old"
    assert os.listdir(tmp_path) == [out.name]


@pytest.mark.parametrize("fps", [0, -1, 51, "fast", float("nan"), None])
def test_bad_fps(fps):
    with pytest.raises(InputError, match="fps: .* given; allowed: a number above 0 and up to 50"):
        check_fps(fps)


def test_bad_file_names(short, tmp_path):
    with pytest.raises(InputError, match=r"out: .* ends in .gif, .mp4\. Fix: for example a.gif"):
        animate(short, tmp_path / "a.png")
