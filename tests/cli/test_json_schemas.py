"""The published JSON Schemas: made from the types in the package, and kept by every command."""

from __future__ import annotations

import functools
import json
import operator

import pytest
from jsonschema import ValidationError

from ropeode import accuracy_table
from ropeode.render import format_table
from ropeode.simulation import simulate
from tests.checking.trajectory_writing import node_values, write_csv
from tests.schemas import FOLDER, assert_conforms
from tools import json_schemas

ROPE = "--num-nodes 4 --frames 3"
PROBLEMS = """
from ropeode import Problem, Rope
rope = Rope(num_nodes=4).problem(frames=3)
def cubic():
    return Problem(lambda t, y, args: -100 * y**3, [1.0], range(13))
"""
# The order claimed is not that of the step, so that there is a diagnosis.
STEP = """
def step(rhs, t, y, dt, args):
    return y + dt * rhs(t, 1.01 * y, args)
"""


def test_the_files_are_what_the_types_say():
    written = {file.name: file.read_text() for file in FOLDER.iterdir()}
    assert written == json_schemas.schemas(), "run: python -m tools.json_schemas"


@pytest.mark.parametrize("place", [(), ("problem",), ("reference", "witnesses", 0)])
def test_what_a_schema_does_not_say_is_refused(place, small_rope):
    """Another key, a missing one, and another type, wherever it stands."""
    text = format_table(accuracy_table(small_rope, ["rk4"], (8, 16, 32)), "json")
    assert_conforms(text)
    last = next(reversed(functools.reduce(operator.getitem, place, json.loads(text))))
    for change in ({"further": 1}, {last: None}, {last: [[]]}):
        form = json.loads(text)
        part = functools.reduce(operator.getitem, place, form)
        part.update(change)
        if change == {last: None}:
            del part[last]
        with pytest.raises(ValidationError):
            assert_conforms(json.dumps(form))


@pytest.mark.slow
@pytest.mark.parametrize(
    "command",
    [
        # Runs that diverge, errors below the resolution, and orders that cannot be determined.
        f"table {ROPE} --damping 0 --steps 4,8,16,1000,30000",
        f"table {ROPE} --steppers diffrax:Heun --steps 16",
        "table --problem problems.py:cubic --steppers explicit-euler,rk4 --steps 2,9",
        f"table --kind inextensible-rope {ROPE} --steppers rattle --steps 8,16,32",
        "table --reference kepler --steppers rk4 --steps 64,128",
        "check step.py:step --order 1 --quick",
        "grade 16.csv 32.csv 64.csv --problem problems.py:rope --order 2",
        "report --figures 1,8,28 --frames 40",
    ],
)
def test_every_command_keeps_its_schema(command, run, small_rope, tmp_path):
    (tmp_path / "problems.py").write_text(PROBLEMS)
    (tmp_path / "step.py").write_text(STEP)
    if command.startswith("grade"):
        for steps in (16, 32, 64):
            trajectory = simulate(small_rope, "velocity-verlet", steps)
            values = node_values(small_rope, trajectory.states)
            write_csv(tmp_path / f"{steps}.csv", trajectory.times, values, 1 / steps)
    done = run(*command.split(), "--format", "json")
    assert done.stdout, done.stderr
    assert_conforms(done.stdout)
