"""The cases of a spec: all of them, once, made lazily, and the same when the sweep grows."""

import itertools
import json
import re
import tomllib
from pathlib import Path

import pytest

from ropeode.errors import InputError
from ropeode.study import TableJob
from ropeode.sweep import (
    INPUTS,
    RESULTS,
    STATUSES,
    Distribution,
    SweepSpec,
    commented_sweep,
    read_sweep,
)

SMALL = """
steppers = ["rk4", "semi-implicit-euler"]
steps_per_frame = [8, 16]
frames = 3
[rope]
num_nodes = 3
[grid]
damping = [0.0, 0.1]
gravity = [[0.0, -1.0], [0.0, -2.0]]
[random]
count = 3
seeds = [4, 7]
stiffness = { log_uniform = [10.0, 100.0] }
node_mass = { uniform = [0.5, 2.0], for_each = "node" }
"""


def sweep(text: str, **more) -> SweepSpec:
    return SweepSpec({**tomllib.loads(text), **more})


@pytest.fixture(scope="module")
def small():
    spec = sweep(SMALL)
    return spec, list(spec.cases())


def test_every_combination_comes_once(small):
    spec, cases = small
    assert [case.number for case in cases] == list(range(spec.count)) == list(range(2 * 2 * 24))
    assert len({case.key for case in cases}) == spec.count
    assert json.loads(json.dumps(spec.values)) == spec.values
    for start, stop in ((0, 0), (0, 7), (5, 110), (23, 24), (40, 30), (96, 97)):
        assert list(spec.cases(start, stop)) == cases[start:stop]
    varied = [
        *((0.0, 0.1), (-1.0, -2.0), (4, 7), range(3)),
        *(("rk4", "semi-implicit-euler"), (8, 16)),
    ]
    combinations = {
        (p["damping"], p["gravity"][1], case.seed, case.draw, case.stepper, case.steps_per_frame)
        for case in cases
        for p in (case.parameters,)
    }
    assert combinations == set(itertools.product(*varied))
    # Each draw is the same at every point of the grid.
    drawn = {(case.seed, case.draw, case.parameters["stiffness"]) for case in cases}
    assert len(drawn) == 6
    assert len({stiffness for *_, stiffness in drawn}) == 6


def test_tasks_hold_every_case_once_and_one_shape_each():
    text = SMALL.replace("num_nodes = 3\n", "").replace("frames = 3\n", "")
    shapes = "frames = [2, 3]\n[random]\nnum_nodes = { integers = [2, 3] }"
    spec = sweep(text.replace("[random]", shapes))
    tasks = list(spec.tasks())
    assert sorted(case.number for task in tasks for case in task.cases) == list(range(spec.count))
    for task in tasks:
        assert len({(c.parameters["num_nodes"], c.parameters["frames"]) for c in task.cases}) == 1
    assert [task.number for task in tasks] == list(range(len(tasks)))
    assert list(spec.tasks(2)) == tasks[2:]
    first, *rest = tasks[0].cases
    assert tasks[0].without({first.key}) == (0, (*rest,))
    assert tasks[0].without({case.key for case in tasks[0].cases}) is None


def test_a_design_of_hundred_million_cases_takes_no_room():
    values = [round(0.001 * k, 3) for k in range(100)]
    spec = sweep(SMALL.replace("[0.0, 0.1]", str(values)).replace("count = 3", "count = 62500"))
    assert spec.count == 100 * 2 * 2 * 62500 * 4 == 100_000_000
    last = list(spec.cases(spec.count - 2))
    assert [case.number for case in last] == [spec.count - 2, spec.count - 1]
    assert last[-1].parameters["damping"] == values[-1]
    assert (last[-1].seed, last[-1].draw) == (7, 62499)
    # A task is no larger than what may be computed twice where its process dies.
    assert len(next(spec.tasks()).cases) == 4 * 64


@pytest.mark.parametrize(
    ("few", "more"),
    [
        ("count = 3", "count = 5"),
        ("seeds = [4, 7]", "seeds = [9, 7, 4]"),
        ("damping = [0.0, 0.1]", "damping = [0.3, 0.1, 0.0]"),
        ('["rk4", ', '["velocity-verlet", "rk4", '),
        ("[8, 16]", "[8, 12, 16]"),
    ],
)
def test_a_sweep_that_grows_keeps_its_cases(few, more, small):
    _, before = small
    after = {case.key: case for case in sweep(SMALL.replace(few, more)).cases()}
    assert len(after) > len(before)
    for case in before:
        assert after[case.key].inputs() == case.inputs()


DRAWN = {
    "initial_velocity": '{ uniform = [[-1, 0], [1, 2]], for_each = "node" }',
    "node_mass": '{ uniform = [0.5, 2.0], for_each = "node" }',
    "stiffness": '{ uniform = [50.0, 99.0], for_each = "spring" }',
    "num_nodes": "{ integers = [2, 5] }",
    "stepper": '{ choice = ["rk4", "velocity-verlet"] }',
    "steps_per_frame": "{ integers = [4, 40] }",
}


def test_everything_may_be_drawn():
    """A number of nodes before lists, whatever the order in which they are written."""

    def cases_of(names):
        lines = ["[random]", "count = 12", *(f"{name} = {DRAWN[name]}" for name in names)]
        return list(sweep("\n".join(lines)).cases())

    cases = cases_of(DRAWN)
    assert [case.key for case in cases] == [case.key for case in cases_of(reversed(DRAWN))]
    assert len(cases) == 12
    assert {case.stepper for case in cases} == {"rk4", "velocity-verlet"}
    assert len({case.steps_per_frame for case in cases} & {*range(4, 41)}) > 3
    assert len({case.parameters["num_nodes"] for case in cases}) > 1
    for case in cases:
        nodes = case.parameters["num_nodes"]
        assert len(case.parameters["node_mass"]) == nodes
        assert len(case.parameters["stiffness"]) == nodes - 1
        # A pinned node does not move.
        pinned, *others = case.parameters["initial_velocity"]
        assert (pinned, len(others)) == ([0.0, 0.0], nodes - 1)
        assert all(-1 <= x <= 1 and 0 <= y <= 2 and x != y for x, y in others)


BAD = {
    "norm": "norm = 'big'\nsteps_per_frame = []\n[grid]\ndamping = 1\n[random]\ncount = -1",
    "stepers": 'stepers = ["rk4"]',
    "order_factors": "order_factors = [1, 2]",
    "damping": "[grid]\ndamping = [-1.0, 0.1, -2.0]",
    "grid.stiffness": "[grid]\nstiffness = [1.0, 1]",
    "grid.node_mass": "[grid]\nnode_mass = [inf]",
    "gravity": "[rope]\ngravity = [0, -1]\n[grid]\ngravity = [[0, -1]]",
    "random": "[random]\ncount = 3",
    "random.count": "[random]\nstiffness = { uniform = [1, 2] }",
    "stiffness": "[random]\ncount = 1\nstiffness = { uniform = [0, 2] }",
    "random.end": "[random]\ncount = 1\nend = { uniform = [1, 2], choice = [3] }",
    "random.stepper": "[random]\ncount = 1\nstepper = { uniform = [1, 2] }",
    "velocity-verlet": 'problem = "lorenz"\nsteppers = ["velocity-verlet"]',
    "rope": 'problem = "lorenz"\n[rope]\ndamping = 1.0',
    "random.periods": 'problem = "kepler"\n[random]\ncount = 1\n'
    'periods = { uniform = [1, 2], for_each = "node" }',
    "pinned": 'kind = "inextensible-rope"\n[grid]\npinned = [[0], [0, 15]]',
    "problem: {'kind': 'rope'}": '[problem]\nkind = "rope"',
    "steps_per_frame: [[1]]": "[random]\ncount = 1\nsteps_per_frame = { choice = [[1], [1]] }",
}
SEVERAL = {"norm": 4, "damping": 2}


@pytest.mark.parametrize("what", BAD)
def test_bad_values_are_all_reported_before_anything_runs(what):
    with pytest.raises(InputError) as caught:
        sweep(BAD[what])
    lines = caught.value.problems
    assert any(what in line.partition(" given;")[0] for line in lines)
    assert len(set(lines)) == len(lines) == SEVERAL.get(what, 1)
    for line in lines:
        assert "\n" not in line
        assert "; allowed: " in line or ", which does not exist" in line
        assert "Fix: " in line


def test_the_commented_spec(tmp_path):
    """The lines that are commented out can be used as well."""
    path, text = tmp_path / "sweep.toml", commented_sweep()
    head, random, rest = text.partition("# [random]")
    head = head.replace("# accuracy", "accuracy").replace("# rtol", "rtol")
    for each, count in ((head + (random + rest).replace("# ", ""), 48), (text, 24)):
        path.write_text(each)
        assert read_sweep(path).count == count
        assert read_sweep(path).fields.accuracy == (1e-6 if count == 48 else None)


def test_a_spec_of_a_table_says_the_same_of_its_problem():
    values = {"problem": "inextensible-rope", "frames": 2, "rope": {"num_nodes": 4}}
    case = next(SweepSpec(values).cases())
    assert {"kind": case.settings.problem, **case.parameters} == TableJob(values).problem.parameters


def test_parameters_of_the_library_have_one_form():
    spec = sweep('problem = "kepler"\nsteppers = ["rk4"]\n[grid]\neccentricity = [0, 0.5]')
    (first, *_) = spec.cases()
    assert first.parameters == {"frames": 20, "eccentricity": 0.0, "periods": 1.0}
    assert type(first.parameters["eccentricity"]) is float
    assert spec.columns["eccentricity"].type == "double"
    assert spec.columns["frames"].type == "int64"


PAGE = (Path(__file__).parents[2] / "docs/reference/sweep-spec.md").read_text()


def test_the_page_says_what_the_schema_says():
    rows = re.findall(r"^\| `(.+?)` \| (\w+) \| (.+) \|$", PAGE, re.MULTILINE)
    assert rows == [(name, *column) for name, column in (INPUTS | RESULTS).items()]
    rows = re.findall(r"^\| `([a-z-]+)` \| ([^|]+) \|$", PAGE, re.MULTILINE)
    assert rows == list(STATUSES.items())
    example = sweep(re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)[0])
    assert f"{example.count} cases" in PAGE
    for name in {*type(example.fields).model_fields, *Distribution.model_fields, "seeds", "count"}:
        assert name in PAGE
