"""What no command can use is a line and exit code 2, before anything is computed or written."""

from __future__ import annotations

import os
import re
import subprocess
import sys

import pytest

from ropeode.sweep import commented_sweep

BAD = [
    ("tabel", "No such command"),
    ("table missing.toml", "spec: 'missing.toml' given"),
    ("table --problem missing.py:p", "problem: 'missing.py' given"),
    ("table --problem keplr", "did you mean 'kepler'"),
    ("table --node-mass -1", "node_mass: '-1' given; allowed: "),
    ("table --stiffness nan --damping -1", "stiffness: ", "damping: "),
    ("table --initial-velocity 0,0;", "initial_velocity: "),
    ("table --steppers rk5,scipy:BDF", "did you mean 'rk4'", "'BDF' given"),
    ("table --out missing/t.txt", "out: 'missing/t.txt' given; .* create 'missing'"),
    ("table --caption a", "caption: 'a' given; allowed: only with the format latex"),
    ("table --reference rope-at-rest --damping 0.02", "damping: 0.02 given; allowed: .*, which is"),
    ("table --reference bad.nc", "the checksum at its end is missing"),
    ("check", "Missing argument"),
    ("steppers stormer-verlet:strat=rest", "did you mean 'start'"),
    ("explain rk4 --method rk5", "stepper: 'rk5' given, which does not exist"),
    ("horizon --spans=", r"spans: \[\] given; allowed: one or more"),
    ("work-precision --methods scipy:RK45 --steps 4", "none where all methods are adaptive"),
    ("work-precision --steps 4,none", r"steps_per_frame: \['4', 'none'\] given"),
    ("plot --trajectories a.csv", "problem: 'none' given"),
    ("plot --trajectories a.csv --steps 4", "steps: '4' given; allowed: only"),
    ("plot --problem forced --type energy", "a problem that has an energy"),
    ("plot --x frames", "x: 'frames' given; allowed: only with the folder"),
    ("animate a.csv b.csv", "to draw trajectories, add --trajectories"),
    ("animate --out a.png", "out: 'a.png' given; allowed: a file name that ends in .g"),
    ("animate --problem oscillator", "positions have 2 or 3 components"),
    ("report --figures 42 --plots new", "figures: '42' given; allowed: whole numbers from 1 to 41"),
    ("reference --frames 3", "Missing option"),
    ("reference -o x.csv", "allowed: a file name that ends in .nc"),
    ("reference show none.nc", "reference: 'none.nc' given; allowed: a file that can"),
    ("reference export kepler -o x.xls", "out: 'x.xls' given; allowed: a file"),
    ("lab steps.txt", "allowed: FILE.py or FILE.py:NAME"),
    ("lab rk4", "those of ropeode are in the lab in any case"),
    ("lab --port 99999", "port: 99999 given"),
]


@pytest.mark.parametrize("given", BAD, ids=lambda given: given[0])
def test_bad_input_is_a_line_and_exit_code_2(given, run, tmp_path):
    line, *words = given
    (tmp_path / "bad.nc").write_text("no such thing")
    done = run(*line.split())
    assert (done.returncode, done.stdout) == (2, "")
    for said, word in zip(done.stderr.splitlines(), words, strict=True):
        assert said.startswith("ropeode: ")
        assert re.search(word, said), said
        assert "Fix: " in said
    assert os.listdir(tmp_path) == ["bad.nc"]


@pytest.mark.parametrize(
    ("line", "package", "extra"),
    [
        ("animate --out a.mp4 --frames 1000000", "imageio_ffmpeg", "video"),
        ("horizon --frames 1000000", "heyoka", "extended"),
        ("lab --no-browser", "uvicorn", "lab"),
        ("sweep sweep.toml -o out", "pandas", "data"),
        ("sweep sweep.toml -o out --scheduler tcp://localhost:8786", "distributed", "dask"),
    ],
)
def test_a_missing_package_is_told_with_its_extra(line, package, extra, run, monkeypatch, tmp_path):
    """Before anything is computed, which takes longer than this may."""
    monkeypatch.setitem(sys.modules, package, None)
    (tmp_path / "sweep.toml").write_text(commented_sweep())
    done = run(*line.split())
    assert (done.returncode, done.stdout) == (2, "")
    (said,) = done.stderr.splitlines()
    assert said.startswith(f"ropeode: {package}: it cannot be imported")
    assert said.endswith(f"pip install '.[{extra}]'")
    assert os.listdir(tmp_path) == ["sweep.toml"]


@pytest.mark.parametrize("command", ["plot", pytest.param("animate", marks=pytest.mark.slow)])
def test_pictures_without_matplotlib(command, environment):
    code = "import sys; sys.modules['matplotlib'] = None; from ropeode.cli import run_command; "
    words = [sys.executable, "-c", f"{code} sys.exit(run_command([{command!r}]))"]
    done = subprocess.run(words, capture_output=True, text=True, env=environment)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("ropeode: matplotlib: it cannot be imported")
