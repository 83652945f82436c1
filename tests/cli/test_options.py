"""Options of commands: their names, who uses them, and how their text is split."""

from __future__ import annotations

import ast
import inspect
import textwrap
from pathlib import Path
from types import SimpleNamespace

import pytest

from ropeode.cli.job import job_from
from ropeode.cli.main import cli
from ropeode.cli.options import ROPE, TABLE
from ropeode.study import TableJob, TableSpec
from tests.cli.conftest import commands

COMMANDS = {" ".join(path): each for path, each in commands(cli).items()}
TAKE_SETTINGS = [
    name
    for name, each in COMMANDS.items()
    if {"frames", "accuracy"} <= {p.name for p in each.params}
]
# What a command cannot do without, beside its settings.
NEEDED = {
    "explain": ["rk4"],
    "reference compute": ["-o", "rope.nc"],
    "grade": ["a.csv", "--problem", "rope"],
}
OF_PROBLEM = {"problem", "kind", "frames", "reference", *(f"rope_{field}" for field in ROPE)}


@pytest.mark.parametrize("name", TAKE_SETTINGS)
def test_a_command_uses_each_setting_that_it_takes(name, run, monkeypatch):
    """It is run with settings that keep a record of what is read, and with no problem to solve."""
    read = set()

    class Recorded(TableSpec):
        def __getattribute__(self, field):
            read.add(field)
            return super().__getattribute__(field)

    class Job:
        spec = Recorded(**TableSpec().model_dump())
        run = TableJob.run

        @property
        def given(self):
            read.update(OF_PROBLEM)
            return SimpleNamespace()

        problem = given

    module = inspect.getmodule(COMMANDS[name].callback)
    monkeypatch.setattr(module, "job_from", lambda *_: Job())
    read.clear()
    assert run(*name.split(), *NEEDED.get(name, [])).returncode != 0
    takes = {param.name for param in COMMANDS[name].params}
    assert takes & {*TABLE, *OF_PROBLEM} <= read


@pytest.mark.parametrize("name", [name for name, each in COMMANDS.items() if each.callback])
def test_a_command_reads_each_of_its_own_options(name):
    function = inspect.unwrap(COMMANDS[name].callback)
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    read = {each.id for each in ast.walk(tree) if isinstance(each, ast.Name)}
    assert {*inspect.signature(function).parameters} - {"debug"} <= read


def test_one_thing_has_one_name_in_all_commands():
    options = [
        p for each in COMMANDS.values() for p in each.params if p.param_type_name == "option"
    ]
    names = {}
    for option in options:
        assert names.setdefault(option.name, option.opts) == option.opts
        assert option.help
        assert "plot" not in option.name or option.opts == ["--plots"]
    assert names["out"] == ["-o", "--out"]
    assert len({opt for opts in names.values() for opt in opts}) == sum(map(len, names.values()))


def test_a_spec_may_stand_where_a_problem_does(tmp_path, monkeypatch):
    (tmp_path / "mine.toml").write_text("frames = 3\n[rope]\nnum_nodes = 4\n")
    monkeypatch.chdir(tmp_path)
    job = job_from(None, {"problem": "mine.toml", "frames": "2"})
    assert (job.problem.frames, job.problem.parameters["num_nodes"]) == (2, 4)


@pytest.mark.parametrize(
    ("text", "steppers"),
    [
        ("rk4,velocity-verlet", ["rk4", "velocity-verlet"]),
        (
            "stormer-verlet:start=rest,damping=lagged,rk4",
            ["stormer-verlet:start=rest,damping=lagged", "rk4"],
        ),
        (
            "constraint-verlet:sweeps=2,stormer-verlet:start=rest",
            ["constraint-verlet:sweeps=2", "stormer-verlet:start=rest"],
        ),
        ("rk4,steps.py:verlet,diffrax:Heun", ["rk4", "steps.py:verlet", "diffrax:Heun"]),
    ],
)
def test_steppers_are_apart_and_their_options_together(text, steppers):
    assert TABLE["steppers"].read(text) == steppers


def test_one_velocity_for_all_or_one_for_each_node():
    read = ROPE["initial_velocity"].read
    assert read("1,2") == ["1", "2"]
    assert read("1,2;3,4") == [["1", "2"], ["3", "4"]]


def test_a_reference_is_looked_for_where_it_was_typed(tmp_path, monkeypatch):
    """And not beside the spec, which may have a file of the same name."""
    (tmp_path / "specs").mkdir()
    for file in ("specs/spec.toml", "specs/rope.nc", "rope.nc"):
        (tmp_path / file).touch()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("ropeode.study.spec.TableJob", lambda values, folder: values)
    values = job_from(Path("specs/spec.toml"), {"reference": "rope.nc"})
    assert values == {"reference": str(tmp_path / "rope.nc")}
    assert job_from(None, {"reference": "kepler"}) == {"reference": "kepler"}


@pytest.mark.parametrize(("option", "predicted"), [("--predict", True), ("--no-predict", False)])
def test_errors_are_predicted_where_somebody_asks(run, option, predicted):
    words = ["table", "--steppers", "explicit-euler", "--num-nodes", "3", "--frames", "2"]
    assert ("predicted" in run(*words, "--steps", "16,32", option).stdout) is predicted
