"""`ropeode sweep`, `ropeode plot DIR` and `ropeode spec sweep`."""

from __future__ import annotations

import re
import sys

import pytest
from click.testing import CliRunner
from PIL import Image

from ropeode.cli import sweep as command
from ropeode.cli.main import cli
from ropeode.errors import InputError
from ropeode.sweep.design.spec import COMMENTED_SWEEP, read_sweep

SPEC = """
problem = "oscillator"
steppers = ["semi-implicit-euler", "rk4"]
steps_per_frame = [4, 8, 16]
order_factors = [1, 2, 4]
[grid]
frames = [2, 3]
"""


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """A folder with a spec and the sweep that it describes."""
    folder = tmp_path_factory.mktemp("swept")
    (folder / "spec.toml").write_text(SPEC)
    with pytest.MonkeyPatch.context() as patch:
        # It is for a process that is all its own.
        patch.setattr(command, "set_up_jax", lambda: None)
        patch.setattr(command, "end_on_ctrl_c", lambda left: None)
        done = call("sweep", str(folder / "spec.toml"), "-o", str(folder / "out"))
    assert done.exit_code == 0, done.output
    (folder / "said.txt").write_text(done.output)
    return folder


def call(*arguments):
    return CliRunner().invoke(cli, arguments)


def test_what_is_printed(swept):
    said = (swept / "said.txt").read_text()
    assert "12 of 12 cases" in " ".join(said.split())
    assert re.search(r"^ok +12  the run stayed finite", said, re.MULTILINE)
    assert re.search(r"^rk4\n    12 ok|^rk4\n    6 ok", said, re.MULTILINE)
    assert all(len(line) <= 80 for line in said.splitlines())
    assert call("sweep", "show", str(swept / "out")).output == said


def test_plot_of_a_folder(swept, monkeypatch):
    monkeypatch.chdir(swept)
    done = call("plot", "out", "--x", "frames", "--value", "error_max", "--out", "map.png")
    assert (done.exit_code, done.output) == (0, "wrote map.png\n")
    with Image.open("map.png") as image:
        assert image.width == 1300


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["plot", "out", "--x", "frame"], "x: 'frame' given, which does not exist"),
        (["plot", "out", "--x", "frames", "--value", "status"], "value: 'status' given"),
        (["plot", "out", "--x", "frames", "--y", "frames"], "y: 'frames' given; allowed: another"),
        (["plot", "out", "--x", "frames", "--where", "rk4"], "where: 'rk4' given; allowed: INPUT="),
        (["plot", "out", "--x", "frames", "--where", "stepper=rk"], "where stepper: 'rk' given"),
        (["plot", "out", "--x", "stepper"], "where: .*differ in frames.*where frames=2"),
        (["plot", "out", "--steps", "8"], "steps_per_frame: '8' given; allowed: none with the f"),
        (["plot", "--x", "frames"], "x: 'frames' given; allowed: it with the folder of a sweep"),
        (["sweep", "show", "spec.toml"], "folder: 'spec.toml' given; allowed: a folder. F"),
    ],
)
def test_what_cannot_be_shown(arguments, words, swept, monkeypatch):
    monkeypatch.chdir(swept)
    error = call(*arguments).exception
    assert isinstance(error, InputError)
    [line] = error.problems
    assert re.search(words, line), line
    assert "Fix: " in line


@pytest.mark.parametrize("package", ["pyarrow", "filelock", "pandas"])
def test_a_missing_extra_is_one_line(package, swept, monkeypatch):
    monkeypatch.setitem(sys.modules, package, None)
    from ropeode.sweep.run import run_sweep

    with pytest.raises(InputError, match=rf"^{package}: .*pip install '\.\[data\]'$"):
        run_sweep(swept / "spec.toml", swept / "other")


def test_without_dask(swept, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    from ropeode.sweep.run import run_sweep

    with pytest.raises(InputError, match=r"^distributed: .*pip install '\.\[dask\]'$"):
        run_sweep(swept / "spec.toml", swept / "other", scheduler="tcp://localhost:8786")
    assert not (swept / "other").exists()


def test_the_commented_spec_is_a_spec(tmp_path):
    assert call("spec", "sweep").output == COMMENTED_SWEEP
    path = tmp_path / "sweep.toml"
    assert call("spec", "sweep", "--out", str(path)).output == ""
    assert read_sweep(path).count > 0
