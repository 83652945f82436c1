"""`ropeode explain`, as a user meets it."""

from __future__ import annotations

import json
import os

import pytest

QUICK = ["--num-nodes", "4", "--frames", "3", "--steps", "64,128,256"]


def test_a_file_and_pictures(run, tmp_path):
    done = run(
        *("explain", "explicit-euler", *QUICK),
        *("--method", "rk4", "--out", "a.json", "--plots", "new"),
    )
    assert (done.returncode, done.stdout) == (0, "")
    assert done.stderr == "wrote 5 pictures to new\n"
    assert sorted(os.listdir(tmp_path / "new")) == [
        *(
            f"{kind}-{quantity}.png"
            for kind in ("convergence", "error")
            for quantity in ("position", "velocity")
        ),
        "stability.png",
    ]
    found = json.loads((tmp_path / "a.json").read_text())
    assert found["compared_with"]["name"] == "rk4"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["euler"], "stepper: 'euler' given, which does not exist"),
        (["rk4", "--method", "rk5"], "stepper: 'rk5' given, which does not exist"),
        (["rk4", "--num-nodes", "0"], "num_nodes: '0' given"),
        (["rk4", "--steppers", "rk4"], "No such option"),
        (["velocity-verlet", "--problem", "lorenz"], "needs a second-order problem"),
        (["rk4", "--out", "missing/a.txt"], "create 'missing'"),
        (["rk4", "--plots", "missing/new"], "plots: 'missing/new' given"),
        ([], "Missing argument"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_bad_input_is_a_line_and_exit_code_2(arguments, words, run, tmp_path):
    done = run("explain", *arguments)
    assert (done.returncode, done.stdout) == (2, "")
    (line,) = done.stderr.splitlines()
    assert line.startswith("ropeode: ")
    assert words in line
    assert os.listdir(tmp_path) == []
