"""`ropeode explain`, `horizon` and `work-precision`, and steppers of users in a table."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest
from PIL import Image

from ropeode import steppers
from ropeode.cli import cli
from tests.schemas import assert_conforms

STEPS = Path(__file__).parents[2] / "docs/examples/steps.py"
# Of the lengths that tests/study/test_horizon.py has, whose programs are then there.
SPANS = ["--problem", "oscillator", "--frames", "4", "--spans", "4,100"]


def test_explain_writes_a_file_and_pictures(run, tmp_path):
    done = run(
        *("explain", "explicit-euler", "--problem", "oscillator", "--frames", "4"),
        *("--steps", "64,128,256", "--norm", "position-max", "--method", "rk4"),
        *("--out", "a.json", "--plots", "new"),
    )
    assert (done.returncode, done.stdout) == (0, "")
    assert done.stderr == "wrote 3 pictures to new\n"
    pictures = ["convergence-position.png", "error-position.png", "stability.png"]
    assert sorted(os.listdir(tmp_path / "new")) == pictures
    found = json.loads((tmp_path / "a.json").read_text())
    assert found["compared_with"]["name"] == "rk4"


def test_horizon_in_json(run):
    pytest.importorskip("heyoka", reason="heyoka is an extra")
    done = run("horizon", *SPANS, "--format", "json")
    assert (done.returncode, done.stderr) == (0, "")
    assert_conforms(done.stdout)
    found = json.loads(done.stdout)
    assert found["schema"] == "ropeode.horizon/2"
    assert [need["measured"] for need in found["needs"]] == [True, False]


def test_work_precision_of_all_kinds_of_methods(run, tmp_path):
    (tmp_path / "mine.py").write_text(
        "import numpy as np\n\n\ndef solve(problem, rtol):\n"
        "    exact = problem.exact(problem.ts)\n"
        "    return exact + rtol * (problem.ts > 0)[:, None, None, None], 7\n"
    )
    ladders = {"rk4": (7, 30), "scipy:RK23": (1e-4, 1e-7), "mine.py:solve": (1e-4, 1e-7)}
    done = run(
        *("work-precision", "--problem", "oscillator", "--frames", "4", "--rounds", "1"),
        *("--methods", ",".join(ladders), "--steps", "7,30", "--rtol", "1e-4,1e-7"),
        *("--plots", "new", "--format", "json", "--out", "a.json"),
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "wrote 3 pictures to new\n")
    text = (tmp_path / "a.json").read_text()
    assert_conforms(text)
    rows = json.loads(text)["rows"]
    found = [(row["method"], row["effort"]) for row in rows]
    assert found == [(name, effort) for name, ladder in ladders.items() for effort in ladder]
    assert rows[0]["rhs_evaluations"] == 4 * 4 * 7
    assert rows[-1]["error_max"] == pytest.approx(1e-7, rel=1e-3)
    for cost in ("seconds", "rhs-evaluations", "steps"):
        with Image.open(tmp_path / "new" / f"work-precision-{cost}.png") as image:
            assert image.width == 1300


def test_names_of_files_start_from_the_folder_of_the_spec(run, tmp_path):
    spec = 'frames = 3\nsteppers = ["steps.py"]\nsteps_per_frame = [8]\n[rope]\nnum_nodes = 4\n'
    (tmp_path / "specs").mkdir()
    (tmp_path / "specs/steps.py").write_text(STEPS.read_text())
    (tmp_path / "specs/spec.toml").write_text(spec)
    done = run("table", "specs/spec.toml")
    assert done.returncode == 0, done.stderr
    assert "steps.py:velocity_verlet" in done.stdout


def test_templates(run):
    (option,) = (each for each in cli.commands["check"].params if each.name == "template")
    assert set(option.type.choices) == set(steppers.TEMPLATES)
    for name in steppers.TEMPLATES:
        done = run("check", "--template", name)
        assert (done.returncode, done.stdout) == (0, steppers.template(name))
