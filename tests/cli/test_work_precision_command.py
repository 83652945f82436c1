"""`ropeode work-precision`, as a user meets it."""

from __future__ import annotations

import json

import pytest
from PIL import Image

from tests.schemas import assert_conforms

QUICK = ["--problem", "oscillator", "--frames", "4", "--rounds", "1"]


def test_json_and_pictures(run, tmp_path):
    (tmp_path / "mine.py").write_text(
        "import numpy as np\n\n\ndef solve(problem, rtol):\n"
        "    exact = problem.exact(problem.ts)\n"
        "    return exact + rtol * (problem.ts > 0)[:, None, None, None], 7\n"
    )
    methods = "rk4,scipy:RK23,mine.py:solve"
    ladders = ["--steps", "7,30", "--rtol", "1e-4,1e-7"]
    out = ["--plots", "new", "--format", "json", "--out", "a.json"]
    done = run("work-precision", *QUICK, "--methods", methods, *ladders, *out)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "wrote 3 pictures to new\n")
    text = (tmp_path / "a.json").read_text()
    assert_conforms(text)
    rows = json.loads(text)["rows"]
    found = [(row["method"], row["effort"]) for row in rows]
    assert found == [
        ("rk4", 7),
        ("rk4", 30),
        ("scipy:RK23", 1e-4),
        ("scipy:RK23", 1e-7),
        ("mine.py:solve", 1e-4),
        ("mine.py:solve", 1e-7),
    ]
    assert rows[0]["rhs_evaluations"] == 4 * 4 * 7
    assert rows[-1]["error_max"] == pytest.approx(1e-7, rel=1e-3)
    for cost in ("seconds", "rhs-evaluations", "steps"):
        with Image.open(tmp_path / "new" / f"work-precision-{cost}.png") as image:
            assert image.width == 1300


def test_text(run):
    done = run("work-precision", *QUICK, "--methods", "rk4,velocity-verlet", "--steps", "7,30,200")
    assert (done.returncode, done.stderr) == (0, "")
    assert "Least milliseconds known to reach a max error" in done.stdout
    assert all(len(line) <= 80 for line in done.stdout.splitlines())


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--methods", "rk5"], "did you mean 'rk4'?"),
        (["--methods", "scipy:RK45", "--steps", "4"], "none where all methods are adaptive"),
        (["--methods", "rk4", "--rtol", "1e-3"], "none where all methods have constant steps"),
        (["--steps", "4,none"], "steps_per_frame: ['4', 'none'] given"),
        (["--rtol", "2"], "rtol: ['2'] given"),
        (["--run-limit", "-1"], "run_limit: '-1' given"),
        (["--rounds", "0"], "rounds: '0' given"),
        (["--steppers", "rk4"], "No such option"),
        (["--problem", "lorenz", "--methods", "rattle"], "nodes in a row"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_bad_input_is_a_line_and_exit_code_2(arguments, words, run):
    done = run("work-precision", *arguments)
    assert done.returncode == 2
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert line.startswith("ropeode: ")
    assert words in line
