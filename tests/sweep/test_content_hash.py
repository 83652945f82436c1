"""A key changes with everything that a row depends on, and with nothing else."""

import dataclasses
import importlib
from pathlib import Path

import pytest

from ropeode.sweep import SweepSpec, read_sweep

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


def test_every_version_counts(plain):
    software = plain.settings.software
    assert {"jax", "numpy", "python", "machine", "backend", "source"} <= set(software)
    for name in software:
        other = dataclasses.replace(plain.settings, software={**software, name: "another"})
        assert other.problem_key(plain.parameters) != plain.problem_key


OWN = """
from ropeode.steppers.euler import ExplicitEuler

class Own(ExplicitEuler):
    name = "own"
"""


def test_a_users_stepper_counts_by_what_is_in_its_file(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    file = tmp_path / "own_stepper.py"
    file.write_text(OWN)
    values = {**VALUES, "steppers": [importlib.import_module("own_stepper").Own(), "rk4"]}
    before, other = SweepSpec(values).cases()
    file.write_text(OWN + "# changed")
    after, same = SweepSpec(values).cases()
    assert before.key != after.key
    assert before.problem_key == after.problem_key
    assert other.key == same.key


PENDULUM = (Path(__file__).parents[2] / "docs/examples/pendulum.py").read_text()
EULER = "import helper\ndef euler(rhs, t, y, dt, args):\n    return y + dt * rhs(t, y, args)\n"


def test_a_users_file_counts_by_what_is_in_it_and_in_what_it_imports(tmp_path):
    """Of a problem and of a stepper, wherever the files are."""

    def key_of(folder, problem=PENDULUM, step=EULER, helper="", stepper="steps.py"):
        (tmp_path / folder).mkdir()
        files = {"own.py": problem, "steps.py": step, "helper.py": helper}
        files["sweep.toml"] = f'problem = "own.py:pendulum"\nsteppers = ["{stepper}"]\n'
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
