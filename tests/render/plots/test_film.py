"""Films show each sample as it was computed, and are written whole or not at all."""

from __future__ import annotations

import base64
import dataclasses
import itertools
import os

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex
from PIL import Image

from ropeode import Rope, animate, node_paths
from ropeode.errors import InputError
from ropeode.render import film


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


def lines(axes):
    """The reference behind a run, the trace, the nodes, and the box of the first view."""
    return [line.get_xydata() for line in axes.lines if line.get_animated()]


def nodes_and_trace(axes):
    _, trace, nodes, _ = lines(axes)
    return nodes, trace


def words(axes):
    """The name, the error, and how it is drawn."""
    *_, error, scale, larger = (text.get_text() for text in axes.texts)
    return axes.get_title(loc="left").strip(), error, scale, larger


def seen(axes, positions):
    """Where nodes are drawn in a panel, by the words at it."""
    middle = np.mean([axes.get_xlim(), axes.get_ylim()], axis=1)
    *_, view = words(axes)[3].rpartition("view × ")
    return middle + (positions - middle) / float(view or 1)


def test_each_sample_is_shown_as_computed(short):
    figure, show = film(short)
    known, *others = figure.axes
    truth = short.reference.positions
    for sample in (0, 3, len(short.times) - 1, 1):
        show(sample)
        nodes, trace = nodes_and_trace(known)
        assert nodes == pytest.approx(truth[sample])
        assert trace == pytest.approx(truth[: sample + 1, -1])
        assert known.texts[0].get_text() == f"frame {sample / short.samples_per_frame:.2f} of 3"
        assert words(known)[0] == "reference"
        for axes, path, times in zip(others, short.paths, (1e8, 100), strict=True):
            behind, trace, nodes, box = lines(axes)
            assert words(axes)[3] == ("errors × 1e8" if times > 100 else "errors × 100")
            magnified = truth + times * (path.positions - truth)
            assert behind == pytest.approx(truth[sample])
            assert nodes == pytest.approx(magnified[sample])
            assert trace == pytest.approx(magnified[: sample + 1, -1])
            assert len(box) == 0
            assert words(axes)[0] == path.stepper
            if path.errors[sample] >= short.resolution[sample]:
                assert words(axes)[1] == f"error {path.errors[sample]:.2e}"
            else:
                assert words(axes)[1] == f"error < {short.resolution[sample]:.1e}"
    assert len({(each.get_xlim(), each.get_ylim()) for each in figure.axes}) == 1
    assert len({to_hex(each.lines[2].get_color()) for each in figure.axes}) == len(figure.axes)


def test_errors_are_magnified_until_they_can_be_seen(short):
    """Those that the reference cannot tell are not."""
    size = np.max(np.ptp(short.reference.positions.reshape(-1, 2), axis=0))
    path, (bound,) = short.paths[0], set(short.reference.certificate.bounds["position"][-1:])
    for largest, least, most in ((1e-3, 0.02, 0.2), (bound, 0, 0.02), (0.3, 0.3, 0.3)):
        scaled = path.differences * (largest * size / np.max(np.abs(path.differences)))
        scaled = scaled if largest > bound else scaled / size
        one = dataclasses.replace(
            path, positions=short.reference.positions + scaled, differences=scaled
        )
        figure, show = film(dataclasses.replace(short, paths=(one,)))
        assert "errors" in words(figure.axes[1])[3] or largest == 0.3
        away = []
        for sample in range(len(short.times)):
            show(sample)
            behind, _, nodes, _ = lines(figure.axes[1])
            away.append(np.max(np.linalg.norm(nodes - behind, axis=1)))
        assert least * 0.99 <= max(away) / size <= most * 1.5


def test_the_view_follows_an_explosion(short):
    """All nodes stay in the panel, and its words say how far it is seen from."""
    far = short.paths[0].positions.copy()
    far[3:] *= np.geomspace(3.0, 1e200, len(far) - 3)[:, None, None]
    one = dataclasses.replace(short.paths[0], positions=far, differences=far - far[:1])
    figure, show = film(dataclasses.replace(short, paths=(one,)))
    axes = figure.axes[1]
    low, high = np.transpose([axes.get_xlim(), axes.get_ylim()])
    for sample in range(len(far)):
        show(sample)
        _, _, nodes, box = lines(axes)
        *_, scale, larger = words(axes)
        zoom = float(larger.split()[-1]) if larger else 1.0
        assert np.all((nodes >= low) & (nodes <= high))
        assert nodes == pytest.approx(seen(axes, far[sample]))
        assert (len(box) > 0) == (zoom > 1) == (sample >= 3)
        assert float(scale.split()[0]) == pytest.approx(
            zoom * float(words(figure.axes[0])[2].split()[0])
        )
    assert zoom > 1e190


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
    assert words(figure.axes[1])[3] == "view × 2"
    assert seen(figure.axes[1], cut.paths[0].positions[trusted]) == pytest.approx(
        nodes_and_trace(figure.axes[1])[0]
    )
    assert len(lines(figure.axes[1])[0]) == 0


def test_diverged_run_stays_at_its_last_finite_state(short):
    positions = short.paths[0].positions[:6].copy()
    positions[-1, -1] = 1e300
    differences = positions - short.reference.positions[:6]
    path = dataclasses.replace(
        short.paths[0],
        positions=positions,
        differences=differences,
        status="diverged",
        diverged_at=2,
    )
    figure, show = film(dataclasses.replace(short, paths=(path,)))
    show(len(path.positions))
    assert words(figure.axes[1])[1] == "diverged at frame 2"
    last = nodes_and_trace(figure.axes[1])
    show(len(path.positions) - 1)
    for kept, now in zip(last, nodes_and_trace(figure.axes[1]), strict=True):
        assert np.array_equal(kept, now)


def test_three_components_are_seen_from_the_third_axis():
    rope = Rope(start=[0, 0, 0], end=[0, -3, 1], num_nodes=5, stiffness=1, gravity=[0, 0, -1])
    paths = node_paths(rope.problem(frames=3), ["rk4"], 1)
    figure, show = film(paths)
    show(2)
    assert "x and y of 3 components" in " ".join(figure.get_suptitle().split())
    behind, _, nodes, _ = lines(figure.axes[1])
    assert behind == pytest.approx(paths.reference.positions[2, :, :2])
    assert nodes.shape == (5, 2)


def test_the_traced_node_moves():
    paths = node_paths(Rope(num_nodes=4, pinned=[0, 2, 3]).problem(frames=3), ["rk4"], 4)
    figure, show = film(paths)
    show(len(paths.times) - 1)
    assert nodes_and_trace(figure.axes[0])[1] == pytest.approx(paths.reference.positions[:, 1])


def test_gif_has_a_picture_for_each_sample(short, tmp_path):
    said = []
    film = animate(short, fps=25)
    assert repr(film).endswith("13 pictures, 0.52 seconds>")
    path = film.save(tmp_path / "a.gif", progress=lambda *each: said.append(each))
    shown = film._repr_html_().partition("base64,")[2].rstrip('">')
    assert base64.b64decode(shown) == path.read_bytes()
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

    path = animate(short, fps=10).save(tmp_path / "a.mp4")
    frames, seconds = imageio_ffmpeg.count_frames_and_secs(path)
    assert frames == len(short.times)
    assert seconds == pytest.approx(1.3, abs=0.05)
    assert os.listdir(tmp_path) == ["a.mp4"]


@pytest.mark.parametrize("suffix", [".gif", ".mp4"])
def test_no_room_leaves_the_old_film(suffix, short, tmp_path, room_for):
    out = tmp_path / f"a{suffix}"
    out.write_bytes(b"old")
    film = animate(short)
    with room_for(1000), pytest.raises(InputError, match="out: .* given"):
        film.save(out)
    assert out.read_bytes() == b"old"
    assert os.listdir(tmp_path) == [out.name]


@pytest.mark.parametrize("suffix", [".gif", ".mp4"])
def test_what_fails_half_way_leaves_the_old_file(suffix, short, tmp_path):
    out = tmp_path / f"a{suffix}"
    out.write_bytes(b"old")

    def broken(text, fraction):
        if fraction > 0.2:
            raise RuntimeError("half way")

    with pytest.raises(RuntimeError, match="half way"):
        animate(short).save(out, progress=broken)
    assert out.read_bytes() == b"old"
    assert os.listdir(tmp_path) == [out.name]


@pytest.mark.parametrize("fps", [0, -1, 51, "fast", float("nan"), None])
def test_bad_fps(fps, short):
    with pytest.raises(InputError, match="fps: .* given; allowed: a number above 0 and up to 50"):
        animate(short, fps=fps)


def test_bad_file_names(short, tmp_path):
    with pytest.raises(InputError, match=r"out: .* ends in .gif, .mp4\. Fix: for example a.gif"):
        animate(short).save(tmp_path / "a.png")
