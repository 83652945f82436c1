"""Steppers of users on the command line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from ropeode import steppers
from ropeode.cli import cli

STEPS = Path(__file__).parents[2] / "docs/examples/steps.py"


def test_four_kinds_in_a_table(run):
    done = run(
        "table",
        "--frames=3",
        "--num-nodes=4",
        "--damping=0.1",
        "--stiffness=10",
        f"--steppers={STEPS}:velocity_verlet,diffrax:Heun,scipy:RK23,rk4",
        "--steps=16,32,64,128",
        "--format=json",
    )
    assert done.returncode == 0, done.stderr
    orders = [each["observed"] for each in json.loads(done.stdout)["orders"]]
    assert orders == pytest.approx([2, 2, 3, 4], abs=0.1)


def test_names_of_files_start_from_the_folder_of_the_spec(run, tmp_path):
    (tmp_path / "steps.py").write_text(STEPS.read_text())
    spec = tmp_path / "spec.toml"
    spec.write_text(
        'frames = 3\nsteppers = ["steps.py"]\nsteps_per_frame = [8]\n[rope]\nnum_nodes = 4\n'
    )
    done = run("table", str(spec))
    assert done.returncode == 0, done.stderr
    assert "steps.py:velocity_verlet" in done.stdout


@pytest.mark.parametrize("name", steppers.TEMPLATES)
def test_templates(run, name):
    done = run("check", "--template", name)
    assert (done.returncode, done.stdout) == (0, steppers.template(name))


def test_templates_are_all_named():
    (option,) = (each for each in cli.commands["check"].params if each.name == "template")
    assert set(option.type.choices) == set(steppers.TEMPLATES)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["table", "--steppers=nowhere.py"], "No such file"),
        (["table", "--steppers=diffrax:Huen"], "did you mean 'Heun'"),
        (["table", "--steppers=rk5,scipy:BDF"], "did you mean 'rk4'"),
        (["check"], "Missing argument"),
        (["check", "--template=three-step"], "three-step"),
    ],
)
def test_wrong_input(run, arguments, words):
    done = run(*arguments)
    assert done.returncode == 2
    assert words in done.stderr
