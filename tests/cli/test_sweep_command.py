"""`ropeode sweep`, `ropeode plot DIR` and `ropeode spec sweep`."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner
from PIL import Image

from ropeode.cli import cli
from ropeode.errors import InputError
from ropeode.sweep import commented_sweep
from tests.conftest import commands_may_run

PAGE = (Path(__file__).parents[2] / "docs/howto/sweep.md").read_text()
# The first lines of the page: write a spec, run it, show what is done, draw a map.
LINES = [line.partition("#")[0] for line in PAGE.splitlines() if line.startswith("ropeode ")]
SPEC_LINE, SWEEP_LINE, _, PLOT_LINE = LINES[:4]
# A smaller design, on shorter times.
SHORTER = {
    "steps_per_frame = [16, 32, 64]": "steps_per_frame = [16, 32]",
    "order_factors = [1, 2, 4, 8]": "order_factors = [1, 2, 4]",
    "num_nodes = [8, 16]": "num_nodes = [4]",
    "frames = [20]": "frames = [3]",
}


@pytest.fixture(scope="module")
def swept(tmp_path_factory, cache):
    """A folder in which the lines of the page have run, in this process and with a small spec."""
    folder = tmp_path_factory.mktemp("swept")
    with commands_may_run(cache, folder):
        assert call(*SPEC_LINE.split()[1:]).output == ""
        text = (folder / "sweep.toml").read_text()
        for line, shorter in SHORTER.items():
            assert line in text
            text = text.replace(line, shorter)
        (folder / "sweep.toml").write_text(text)
        done = call(*SWEEP_LINE.replace("--workers 2", "").split()[1:])
        assert done.exit_code == 0, done.output
        (folder / "output.txt").write_text(done.output)
        drawn = call(*PLOT_LINE.replace("num_nodes=8", "num_nodes=4").split()[1:])
        assert (drawn.exit_code, drawn.output) == (0, "wrote sweep.png\n")
    return folder


def call(*arguments):
    return CliRunner().invoke(cli, arguments)


def test_a_sweep_whose_workers_died_has_not_succeeded(swept, run, tmp_path):
    """Without other processes they are not tried again."""
    shutil.copy(swept / "sweep.toml", tmp_path)
    shutil.copytree(swept / "out", tmp_path / "out")
    [path] = tmp_path.glob("out/rows-*/*.parquet")
    rows = pq.read_table(path)
    died = pa.array(["worker-died"] * 2 + ["ok"] * (len(rows) - 2))
    pq.write_table(rows.set_column(rows.column_names.index("status"), "status", died), path)
    done = run("sweep", "sweep.toml", "-o", "out")
    assert done.returncode == 1
    assert "worker-died" in done.stdout
    assert "2 cases" in done.stderr


def test_the_output_and_the_picture(swept, monkeypatch):
    monkeypatch.chdir(swept)
    output = (swept / "output.txt").read_text()
    assert "8 of 8 cases" in " ".join(output.split())
    assert re.search(r"^ok +8  the run stayed finite", output, re.MULTILINE)
    words = r"^rk4\n    runs: 4 ok\n    max error: .*\n    order: 4 converges"
    assert re.search(words, output, re.MULTILINE)
    assert all(len(line) <= 80 for line in output.splitlines())
    assert call("sweep", "show", "out").output == output
    assert call("spec", "sweep").output == commented_sweep()
    with Image.open("sweep.png") as image:
        assert image.width == 1300
    picture = ("--value", "error_max", "--where", "stepper=rk4", "--out", "map.png")
    done = call("plot", "out", "--x", "num_nodes", *picture, "--where", "damping=0.10")
    assert (done.exit_code, done.output) == (0, "wrote map.png\n")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("plot out --where rk4", "where: 'rk4' given; allowed: INPUT="),
        ("plot out --where stepper=rk", "where stepper: 'rk' .*: rk4, semi-implicit-e"),
        ("plot out --where num_nodes=7", "where num_nodes: '7' given; allowed: 4. Fix"),
        ("plot out --where seed=0", "where seed: '0' given; allowed: nothing, since"),
        ("plot out --x frames", "where: rows differ in damping"),
        ("plot out --steps 8", "steps_per_frame: '8' given; allowed: only with a spec"),
        ("sweep show sweep.toml", "folder: 'sweep.toml' given; allowed: a folder. F"),
    ],
)
def test_what_cannot_be_shown(arguments, words, swept, monkeypatch):
    monkeypatch.chdir(swept)
    error = call(*arguments.split()).exception
    assert isinstance(error, InputError)
    [line] = error.problems
    assert re.search(words, line), line
    assert "Fix: " in line
