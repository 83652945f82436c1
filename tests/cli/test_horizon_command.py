"""`ropeode horizon`, as a user meets it."""

from __future__ import annotations

import json
import os
import sys

import pytest
from PIL import Image

from tests.cli.interrupted import interrupt
from tests.schemas import assert_conforms

# Of the lengths that tests/study/test_horizon.py has, whose programs are then there.
QUICK = ["--problem", "oscillator", "--frames", "4", "--spans", "4,100"]


def test_json_and_picture(run, tmp_path):
    pytest.importorskip("heyoka", reason="heyoka is an extra")
    done = run("horizon", *QUICK, "--plots", "new", "--format", "json", "--out", "a.json")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "wrote 1 picture to new\n")
    text = (tmp_path / "a.json").read_text()
    assert_conforms(text)
    found = json.loads(text)
    assert found["schema"] == "ropeode.horizon/2"
    assert [need["measured"] for need in found["needs"]] == [True, False]
    with Image.open(tmp_path / "new" / "horizon.png") as image:
        assert image.width == 1300


@pytest.mark.slow
def test_text(run):
    pytest.importorskip("heyoka", reason="heyoka is an extra")
    done = run("horizon", *QUICK)
    assert (done.returncode, done.stderr) == (0, "")
    assert "Only rounding is lost" in done.stdout
    assert all(len(line) <= 80 for line in done.stdout.splitlines())


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--spans", "0"], "spans: '0' given; allowed: a finite number > 0"),
        (["--spans", ""], "spans: [] given; allowed: one or more"),
        (["--frames", "0"], "frames: '0' given"),
        (["--digits", "0"], "digits: '0' given"),
        (["--steppers", "rk4"], "No such option"),
        (["--plots", "missing/new"], "plots: 'missing/new' given"),
        (["--out", "missing/a.txt"], "create 'missing'"),
        (["--problem", "pendulums"], "pendulums"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_bad_input_is_a_line_and_exit_code_2(arguments, words, run, tmp_path):
    done = run("horizon", *arguments)
    assert done.returncode == 2
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert line.startswith("ropeode: ")
    assert words in line
    assert "Fix: " in line
    assert os.listdir(tmp_path) == []


def test_without_heyoka_it_is_told_before_anything_is_computed(run, monkeypatch):
    monkeypatch.setitem(sys.modules, "heyoka", None)
    done = run("horizon", "--frames", "1000000")
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.startswith("ropeode: heyoka: it cannot be imported")


@pytest.mark.slow
def test_ctrl_c(environment, tmp_path):
    arguments = ["horizon", "--num-nodes", "128", "--frames", "400"]
    assert interrupt(arguments, 2.0, tmp_path, environment) == (
        130,
        "",
        "ropeode: interrupted; nothing was written.\n",
    )
