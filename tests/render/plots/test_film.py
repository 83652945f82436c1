"""Films show each sample as it was computed, and are written whole or not at all."""

from __future__ import annotations

import base64
import itertools
import os

import numpy as np
import pytest
from PIL import Image

from ropeode import Rope, animate
from ropeode.errors import InputError
from ropeode.render import film
from tests.golden import check_golden
from tests.render.plots.drawn import described
from tests.render.plots.studies import paths


@pytest.mark.parametrize("sample", range(4))
def test_each_sample_is_shown_as_its_file_says(sample):
    """As computed, with errors magnified until they are seen, and from as far as all nodes are."""
    figure, show = film(paths())
    # Whatever was shown before.
    for each in (0, 3, sample):
        show(each)
    check_golden(f"film-{sample}.picture.txt", described(figure))
    figure.draw_without_rendering()
    boxes = [each.get_tightbbox() for each in figure.axes]
    for one, other in itertools.combinations(boxes, 2):
        assert not one.overlaps(other)
    assert max(box.x1 for box in boxes) <= figure.bbox.width


def drawn(axes):
    """The reference behind a run, the trace, the nodes, and the box of the first view."""
    return [line.get_xydata() for line in axes.lines if line.get_animated()]


def test_what_is_seen_of_a_rope_in_space_that_is_pinned():
    """The node whose trace is drawn moves."""
    rope = Rope(start=[0, 0, 0], end=[0, -3, 1], num_nodes=4, pinned=[0, 2, 3])
    found = paths(rope.problem(frames=3))
    figure, show = film(found)
    show(2)
    assert "x and y of 3 components" in " ".join(figure.get_suptitle().split())
    _, trace, nodes, *_ = drawn(figure.axes[0])
    assert np.array_equal(trace, found.reference.positions[:3, 1, :2])
    assert np.array_equal(nodes, found.reference.positions[2, :, :2])


def test_films_have_a_picture_for_each_sample(tmp_path):
    import imageio_ffmpeg

    said = []
    film = animate(paths(), fps=25)
    assert repr(film).endswith("4 pictures, 0.16 seconds>")
    path = film.save(tmp_path / "a.gif", progress=lambda *each: said.append(each))
    shown = film._repr_html_().partition("base64,")[2].rstrip('">')
    assert base64.b64decode(shown) == path.read_bytes()
    with Image.open(path) as image:
        assert image.n_frames == 4
        assert image.info["duration"] == 40
    assert [fraction for _, fraction in said] == pytest.approx(np.linspace(0, 1, 5))
    path = animate(paths(), fps=4).save(tmp_path / "a.mp4")
    frames, seconds = imageio_ffmpeg.count_frames_and_secs(path)
    assert (frames, seconds) == (4, pytest.approx(1.0, abs=0.05))
    assert sorted(os.listdir(tmp_path)) == ["a.gif", "a.mp4"]


def test_what_fails_half_way_leaves_the_old_file(tmp_path, room_for):
    """Of the two formats the one that another program writes."""
    out = tmp_path / "a.mp4"
    out.write_bytes(b"old")

    def broken(text, fraction):
        if fraction > 0.4:
            raise RuntimeError("half way")

    with pytest.raises(RuntimeError, match="half way"):
        animate(paths()).save(out, progress=broken)
    with room_for(1000), pytest.raises(InputError, match="out: .* given"):
        animate(paths()).save(out)
    assert out.read_bytes() == b"old"
    assert os.listdir(tmp_path) == [out.name]


def test_bad_input(tmp_path):
    for fps in (0, -1, 51, "fast", float("nan"), None):
        with pytest.raises(InputError, match="fps: .* allowed: a number above 0 and up to 50"):
            animate(paths(), fps=fps)
    with pytest.raises(InputError, match=r"out: .* ends in .gif, .mp4\. Fix: for example a.gif"):
        animate(paths()).save(tmp_path / "a.png")
