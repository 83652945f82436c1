"""What `pip install` puts on a machine."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TUTORIAL = ROOT / "docs/tutorials/verlet.md"
PROGRAM = """\
from ropeode import Rope, accuracy_table
table = accuracy_table(Rope(num_nodes=4).problem(frames=3))
reveal_type([each.order.observed for each in table.orders])
table.order
"""

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """A folder with what is in the wheel, as `pip install` unpacks it."""
    folder = tmp_path_factory.mktemp("wheel")
    build = ["-m", "pip", "wheel", "--no-deps", "--no-build-isolation", "--no-index", "-w", folder]
    subprocess.run(
        [sys.executable, *build, "--disable-pip-version-check", ROOT],
        check=True,
        capture_output=True,
    )
    (wheel,) = folder.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder / "site")
    return folder / "site"


def run(folder, *arguments, cwd=None, **environment):
    """Run Python beside the installed package or in a folder; it finds that package first."""
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=cwd or folder.parent,
        env={**os.environ, "PYTHONPATH": str(folder), **environment},
        capture_output=True,
        text=True,
        check=False,
    )


def test_it_holds_all_files_of_the_package_and_nothing_else(installed):
    def files(top):
        paths = (path for path in top.rglob("*") if path.is_file())
        return {str(path.relative_to(top)) for path in paths if path.suffix != ".pyc"}

    package = files(ROOT / "ropeode")
    assert {"py.typed", "__init__.pyi"} <= package
    library = {f"stored_library/{name}" for name in files(ROOT / "reference")}
    assert files(installed / "ropeode") == package | library
    (info,) = {path.name for path in installed.iterdir()} - {"ropeode"}
    assert info.endswith(".dist-info")
    assert (installed / info / "licenses" / "LICENSE").exists()


def test_it_finds_its_stored_library(installed):
    code = "import ropeode; print(ropeode.__file__); print(ropeode.load('kepler'))"
    file, shown = run(installed, "-c", code).stdout.splitlines()
    assert Path(file).is_relative_to(installed)
    assert shown.startswith("<Reference: Kepler, 90 frames;")


def test_a_reader_walks_through_the_tutorial(installed, tmp_path):
    """They copy its blocks into an empty folder, and see what it says that they see."""
    code = "\n".join(re.findall(r"^```python\n(.*?)^```", TUTORIAL.read_text(), re.M | re.S))
    (tmp_path / "verlet.py").write_text(code)
    walked = run(installed, "verlet.py", cwd=tmp_path, PYTHONWARNINGS="error")
    assert walked.stderr == ""
    promised = re.findall(r"^print\(.*\)  # (.*)$", code, re.M)
    assert walked.stdout.splitlines() == promised
    assert len(promised) >= 6
    assert [path.name for path in tmp_path.iterdir()] == ["verlet.py"]


def test_pyright_finds_its_types(installed):
    program = installed.parent / "program.py"
    program.write_text(PROGRAM)
    found = run(installed, "-m", "pyright", "--outputjson", str(program))
    said = [each["message"] for each in json.loads(found.stdout)["generalDiagnostics"]]
    revealed, wrong = (message for message in said if "is not accessed" not in message)
    assert revealed.endswith('is "list[float | None]"')
    assert 'Cannot access attribute "order" for class "AccuracyTable"' in wrong
