"""`ropeode plot` and `ropeode animate`, as a user meets them."""

from __future__ import annotations

import os
import sys

import numpy as np
import pytest
from PIL import Image

from ropeode.cli import cli
from ropeode.simulation import simulate
from tests.sampled import sampled

# The rope of `small_rope`: what it compiles serves many tests.
SMALL = ["--num-nodes", "4", "--frames", "3"]
QUICK = [*SMALL, "--steppers", "rk4", "--steps", "4,8,16"]


TYPES = next(each.type.choices for each in cli.commands["plot"].params if each.name == "name")


@pytest.mark.parametrize("name", sampled(TYPES, ["convergence"]))
def test_plot(name, run, tmp_path):
    """A norm of errors does not keep energies from being plotted."""
    done = run("plot", *QUICK, "--type", name, "--norm", "velocity-max")
    assert (done.returncode, done.stdout, done.stderr) == (0, f"wrote {name}.png\n", "")
    with Image.open(tmp_path / f"{name}.png") as image:
        assert image.width == 1300
    assert os.listdir(tmp_path) == [f"{name}.png"]


def test_plot_of_a_spec_file_in_another_format(run, tmp_path):
    (tmp_path / "mine.toml").write_text(
        'frames = 3\nsteppers = ["rk4"]\nsteps_per_frame = [4, 8, 16]\n[rope]\nnum_nodes = 4\n'
    )
    done = run("plot", "mine.toml", "--damping", "0.25", "--out", "a.svg")
    assert (done.returncode, done.stdout, done.stderr) == (0, "wrote a.svg\n", "")
    assert (tmp_path / "a.svg").read_text().startswith("<?xml")


def test_animate(run, tmp_path, monkeypatch):
    """One run of all that is given: the first of the steps, which 4 samples per frame fit.

    A GIF needs no extra for films.
    """
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    done = run("animate", *QUICK)
    assert (done.returncode, done.stdout, done.stderr) == (0, "wrote rope.gif\n", "")
    with Image.open(tmp_path / "rope.gif") as image:
        assert image.n_frames == 3 * 4 + 1
        assert image.info["duration"] == 50
    assert os.listdir(tmp_path) == ["rope.gif"]


@pytest.mark.slow
def test_animate_by_default(run, tmp_path):
    """At 64 steps per frame, which 8 samples fit; to MP4 just as well."""
    import imageio_ffmpeg

    done = run("animate", *SMALL, "--frames", "1", "--fps", "5", "--out", "a.mp4")
    assert (done.returncode, done.stdout, done.stderr) == (0, "wrote a.mp4\n", "")
    frames, seconds = imageio_ffmpeg.count_frames_and_secs(tmp_path / "a.mp4")
    assert frames == 8 + 1
    assert seconds == pytest.approx(1.8, abs=0.05)


def test_pictures_of_trajectories(small_rope, run, tmp_path):
    """Files of three step sizes and the spec of their problem."""
    (tmp_path / "spec.toml").write_text("frames = 3\n[rope]\nnum_nodes = 4\n")
    files = []
    for steps in (16, 32, 64):
        found = simulate(small_rope, "velocity-verlet", steps)
        files.append(f"{steps}.npz")
        states = {"positions": found.positions, "velocities": found.velocities}
        np.savez(tmp_path / files[-1], t=found.times, **states)
    dts = ["--dt", "0.0625,0.03125,0.015625"]
    done = run("plot", "--trajectories", *files, "--problem", "spec.toml", *dts, "--out", "a.svg")
    assert (done.returncode, done.stdout, done.stderr) == (0, "wrote a.svg\n", "")
    assert "order 2.0" in (tmp_path / "a.svg").read_text()
    rope = ["--problem", "rope", *SMALL, "--dt", "0.015625"]
    done = run("animate", files[-1], *rope, "--trajectories")
    assert (done.returncode, done.stdout, done.stderr) == (0, "wrote rope.gif\n", "")
    with Image.open(tmp_path / "rope.gif") as image:
        assert image.n_frames == 4
