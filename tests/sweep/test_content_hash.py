"""A key changes with everything that a row depends on, and with nothing else."""

import ast
import importlib
from pathlib import Path

import pytest

import ropeode
from ropeode.cache import source_digest
from ropeode.errors import InputError
from ropeode.steppers import STEPPERS
from ropeode.sweep.design import spec as spec_module
from ropeode.sweep.design.content_hash import SOURCES, software
from ropeode.sweep.design.spec import SweepSpec, read_sweep
from ropeode.sweep.design.steppers import stepper_digest, stepper_from, stepper_sources

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
# These concern the runs and not the problem.
SAME_REFERENCE = {"stepper", "steps", "norm", "factors", "no order", "stable dt", "draw"}


def only_case(values):
    (case,) = SweepSpec(values).cases()
    return case


@pytest.fixture(scope="module")
def cases():
    plain = {"plain": only_case(VALUES)}
    return plain | {what: only_case({**VALUES, **more}) for what, more in CHANGES.items()}


def test_every_change_changes_the_key(cases):
    assert len({case.key for case in cases.values()}) == len(cases)


@pytest.mark.parametrize("what", CHANGES)
def test_a_reference_is_shared_by_what_does_not_change_it(cases, what):
    same = cases[what].problem_key == cases["plain"].problem_key
    assert same == (what in SAME_REFERENCE)


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


@pytest.mark.parametrize("name", ["jax", "numpy", "python", "machine", "backend", "source"])
def test_every_version_counts(cases, monkeypatch, name):
    other = {**software(), name: "another"}
    monkeypatch.setattr(spec_module, "software", lambda: other)
    case = only_case(VALUES)
    assert case.key != cases["plain"].key
    assert case.problem_key != cases["plain"].problem_key


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
    sources = stepper_sources([own, "rk4"], tmp_path)
    assert [(label, source.file is None) for label, source in sources.items()] == [
        ("own", False),
        ("rk4", True),
    ]
    assert stepper_from(sources["own"], tmp_path) == own
    spec = SweepSpec({**VALUES, "steppers": [own]})
    assert spec.values["stepper_files"] == {"own": sources["own"].file}
    file.write_text(STEPPER + "# changed")
    with pytest.raises(InputError, match="^stepper: .* allowed: the same file in all processes"):
        stepper_from(sources["own"], tmp_path)
    before, after = next(spec.cases()), only_case({**VALUES, "steppers": [own]})
    assert after.key != before.key
    assert after.problem_key == before.problem_key


def test_a_name_of_a_file_starts_from_the_folder_of_the_spec(tmp_path):
    """As a stepper in a file has it, with and without a name."""
    (tmp_path / "steps.py").write_text("a = 1")
    digest = stepper_digest("steps.py", tmp_path)
    assert digest == stepper_digest("steps.py:euler", tmp_path) is not None
    assert {stepper_digest(name, tmp_path) for name in (*STEPPERS, "diffrax:Heun")} == {None}
    (tmp_path / "steps.py").write_text("a = 2")
    assert stepper_digest("steps.py", tmp_path) not in (digest, None)


def test_a_users_stepper_file_runs_once_for_all_tasks_until_it_changes(tmp_path):
    runs, file = tmp_path / "runs", tmp_path / "steps.py"
    text = (
        f"from pathlib import Path\nwith Path({str(runs)!r}).open('a') as runs:\n"
        "    runs.write('.')\n"
        "def euler(rhs, t, y, dt, args):\n    return y + dt * rhs(t, y, args)\n"
    )
    file.write_text(text)
    [source] = stepper_sources("steps.py", tmp_path).values()
    before = len(runs.read_text())
    first, second = (stepper_from(source, tmp_path) for _ in range(2))
    assert first is second
    assert len(runs.read_text()) == before + 1
    file.write_text(text + "# changed")
    [source] = stepper_sources("steps.py", tmp_path).values()
    assert stepper_from(source, tmp_path) is not first


def imported(path: Path) -> set[Path]:
    """The files of the package that a file imports, lazily or not."""
    root = Path(ropeode.__file__).parents[1]
    files = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("ropeode"):
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        else:
            continue
        for name in names:
            place = root.joinpath(*name.split("."))
            files |= {place.with_suffix(".py"), place / "__init__.py"}
    return {file for file in files if file.exists()}


def test_all_that_evaluate_imports_counts():
    package = Path(ropeode.__file__).parent
    new, files = {package / "sweep" / "execution" / "evaluate.py"}, set()
    while new:
        files |= new
        new = {other for file in new for other in imported(file)} - files
    assert package / "steppers" / "euler.py" in files
    for file in files:
        part = file.relative_to(package)
        within = [*map(str, part.parents), str(part)]
        # The `__init__.py` of a room contains no code that computes.
        assert part.name == "__init__.py" or any(name in SOURCES for name in within), part


def test_a_changed_source_counts(tmp_path):
    for part in SOURCES:
        path = tmp_path / part
        path.parent.mkdir(parents=True, exist_ok=True)
        if part.endswith(".py"):
            path.write_text("")
        else:
            path.mkdir()
    (tmp_path / "steppers" / "euler.py").write_text("a = 1")
    before = source_digest(tmp_path, SOURCES)
    assert source_digest(tmp_path, SOURCES) == before
    (tmp_path / "steppers" / "euler.py").write_text("a = 2")
    assert source_digest(tmp_path, SOURCES) != before
    assert software()["source"] == source_digest(Path(ropeode.__file__).parent, SOURCES)
