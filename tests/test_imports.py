"""Who may import whom, and what an import may cost."""

from __future__ import annotations

import ast
import importlib
import subprocess
import sys
import tomllib
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import ropeode
from docs.rooms import module_imports, picture, room_of, trees
from ropeode.cache import source_digest
from ropeode.sweep import SweepSpec

PACKAGE = Path(ropeode.__file__).parent

# From the ground up; a room imports from the rooms that it names, and from the ground floor.
GROUND = {
    "arrays",
    "bars",
    "cache",
    "callbacks",
    "display",
    "equality",
    "errors",
    "files",
    "json_form",
    "lapack",
    "precision",
    "progress",
    "sandbox",
    "threads",
    "validation",
    "written_by",
}
ALLOWED: dict[str, set[str]] = {}
ALLOWED["problems"] = set()
ALLOWED["tableaus"] = set()
ALLOWED["norms"] = {"problems"}
ALLOWED["steppers"] = {"problems", "tableaus"}
ALLOWED["simulation"] = {"steppers", *ALLOWED["steppers"]}
ALLOWED["references"] = {"problems", "norms"}
ALLOWED["analysis"] = {"norms", "references", "simulation", *ALLOWED["simulation"]}
ALLOWED["theory"] = {"analysis", *ALLOWED["analysis"]}
ALLOWED["study"] = {"theory", *ALLOWED["theory"]}
ALLOWED["sweep"] = {"study", *ALLOWED["study"]}
ALLOWED["checking"] = {"study", *ALLOWED["study"]}
ALLOWED["render"] = {"sweep", "checking", *ALLOWED["checking"]}
ALLOWED["terminal"] = set()
ALLOWED["case_studies"] = {"render", "terminal", *ALLOWED["render"]}
ALLOWED["classroom"] = {"render", "terminal", *ALLOWED["render"]}
ALLOWED["laboratory"] = {"case_studies", *ALLOWED["case_studies"]}
ALLOWED["cli"] = {"laboratory", "classroom", *ALLOWED["laboratory"]}
ALLOWED["pytest_plugin"] = {"checking", "render"}
ALLOWED["__main__"] = {"cli"}

# Modules that tests and other rooms may import: mathematics and data that read like a textbook.
# The module itself is its face.
LEAVES: dict[str, str] = {
    "ropeode.checking.energy_drift": "what drifts and what stays bounded, on made-up curves",
    "ropeode.checking.richardson": "limits of runs for dt = 0, of series that are known",
    "ropeode.checking.trajectories.coarse_steps": "the order of errors with made-up round-off",
    "ropeode.checking.written_precision": "with how many digits numbers were written",
    "ropeode.laboratory.messages": "what the page and Python say to each other",
    "ropeode.laboratory.scenes": "lessons and figures, as data",
    "ropeode.problems.links": "vectors of neighbours, tensions and impulses along a chain",
    "ropeode.problems.nested_jaxprs": "the equations of a traced function, inside loops too",
    "ropeode.problems.rope": "the rope's acceleration, energy and damping",
    "ropeode.references.defect": "what a right-hand side does between steps, by known pulses",
    "ropeode.references.extended.taylor": "Taylor series in extended precision, to 30 digits",
    "ropeode.references.extended.translate": "right-hand sides as expressions, held against JAX",
    "ropeode.references.solvers.dop853": "many problems side by side, held against SciPy's method",
    "ropeode.references.solvers.rounding": "what each operation loses, by operations that lose it",
    "ropeode.render.plots.overlaps": "where lines and marks go that would hide one another",
    "ropeode.study.error_constant": "the leading term of an error, on runs made up for it",
    "ropeode.study.pareto": "Pareto fronts and costs of errors, held against brute force",
    "ropeode.tableaus.rooted_trees": "rooted trees, held against their known numbers",
    "ropeode.tableaus.stages": "arithmetic with exact coefficients",
    "ropeode.theory.known_mistakes": "famous mistakes, as data",
}


@pytest.fixture(scope="module")
def modules():
    """The syntax tree of each. Reading them all takes a second, which not every process needs."""
    return trees()


@pytest.fixture(scope="module")
def imports(modules):
    return module_imports(modules)


def circle_through(module: str, imports) -> list[str]:
    """The shortest way from a module back to itself along imports; empty if there is none."""
    paths, visited = [[module]], {module}
    while paths:
        path = paths.pop(0)
        for other in sorted(imports[path[-1]]):
            if other == module:
                return [*path, module]
            if other not in visited:
                visited.add(other)
                paths.append([*path, other])
    return []


def test_rooms_import_downwards_only(imports):
    offences = [
        f"{module} imports {other}"
        for module, others in sorted(imports.items())
        for other in sorted(others)
        if (room := room_of(module)) != "__init__"
        and room_of(other) != room
        and room_of(other) not in GROUND | ALLOWED.get(room, set())
    ]
    assert not offences, "\n".join(offences)


def test_no_file_imports_itself_through_others(imports):
    paths = [circle_through(module, imports) for module in sorted(imports)]
    circles = {frozenset(path): path for path in paths if path}
    assert not circles, "\n".join(" -> ".join(path) for path in circles.values())


def behind_the_face(node: ast.AST) -> list[str]:
    """The names that a statement imports from behind the face of a room."""
    if not isinstance(node, ast.ImportFrom) or not (node.module or "").startswith("ropeode."):
        return []
    room, *inside = str(node.module).split(".")[1:]
    if room not in ALLOWED or not (PACKAGE / room).is_dir() or node.module in LEAVES:
        return []
    face = getattr(importlib.import_module(f"ropeode.{room}"), "__all__", ())
    return [
        f"{node.module}.{each.name}"
        for each in node.names
        # A module with the name of its function would hide it in the face.
        if each.name != (inside or [""])[-1]
        and (inside or each.name not in face)
        and f"{node.module}.{each.name}" not in LEAVES
    ]


def test_rooms_import_faces_only(modules):
    """So that what stands behind the face of a room can be moved."""
    offences = [
        f"{module}: {name}"
        for module, tree in modules.items()
        for node in ast.walk(tree)
        for name in behind_the_face(node)
        if not name.startswith(f"ropeode.{room_of(module)}.")
    ]
    assert not offences, "\n".join(offences)


def test_tests_import_faces_only():
    offences = [
        f"{path.name}: {name}"
        for path in sorted(Path(__file__).parent.rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text()))
        for name in behind_the_face(node)
    ]
    assert not offences, "\n".join(offences)


def test_every_room_is_listed_and_drawn(modules):
    assert {room_of(module) for module in modules} == {*ALLOWED, *GROUND, "__init__"}
    shown = (PACKAGE.parent / "CONTRIBUTING.md").read_text()
    assert picture() in shown, "run: cd docs && cog -P -r -I . ../CONTRIBUTING.md"


def test_every_module_says_what_it_is(modules):
    silent = [module for module, tree in modules.items() if not ast.get_docstring(tree)]
    assert not silent, silent


def run_python(code: str) -> str:
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout


@pytest.mark.parametrize("module", ["ropeode", "ropeode.cli.main", "ropeode.pytest_plugin"])
def test_import_is_light(module):
    heavy = "{'jax', 'diffrax', 'scipy', 'matplotlib', 'kauri', 'numpy', 'pydantic', 'rich'}"
    if module == "ropeode.cli.main":
        heavy = "{'jax', 'diffrax', 'scipy', 'matplotlib', 'kauri'}"
    assert run_python(f"import sys, {module}; print({heavy} & set(sys.modules))") == "set()\n"


def test_public_names_exist_and_type_checkers_see_them():
    stub = ast.parse((PACKAGE / "__init__.pyi").read_text())
    # Without `as`, an import in a stub is private to it.
    exported = {
        alias.asname
        for node in stub.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert exported == set(ropeode.__all__)
    for name in ropeode.__all__:
        assert getattr(ropeode, name).__name__.split(".")[-1] == name
    with pytest.raises(AttributeError, match="nonsense"):
        ropeode.nonsense  # noqa: B018


@pytest.mark.parametrize(
    "room", sorted(each.parent.name for each in PACKAGE.glob("*/__init__.pyi"))
)
def test_what_a_face_lists_exists(room):
    face = importlib.import_module(f"ropeode.{room}")
    for name in face.__all__:
        # A module of the same name would hide it.
        assert not (PACKAGE / room / f"{name}.py").exists(), name
        getattr(face, name)


def test_what_stands_beside_the_package_imports_what_exists(modules):
    root = PACKAGE.parent
    missing = []
    for path in (
        p for each in ("docs", "benchmarks", "reference") for p in (root / each).rglob("*.py")
    ):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("ropeode"):
                module = importlib.import_module(str(node.module))
                missing += [
                    f"{path.relative_to(root)}: {node.module}.{alias.name}"
                    for alias in node.names
                    if not hasattr(module, alias.name)
                    and f"{node.module}.{alias.name}" not in modules
                ]
    assert not missing, "\n".join(missing)


def test_the_rows_of_a_sweep_count_all_sources_that_it_imports(imports):
    """Those of all rooms below, and the files beside the rooms."""
    below = new = {"sweep"}
    while new := {room_of(o) for m in imports if room_of(m) in new for o in imports[m]} - below:
        below = below | new
    rooms = sorted(room for room in below if (PACKAGE / room).is_dir())
    assert {"sweep", "steppers", "references"} < set(rooms)
    parts = [*sorted(path.name for path in PACKAGE.glob("*.py")), *rooms]
    spec = {"steppers": ["rk4"], "rope": {"num_nodes": 3}, "grid": {"damping": [0.1]}}
    assert SweepSpec(spec).software["source"] == source_digest(PACKAGE, parts)


def test_version():
    project = tomllib.loads((PACKAGE.parent / "pyproject.toml").read_text())["project"]
    assert ropeode.__version__ == project["version"]


def test_rooms_and_stepper_classes_are_attributes_of_the_package():
    """In a process that has imported nothing else of ropeode; a command has no use in Python."""
    rooms = {each.parent.name for each in PACKAGE.glob("*/__init__.py")}
    named = sorted({*rooms, "errors"} - {"classroom", "cli", "terminal"})
    code = (
        "import ropeode\n"
        "print(ropeode.steppers.StormerVerlet(start='rest').label)\n"
        f"print(*(getattr(ropeode, name).__name__ for name in {named}))\n"
        "from ropeode.steppers import RungeKutta4\n"
        "print(ropeode.steppers.RungeKutta4 is RungeKutta4)"
    )
    label, found, same = run_python(code).splitlines()
    assert (label, same) == ("stormer-verlet:start=rest", "True")
    assert found.split() == [f"ropeode.{name}" for name in named]


def test_float64_is_not_switched_on_for_the_caller(small_rope):
    """By no import, since this process has imported all that is tested, and by no function."""
    run = ropeode.simulate(small_rope, "rk4", 8)
    known = ropeode.reference(small_rope)
    for states in (run.states, known.states):
        assert states.dtype == np.float64
        assert type(states) is np.ndarray
    assert jnp.ones(1).dtype == jnp.float32
    assert not jax.config.jax_enable_x64


def test_a_table_imports_nothing_that_only_other_commands_need():
    modules = "ropeode.study.spec, ropeode.render.formats, ropeode.references.kept"
    heavy = "{'diffrax', 'equinox', 'scipy', 'matplotlib', 'h5py', 'heyoka', 'xarray'}"
    assert run_python(f"import sys, {modules}; print({heavy} & set(sys.modules))") == "set()\n"


def test_one_line_runs_code_and_no_line_unpickles_a_file(modules):
    """Everything that could run what is in a file, wherever it stands in the package."""
    runs, unsafe = [], {"pickle", "marshal", "shelve", "yaml", "runpy", "dill"}
    for module, tree in modules.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.Import | ast.ImportFrom):
                names = [alias.name for alias in node.names] + [getattr(node, "module", "") or ""]
                # A child is sent its function so by its own parent, and sends bytes back.
                found = unsafe & {*names} - ({"pickle"} if module == "ropeode.sandbox" else set())
                assert not found, module
            if isinstance(node, ast.keyword) and node.arg == "allow_pickle":
                assert ast.unparse(node.value) == "False", module
            if isinstance(node, ast.Call) and ast.unparse(node.func) == "np.load":
                assert any(each.arg == "allow_pickle" for each in node.keywords), module
            name = getattr(node, "attr", getattr(node, "id", ""))
            if name in {"exec_module", "exec", "eval", "run_path", "load_module"}:
                runs.append(module)
    assert runs == ["ropeode.problems.files"]
