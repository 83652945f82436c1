"""The cases of a spec: all of them, once, made lazily; their keys and draws, the same for ever."""

from __future__ import annotations

import decimal
import importlib
import itertools
import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from ropeode.errors import InputError
from ropeode.study import TableJob
from ropeode.sweep import (
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
    parameters = next(spec.cases()).parameters
    assert parameters == {"frames": 20, "eccentricity": 0.0, "periods": 1.0}
    assert type(parameters["eccentricity"]) is float
    assert [spec.columns[name].type for name in ("eccentricity", "frames")] == ["double", "int64"]


VALUES = {
    "steppers": ["rk4"],
    "steps_per_frame": [8],
    "frames": 2,
    "rope": {"num_nodes": 3},
    "grid": {"damping": [0.1]},
}

# These concern the runs, and the others the problem and its reference as well.
OF_RUNS = [
    {"steppers": ["velocity-verlet"]},
    {"steps_per_frame": [9]},
    {"norm": "velocity-max"},
    {"order_factors": [1, 2, 4]},
    {"order_factors": []},
    {"largest_stable_dt": True},
    {"random": {"count": 1, "gravity": {"choice": [[0.0, -1.0]]}}},
]
OF_PROBLEMS = [
    {"kind": "inextensible-rope"},
    {"frames": 3},
    {"rope": {"num_nodes": 3, "stiffness": 99.0}},
    {"grid": {"damping": [0.2]}},
    {"accuracy": 1e-6},
    {"rtol": 1e-10},
    {"level": "extended"},
    {"level": "extended", "digits": 20},
]


def only_case(values):
    (case,) = SweepSpec(values).cases()
    return case


@pytest.fixture(scope="module")
def plain():
    return only_case(VALUES)


def test_every_change_changes_the_key_and_some_the_reference(plain):
    runs, problems = (
        [only_case({**VALUES, **more}) for more in of] for of in (OF_RUNS, OF_PROBLEMS)
    )
    assert len({case.key for case in (plain, *runs, *problems)}) == 1 + len(runs) + len(problems)
    assert {case.problem_key for case in runs} == {plain.problem_key}
    assert len({case.problem_key for case in (plain, *problems)}) == 1 + len(problems)


def test_each_draw_has_a_key_of_its_own():
    """Also where two draws are equal; they have the same reference."""
    random = {"count": 2, "seeds": [3, 4], "gravity": {"choice": [[0.0, -1.0]]}}
    cases = list(SweepSpec({**VALUES, "random": random}).cases())
    assert len({case.key for case in cases}) == len(cases) == 4
    assert len({case.problem_key for case in cases}) == 1


def test_what_is_written_as_the_default_is_no_change(plain):
    more = {"level": "consensus", "norm": "position-max", "order_factors": [8, 4, 2, 1]}
    rope = {"stiffness": 100, "gravity": [0, -1], "num_nodes": 3}
    assert only_case({**VALUES, **more, "rope": rope}).key == plain.key
    assert only_case({**VALUES, "steppers": ["rk4:"]}).key == plain.key


PENDULUM = (Path(__file__).parents[2] / "docs/examples/pendulum.py").read_text()
EULER = "import own_helper\ndef euler(rhs, t, y, dt, args):\n    return y + dt * rhs(t, y, args)\n"


def test_a_users_file_counts_by_what_is_in_it_and_in_what_it_imports(tmp_path, monkeypatch):
    """Of a problem and of a stepper, which may be an object; wherever the files are."""

    def key_of(folder, problem=PENDULUM, step=EULER, helper=""):
        (tmp_path / folder).mkdir()
        files = {"own.py": problem, "own_steps.py": step, "own_helper.py": helper}
        files["sweep.toml"] = 'problem = "own.py:pendulum"\nsteppers = ["own_steps.py"]\n'
        for name, text in files.items():
            (tmp_path / folder / name).write_text(text)
        case, *_ = read_sweep(tmp_path / folder / "sweep.toml").cases()
        return case.key

    keys = [
        key_of("plain"),
        key_of("problem changed", problem=PENDULUM.replace("RATE = 0.1", "RATE = 0.2")),
        key_of("step changed", step=EULER + "# changed"),
        key_of("helper changed", helper="# changed"),
    ]
    assert len(set(keys)) == 4
    assert key_of("moved") == keys[0]
    monkeypatch.syspath_prepend(tmp_path / "moved")
    values = {**VALUES, "steppers": [importlib.import_module("own_steps").euler, "rk4"]}
    before, other = SweepSpec(values).cases()
    (tmp_path / "moved/own_steps.py").write_text(EULER + "# changed")
    after, same = SweepSpec(values).cases()
    assert before.key != after.key
    assert (before.problem_key, other.key) == (after.problem_key, same.key)


names = st.sampled_from(["damping", "stiffness", "stepper", "x"])
whole = st.integers(0, 2**31)


def draws(distribution: Distribution, count: int = 2000, name: str = "damping") -> np.ndarray:
    return np.array([distribution.value(5, draw, name, None) for draw in range(count)])


def test_each_value_is_as_likely_as_it_should_be():
    uniform = draws(Distribution(uniform=[-1.0, 3.0]))
    assert stats.kstest(uniform, stats.uniform(-1, 4).cdf).pvalue > 0.01
    logs = draws(Distribution(log_uniform=[10.0, 1e4]))
    assert stats.kstest(logs, stats.loguniform(10, 1e4).cdf).pvalue > 0.01
    # The same random bits lie behind both.
    assert np.allclose((uniform + 1) / 4, np.log10(logs / 10) / 3, rtol=1e-13, atol=1e-13)
    for of, few in ({"integers": [3, 8]}, 6), ({"choice": ["a", "b", "c"]}, 3):
        values, counts = np.unique(draws(Distribution(**of)), return_counts=True)
        assert len(values) == few
        assert stats.chisquare(counts).pvalue > 0.01
    assert {*draws(Distribution(integers=[3, 8]))} == {*range(3, 9)}


def test_neighbours_are_independent():
    uniform = Distribution(uniform=[0.0, 1.0])
    series = [
        draws(uniform),
        draws(uniform, name="stiffness"),
        [uniform.value(6, draw, "damping", None) for draw in range(2000)],
        [uniform.value(5, draw, "damping", 2)[1] for draw in range(2000)],
        [*draws(uniform)[1:], 0.5],
    ]
    correlations = np.corrcoef(series) - np.eye(len(series))
    # Five standard deviations of the correlation of independent series of this length.
    assert np.max(np.abs(correlations)) < 5 / np.sqrt(2000)


@given(whole, whole, names, st.integers(1, 5), st.integers(1, 5))
@settings(max_examples=10, deadline=None)
def test_more_entries_leave_the_first_ones(seed, draw, name, few, more):
    distribution = Distribution(uniform=[[0.0, 5.0], [1.0, 6.0]])
    long = distribution.value(seed, draw, name, few + more)
    assert long[:few] == distribution.value(seed, draw, name, few)
    assert long[0] == distribution.value(seed, draw, name, None)
    assert all(0 <= x <= 1 and 5 <= y <= 6 for x, y in long)


@given(st.floats(1e-300, 1e300), st.floats(1.0, 1e5), whole)
@settings(max_examples=50, deadline=None)
def test_logarithms_are_rounded_rightly(low, factor, draw):
    high = min(low * factor, 1e300)
    drawn = Distribution(log_uniform=[low, high]).value(1, draw, "x", None)
    fraction = Distribution(uniform=[0.0, 1.0]).value(1, draw, "x", None)
    with decimal.localcontext(decimal.Context(prec=60)):
        start, end = decimal.Decimal(low), decimal.Decimal(high)
        exact = start * (end / start) ** decimal.Decimal(fraction)
        assert float(exact) == drawn
    assert low <= drawn <= high


def test_draws_are_the_same_everywhere_and_for_ever():
    drawn = Distribution(log_uniform=[1, 9]).value(3, 1, "x", 2)
    assert drawn == [2.717330389497861, 6.155352708015026]


def test_bad_distributions():
    for values in (
        *({"uniform": [1, 2, 3]}, {"uniform": [[1], 2]}, {"uniform": [[1, 2], [1]]}),
        *({"log_uniform": [0, 1]}, {"integers": [0.5, 1]}, {"integers": [2, 1]}),
        *({"choice": []}, {}),
    ):
        with pytest.raises(InputError, match="given; allowed: "):
            Distribution(**values)
