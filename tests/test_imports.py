"""Who may import whom, and what an import may cost."""

from __future__ import annotations

import ast
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import ropeode

PACKAGE = Path(ropeode.__file__).parent

# From the ground up; a room imports from the rooms that it names, and from the ground floor.
GROUND = {"errors", "precision", "progress", "validation", "files", "threads"}
ALLOWED = {
    "problems": set(),
    "norms": {"problems"},
    "steppers": {"problems"},
    "simulation": {"problems", "steppers"},
    "references": {"problems", "norms"},
    "analysis": {"problems", "norms", "steppers", "simulation", "references"},
    "study": {"problems", "norms", "steppers", "simulation", "references", "analysis"},
    "terminal": {"references"},
    "case_studies": {
        "problems",
        "steppers",
        "simulation",
        "analysis",
        "study",
        "references",
        "render",
        "terminal",
    },
    "sweep": {"problems", "norms", "steppers", "simulation", "references", "analysis", "study"},
    "checking": {
        "problems",
        "norms",
        "steppers",
        "simulation",
        "references",
        "analysis",
        "study",
    },
    "render": {
        "problems",
        "norms",
        "steppers",
        "references",
        "analysis",
        "study",
        "checking",
        "sweep",
    },
    "cli": {
        "terminal",
        "problems",
        "references",
        "study",
        "sweep",
        "case_studies",
        "checking",
        "render",
    },
    "pytest_plugin": {"checking", "render"},
    "__main__": {"cli"},
}
MODULES = sorted(PACKAGE.rglob("*.py"))


def room_of(module: str) -> str:
    parts = module.split(".")
    return parts[1] if len(parts) > 1 else ""


def imports_of(path: Path) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path} has a relative import"
            found.add(node.module or "")
    return {name for name in found if name.split(".")[0] == "ropeode"}


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_rooms_import_downwards_only(path):
    room = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
    if room == "__init__":
        return
    for module in imports_of(path):
        other = room_of(module)
        if other == room or other in GROUND:
            continue
        assert room not in GROUND or room == other, f"{path} imports {module}"
        assert other in ALLOWED[room], f"{path} imports {module}"


def test_every_room_is_listed():
    rooms = {path.relative_to(PACKAGE).parts[0].removesuffix(".py") for path in MODULES}
    assert rooms == {*ALLOWED, *GROUND, "__init__"}


def run_python(code: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60
    )
    return done.stdout


@pytest.mark.parametrize("module", ["ropeode", "ropeode.cli.main", "ropeode.pytest_plugin"])
def test_import_is_light(module):
    heavy = "{'jax', 'diffrax', 'scipy', 'matplotlib', 'numpy', 'pydantic', 'rich'}"
    if module == "ropeode.cli.main":
        heavy = "{'jax', 'diffrax', 'scipy', 'matplotlib'}"
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


def test_version():
    project = tomllib.loads((PACKAGE.parent / "pyproject.toml").read_text())["project"]
    assert ropeode.__version__ == project["version"]


def test_stepper_classes_are_there_after_importing_the_package():
    code = (
        "import ropeode\n"
        "print(ropeode.steppers.StormerVerlet(start='rest').label)\n"
        "from ropeode.steppers import RungeKutta4\n"
        "print(ropeode.steppers.RungeKutta4 is RungeKutta4)"
    )
    assert run_python(code) == "stormer-verlet:start=rest\nTrue\n"


def test_float64_is_not_switched_on_for_the_caller():
    code = (
        "import ropeode, jax, jax.numpy as jnp, numpy as np\n"
        "p = ropeode.Rope(num_nodes=3).problem(frames=2)\n"
        "run = ropeode.simulate(p, 'rk4', 8)\n"
        "known = ropeode.reference(p)\n"
        "assert run.states.dtype == known.states.dtype == np.float64\n"
        "assert type(run.states) is np.ndarray and type(known.states) is np.ndarray\n"
        "print(jnp.ones(1).dtype, jax.config.jax_enable_x64)"
    )
    assert run_python(code) == "float32 False\n"


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_every_module_says_what_it_is(path):
    assert ast.get_docstring(ast.parse(path.read_text()))
