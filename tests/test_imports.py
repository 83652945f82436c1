"""Who may import whom, and what an import may cost."""

from __future__ import annotations

import ast
import graphlib
import importlib
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import ropeode
from docs import rooms

PACKAGE = Path(ropeode.__file__).parent
ROOT = PACKAGE.parent

# Modules that tests and other rooms may import: mathematics and data that read like a textbook.
# The module itself is its face.
LEAVES = {
    f"ropeode.{room}.{module}"
    for room, modules in {
        "checking": "diagnosis.methods energy_drift richardson trajectories.coarse_steps "
        "written_precision",
        "laboratory": "messages scenes",
        "problems": "links nested_jaxprs rope",
        "references": "defect extended.taylor extended.translate solvers.dop853 solvers.rounding",
        "render": "plots.overlaps",
        "study": "error_constant pareto",
        "tableaus": "rooted_trees stages",
        "theory": "terms",
    }.items()
    for module in modules.split()
}


def below(room: str) -> set[str]:
    """The rooms and files that a room imports, be it through others."""
    found, new, imports = set(), {room}, rooms.imports()
    while new:
        new = {other for each in new for other in imports[each]} - found
        found |= new
    return found


def test_rooms_import_downwards_only():
    """As the picture shows: a circle has none, and no new import between rooms goes unseen."""
    shown = (ROOT / "CONTRIBUTING.md").read_text()
    assert rooms.picture() in shown, "run: cd docs && cog -P -r -I . ../CONTRIBUTING.md"
    ground = rooms.ground_floor(rooms.imports())
    assert below("references") - ground == {"problems", "norms"}


def test_no_file_imports_itself_through_others():
    graphlib.TopologicalSorter(rooms.module_imports(rooms.trees())).prepare()


def imported(tree: ast.AST) -> Iterator[tuple[str, str]]:
    """The names that a file imports from modules of the package."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and f"{node.module}.".startswith("ropeode."):
            yield from ((str(node.module), each.name) for each in node.names)


def is_behind_a_face(module: str, name: str) -> bool:
    room, *inside = module.split(".")[1:] or ["no room"]
    if not (PACKAGE / room).is_dir() or {module, f"{module}.{name}"} & LEAVES:
        return False
    # A module with the name of its function would hide it in the face.
    if inside:
        return name != inside[-1]
    return name not in getattr(importlib.import_module(module), "__all__", ())


def test_rooms_and_tests_import_faces_only():
    """So that what stands behind the face of a room can be moved."""
    tests = {str(path): ast.parse(path.read_text()) for path in ROOT.glob("tests/**/*.py")}
    offences = [
        f"{file}: {module}.{name}"
        for file, tree in {**rooms.trees(), **tests}.items()
        for module, name in imported(tree)
        if is_behind_a_face(module, name)
        and not f"{module}.{name}".startswith(f"ropeode.{rooms.room_of(file)}.")
    ]
    assert not offences, "\n".join(offences)


def test_what_stands_beside_the_package_imports_what_exists():
    missing = [
        f"{path}: {module}.{name}"
        for folder in ("docs", "benchmarks", "reference")
        for path in (ROOT / folder).rglob("*.py")
        for module, name in imported(ast.parse(path.read_text()))
        if not hasattr(importlib.import_module(module), name)
        and f"{module}.{name}" not in rooms.trees()
    ]
    assert not missing, "\n".join(missing)


@pytest.mark.parametrize(
    ("modules", "heavy"),
    [
        # JAX and SciPy import NumPy.
        *(
            (module, {"numpy", "pydantic", "rich"})
            for module in ("ropeode", "ropeode.pytest_plugin")
        ),
        ("ropeode.cli.lab, ropeode.laboratory.server, ropeode.laboratory.dispatcher", {"numpy"}),
        (
            # A table.
            "ropeode.study.spec, ropeode.render.formats, ropeode.references.kept",
            {"diffrax", "equinox", "scipy", "matplotlib", "h5py", "heyoka", "xarray"},
        ),
    ],
)
def test_import_is_light(modules, heavy):
    code = f"import sys, {modules}; print({heavy} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"


def test_public_names_are_those_that_type_checkers_see():
    stub = ast.parse((PACKAGE / "__init__.pyi").read_text())
    # Without `as`, an import in a stub is private to it.
    exported = {
        alias.asname
        for node in stub.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert exported == set(ropeode.__all__)
    # Commands have no use in Python.
    folders = {each.parent.name for each in PACKAGE.glob("*/__init__.py")}
    assert folders - {"classroom", "cli", "terminal"} < exported
    with pytest.raises(AttributeError, match="nonsense"):
        ropeode.nonsense  # noqa: B018


@pytest.mark.parametrize(
    "folder", sorted(each.parent for each in PACKAGE.rglob("__init__.pyi")), ids=lambda f: f.name
)
def test_what_a_face_lists_exists(folder):
    face = importlib.import_module(".".join(folder.relative_to(ROOT).parts))
    for name in face.__all__:
        getattr(face, name)
        # A module of the same name would hide it.
        assert face is ropeode or not (folder / f"{name}.py").exists(), name


def test_float64_is_not_switched_on_for_the_caller(small_rope):
    """By no import, since this process has imported all that is tested, and by no function."""
    run = ropeode.simulate(small_rope, "rk4", 8)
    known = ropeode.reference(small_rope)
    for states in (run.states, known.states):
        assert states.dtype == np.float64
        assert type(states) is np.ndarray
    assert jnp.ones(1).dtype == jnp.float32
    assert not jax.config.jax_enable_x64


def test_one_line_runs_code_and_no_line_unpickles_a_file():
    """Everything that could run what is in a file, wherever it stands in the package."""
    unsafe = {"pickle", "marshal", "shelve", "yaml", "runpy", "dill"}
    runs = {"exec_module", "exec", "eval", "run_path", "load_module"}
    found = []
    for module, tree in rooms.trees().items():
        for node in ast.walk(tree):
            if isinstance(node, ast.keyword) and node.arg == "allow_pickle":
                assert ast.unparse(node.value) == "False", module
            names = {getattr(node, each, None) for each in ("id", "attr", "name", "module")}
            found += [(module, name) for name in names & (unsafe | runs)]
    # A child is sent its function so by its own parent, and sends bytes back.
    found = [each for each in found if each != ("ropeode.sandbox", "pickle")]
    # The line, and what it stands for in a module that Python imports.
    assert sorted(found) == [("ropeode.problems.files", each) for each in ("exec", "exec_module")]
