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
OF_RUNS = {
    "stepper": {"steppers": ["velocity-verlet"]},
    "steps": {"steps_per_frame": [9]},
    "norm": {"norm": "velocity-max"},
    "factors": {"order_factors": [1, 2, 4]},
    "no order": {"order_factors": []},
    "stable dt": {"largest_stable_dt": True},
    "draw": {"random": {"count": 1, "gravity": {"choice": [[0.0, -1.0]]}}},
}
CHANGES = {
    **OF_RUNS,
    "kind": {"kind": "inextensible-rope"},
    "frames": {"frames": 3},
    "parameter": {"rope": {"num_nodes": 3, "stiffness": 99.0}},
    "another parameter": {"rope": {"num_nodes": 3, "pinned": [1]}},
    "value": {"grid": {"damping": [0.2]}},
    "accuracy": {"accuracy": 1e-6},
    "rtol": {"rtol": 1e-10},
    "level": {"level": "extended"},
    "digits": {"level": "extended", "digits": 20},
}


def only_case(values):
    (case,) = SweepSpec(values).cases()
    return case


@pytest.fixture(scope="module")
def cases():
    plain = {"plain": only_case(VALUES)}
    return plain | {what: only_case({**VALUES, **more}) for what, more in CHANGES.items()}


def test_every_change_changes_the_key_and_some_the_reference(cases):
    assert len({case.key for case in cases.values()}) == len(cases)
    same = {w for w, case in cases.items() if case.problem_key == cases["plain"].problem_key}
    assert same == {"plain", *OF_RUNS}


def test_each_draw_has_a_key_of_its_own():
    """Also where two draws are equal; they have the same reference."""
    random = {"count": 2, "seeds": [3, 4], "gravity": {"choice": [[0.0, -1.0]]}}
    cases = list(SweepSpec({**VALUES, "random": random}).cases())
    assert len({case.key for case in cases}) == len(cases) == 4
    assert len({case.problem_key for case in cases}) == 1


def test_what_is_written_as_the_default_is_no_change(cases):
    more = {"level": "consensus", "norm": "position-max", "order_factors": [8, 4, 2, 1]}
    rope = {"stiffness": 100, "gravity": [0, -1], "num_nodes": 3}
    assert only_case({**VALUES, **more, "rope": rope}).key == cases["plain"].key
    assert only_case({**VALUES, "steppers": ["rk4:"]}).key == cases["plain"].key


def test_every_version_counts(cases):
    case = cases["plain"]
    assert {"jax", "numpy", "python", "machine", "backend", "source"} <= set(case.settings.software)
    for name in case.settings.software:
        software = {**case.settings.software, name: "another"}
        settings = dataclasses.replace(case.settings, software=software)
        assert settings.problem_key(case.parameters) != case.problem_key


STEPPER = """
import dataclasses
from ropeode.steppers.euler import ExplicitEuler

@dataclasses.dataclass(frozen=True)
class Own(ExplicitEuler):
    name = "own"
"""


def test_a_users_stepper_counts_by_what_is_in_its_file(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    file = tmp_path / "own_stepper.py"
    file.write_text(STEPPER)
    own = importlib.import_module("own_stepper").Own()
    before = SweepSpec({**VALUES, "steppers": [own, "rk4"]})
    assert list(before.values["stepper_files"]) == ["own"]
    file.write_text(STEPPER + "# changed")
    after = SweepSpec({**VALUES, "steppers": [own, "rk4"]})
    (own_before, other), (own_after, same) = before.cases(), after.cases()
    assert own_before.key != own_after.key
    assert own_before.problem_key == own_after.problem_key
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
