"""Options of commands: their names, who uses them, and how their text is split."""

from __future__ import annotations

import ast
import inspect
import textwrap
from pathlib import Path
from types import SimpleNamespace

import pytest

from ropeode.cli import cli
from ropeode.study import TableJob, TableSpec
from tests.cli.conftest import commands

STEPS = "def verlet(acceleration, t, x, v, dt, args):\n    return x, v\n"
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
OF_PROBLEM = {"problem", "kind", "frames", "reference"}


@pytest.mark.parametrize("name", TAKE_SETTINGS)
def test_a_command_uses_each_setting_that_it_takes(name, run, monkeypatch):
    """Its job keeps a record of what is read, and has no problem to solve."""
    read = set()

    class Recorded(TableSpec):
        def __getattribute__(self, field):
            read.add(field)
            return super().__getattribute__(field)

    def given(job):
        read.update(OF_PROBLEM)
        return SimpleNamespace()

    monkeypatch.setattr(TableJob, "__init__", lambda *_: None)
    spec = Recorded(**TableSpec().model_dump())
    monkeypatch.setattr(TableJob, "spec", spec, raising=False)
    monkeypatch.setattr(TableJob, "given", property(given), raising=False)
    monkeypatch.setattr(TableJob, "problem", property(given))
    read.clear()
    assert run(*name.split(), *NEEDED.get(name, [])).returncode != 0
    assert {param.name for param in COMMANDS[name].params} & {*TableSpec.model_fields} <= read


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


@pytest.mark.parametrize(
    "steppers",
    [
        ["stormer-verlet:start=rest,damping=lagged", "rk4"],
        ["constraint-verlet:sweeps=2", "stormer-verlet:start=rest"],
        ["rk4", "steps.py:verlet", "diffrax:Heun"],
    ],
)
def test_steppers_are_apart_and_their_options_together(table_job, steppers):
    Path("steps.py").write_text(STEPS)
    kind = ["--kind", "inextensible-rope"] if "constraint" in steppers[0] else []
    job = table_job("--frames", "1", "--steppers", ",".join(steppers), *kind)
    assert [each.label for each in job.spec.steppers] == steppers


@pytest.mark.slow
def test_errors_are_predicted_where_somebody_asks(run):
    words = ["table", "--steppers", "explicit-euler", "--num-nodes", "3", "--frames", "2"]
    said = [run(*words, "--steps", "16,32", each).stdout for each in ("--predict", "--no-predict")]
    assert ["predicted" in each for each in said] == [True, False]


def test_names_of_files_start_from_the_folder_of_the_spec(table_job, tmp_path):
    (tmp_path / "specs").mkdir()
    (tmp_path / "specs/steps.py").write_text(STEPS)
    (tmp_path / "specs/spec.toml").write_text('steppers = ["steps.py"]\n')
    job = table_job("specs/spec.toml")
    assert [each.label for each in job.spec.steppers] == ["steps.py:verlet"]


def test_a_reference_is_looked_for_where_it_was_typed(run, tmp_path):
    """And not beside the spec, which may have a file of the same name."""
    (tmp_path / "specs").mkdir()
    (tmp_path / "specs/spec.toml").touch()
    for file in ("specs/rope.nc", "rope.nc"):
        (tmp_path / file).write_text("no reference")
    done = run("table", "specs/spec.toml", "--reference", "rope.nc")
    assert done.stderr.startswith(f"ropeode: reference: '{tmp_path / 'rope.nc'}' given; ")
