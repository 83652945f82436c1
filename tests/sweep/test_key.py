"""A key changes with anything that a row depends on, and with nothing else."""

import subprocess
import sys
from pathlib import Path

import pytest

import ropeode
from ropeode.sweep.design import cases
from ropeode.sweep.design.content_hash import SOURCES, source_digest, surroundings
from ropeode.sweep.design.spec import SweepSpec, read_sweep

VALUES = {
    "steppers": ["rk4"],
    "steps_per_frame": [8],
    "frames": 2,
    "rope": {"num_nodes": 3},
    "grid": {"damping": [0.1]},
}

CHANGES = {
    "kind": {"kind": "inextensible-rope"},
    "stepper": {"steppers": ["velocity-verlet"]},
    "steps": {"steps_per_frame": [9]},
    "frames": {"frames": 3},
    "parameter": {"rope": {"num_nodes": 3, "stiffness": 99.0}},
    "another parameter": {"rope": {"num_nodes": 3, "pinned": [1]}},
    "value": {"grid": {"damping": [0.2]}},
    "norm": {"norm": "velocity-max"},
    "accuracy": {"accuracy": 1e-6},
    "rtol": {"rtol": 1e-10},
    "level": {"level": "extended"},
    "digits": {"level": "extended", "digits": 20},
    "factors": {"order_factors": [1, 2, 4]},
    "no order": {"order_factors": []},
    "stable dt": {"largest_stable_dt": True},
    "draw": {"random": {"count": 1, "gravity": {"choice": [[0.0, -1.0]]}}},
}
# These say something of the runs and nothing of what is solved.
SAME_REFERENCE = {"stepper", "steps", "norm", "factors", "no order", "stable dt", "draw"}


def only_case(values):
    (case,) = SweepSpec(values).cases()
    return case


@pytest.fixture(scope="module")
def found():
    plain = {"plain": only_case(VALUES)}
    return plain | {what: only_case({**VALUES, **more}) for what, more in CHANGES.items()}


def test_every_change_makes_another_key(found):
    assert len({case.key for case in found.values()}) == len(found)


@pytest.mark.parametrize("what", CHANGES)
def test_a_reference_is_shared_by_what_does_not_change_it(found, what):
    same = found[what].problem_key == found["plain"].problem_key
    assert same == (what in SAME_REFERENCE)


def test_what_is_written_as_the_default_is_no_change(found):
    more = {"level": "consensus", "norm": "position-max", "order_factors": [8, 4, 2, 1]}
    rope = {"stiffness": 100, "gravity": [0, -1], "num_nodes": 3}
    assert only_case({**VALUES, **more, "rope": rope}).key == found["plain"].key
    assert only_case({**VALUES, "steppers": ["rk4:"]}).key == found["plain"].key


@pytest.mark.parametrize("name", ["jax", "numpy", "python", "machine", "backend", "source"])
def test_every_version_counts(found, monkeypatch, name):
    other = {**surroundings(), name: "another"}
    cases._surroundings_digest.cache_clear()
    monkeypatch.setattr(cases, "surroundings", lambda level: other)
    try:
        case = only_case(VALUES)
    finally:
        cases._surroundings_digest.cache_clear()
    assert case.key != found["plain"].key
    assert case.problem_key != found["plain"].problem_key


def test_a_users_file_counts_by_what_is_in_it(tmp_path):
    text = (Path(__file__).parents[2] / "docs" / "examples" / "pendulum.py").read_text()

    def key_of(folder: str, file: str, text: str) -> str:
        (tmp_path / folder).mkdir()
        (tmp_path / folder / file).write_text(text)
        spec = tmp_path / folder / "sweep.toml"
        spec.write_text(f'problem = "{file}:pendulum"\nsteppers = ["rk4"]\nsteps_per_frame = [4]')
        (case,) = read_sweep(spec).cases()
        return case.key

    here = key_of("a", "pendulum.py", text)
    assert key_of("b", "moved.py", text) == here
    assert key_of("c", "pendulum.py", text.replace("RATE = 0.1", "RATE = 0.2")) != here


def test_all_that_evaluate_imports_takes_part_in_the_key():
    code = (
        "import sys, ropeode.sweep.execution.evaluate\n"
        "print(*(m.__file__ for n, m in sys.modules.items() if n.split('.')[0] == 'ropeode'))"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True, text=True)
    package = Path(ropeode.__file__).parent
    for file in map(Path, run.stdout.split()):
        part = file.relative_to(package)
        holds = [*map(str, part.parents), str(part)]
        # The files of the rooms themselves hold no code that computes.
        assert part.name == "__init__.py" or any(name in SOURCES for name in holds), part


def test_a_changed_source_counts(tmp_path):
    for part in SOURCES:
        path = tmp_path / part
        path.parent.mkdir(parents=True, exist_ok=True)
        if part.endswith(".py"):
            path.write_text("")
        else:
            path.mkdir()
    (tmp_path / "steppers" / "euler.py").write_text("a = 1")
    before = source_digest(tmp_path)
    assert source_digest(tmp_path) == before
    (tmp_path / "steppers" / "euler.py").write_text("a = 2")
    assert source_digest(tmp_path) != before
    assert surroundings()["source"] == source_digest(Path(ropeode.__file__).parent)
