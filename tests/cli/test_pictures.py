"""`ropeode plot` and `ropeode animate`, as a user meets them."""

from __future__ import annotations

import os
import sys

import numpy as np
import pytest
from PIL import Image

from ropeode.cli import cli
from ropeode.simulation import simulate
from tests.cli.interrupted import interrupt

# The rope of `small_rope`: what it compiles serves many tests.
SMALL = ["--num-nodes", "4", "--frames", "3"]
QUICK = [*SMALL, "--steppers", "rk4", "--steps", "4,8,16"]


TYPES = next(each.type.choices for each in cli.commands["plot"].params if each.name == "name")


@pytest.mark.parametrize("name", TYPES)
def test_plot(name, run, tmp_path):
    done = run("plot", *QUICK, "--type", name)
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


def test_a_norm_in_a_spec_does_not_keep_energies_from_being_plotted(run):
    assert run("plot", *QUICK, "--type", "energy", "--norm", "velocity-max").returncode == 0


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


def test_animate_by_default(run, tmp_path):
    """At 64 steps per frame, which 8 samples fit; to MP4 just as well."""
    import imageio_ffmpeg

    done = run("animate", *SMALL, "--fps", "10", "--out", "a.mp4")
    assert (done.returncode, done.stdout, done.stderr) == (0, "wrote a.mp4\n", "")
    frames, seconds = imageio_ffmpeg.count_frames_and_secs(tmp_path / "a.mp4")
    assert frames == 3 * 8 + 1
    assert seconds == pytest.approx(2.5, abs=0.05)


@pytest.fixture(scope="module")
def trajectories(tmp_path_factory, small_rope):
    """Files of three step sizes and the spec of their problem."""
    folder = tmp_path_factory.mktemp("trajectories")
    (folder / "spec.toml").write_text("frames = 3\n[rope]\nnum_nodes = 4\n")
    for steps in (16, 32, 64):
        run = simulate(small_rope, "velocity-verlet", steps)
        np.savez(
            folder / f"{steps}.npz",
            t=run.times,
            positions=run.positions,
            velocities=run.velocities,
        )
    return folder


def test_plot_of_trajectories(trajectories, run, tmp_path):
    files = [str(trajectories / f"{steps}.npz") for steps in (16, 32, 64)]
    spec = str(trajectories / "spec.toml")
    dts = ["--dt", "0.0625,0.03125,0.015625"]
    done = run("plot", "--trajectories", *files, "--problem", spec, *dts, "--out", "a.svg")
    assert (done.returncode, done.stdout, done.stderr) == (0, "wrote a.svg\n", "")
    assert "order 2.0" in (tmp_path / "a.svg").read_text()


def test_film_of_trajectories(trajectories, run, tmp_path):
    files = [str(trajectories / "64.npz")]
    rope = ["--problem", "rope", *SMALL, "--dt", "0.015625"]
    done = run("animate", *files, *rope, "--trajectories")
    assert (done.returncode, done.stdout, done.stderr) == (0, "wrote rope.gif\n", "")
    with Image.open(tmp_path / "rope.gif") as image:
        assert image.n_frames == 4


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["plot", "--trajectories"], "files: 'none' given"),
        (["plot", "--trajectories", "a.csv"], "problem: 'none' given"),
        (["plot", "--trajectories", "a.csv", "--problem", "rope"], "file: 'a.csv' given"),
        (["plot", "--trajectories", "a.csv", "--steps", "4"], "steps: '4' given; allowed: only"),
        (["animate", "a.csv", "b.csv"], "to draw trajectories, add --trajectories"),
        (["animate", "--dt", "0.1"], "dt: '0.1' given; allowed: only with --trajectories"),
        (["plot", "--type", "errors"], "'errors' is not one of"),
        (["plot", "--out", "a.jpg"], "out: 'a.jpg' given; allowed: a file name that ends in .png"),
        (["plot", "--out", "missing/a.png"], "create 'missing'"),
        (["plot", "--steps", "0"], "steps_per_frame: "),
        (["plot", "--steppers", "rk44"], "did you mean 'rk4'"),
        (["plot", "--norm", "max"], "norm: 'max' given"),
        (["plot", "missing.toml"], "spec: 'missing.toml' given"),
        (["plot", "--problem", "forced", "--type", "energy"], "a problem that has an energy"),
        (["animate", "--out", "a.png"], "out: 'a.png' given; allowed: a file name that ends in .g"),
        (["animate", "--fps", "0"], "fps: '0' given"),
        (["animate", "--fps", "quick"], "fps: 'quick' given"),
        (["animate", "--problem", "oscillator"], "positions have 2 or 3 components"),
        (["animate", "--frames", "0"], "frames: '0' given"),
        (["table", "--caption", "a"], "caption: 'a' given; allowed: only with the format latex"),
        (["table", "--format", "latex", "--columns", "a"], "column: 'a' given"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_bad_input_is_a_line_and_exit_code_2(arguments, words, run, tmp_path):
    done = run(*arguments)
    assert done.returncode == 2
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert line.startswith("ropeode: ")
    assert words in line
    assert "Fix: " in line
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize(
    ("arguments", "package", "extra"),
    [
        (["plot"], "matplotlib", "plots"),
        pytest.param(["animate"], "matplotlib", "plots", marks=pytest.mark.slow),
    ],
    ids=str,
)
def test_missing_packages_are_a_line(arguments, package, extra, run_process, tmp_path):
    """Told before anything is computed: the default rope takes longer than this may."""
    done = run_process(*arguments, without=package)
    assert done.returncode == 2
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"ropeode: {package}: it cannot be imported")
    assert line.endswith(f"pip install '.[{extra}]'")
    assert os.listdir(tmp_path) == []


def test_films_in_mp4_need_a_package(run, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    done = run("animate", "--out", "a.mp4", "--frames", "1000000")
    assert (done.returncode, done.stdout) == (2, "")
    (line,) = done.stderr.splitlines()
    assert line.startswith("ropeode: imageio_ffmpeg: it cannot be imported")
    assert line.endswith("pip install '.[video]'")
    assert os.listdir(tmp_path) == []


@pytest.mark.slow
@pytest.mark.parametrize("command", [["plot"], ["animate", "--out", "a.gif"]], ids=str)
def test_ctrl_c_leaves_nothing(command, environment, tmp_path):
    arguments = [*command, "--num-nodes", "256", "--frames", "100"]
    assert interrupt(arguments, 2.0, tmp_path, environment) == (
        130,
        "",
        "ropeode: interrupted; nothing was written.\n",
    )
    assert os.listdir(tmp_path) == []
