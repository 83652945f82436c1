"""What `pip install` puts on a machine."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
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
    environment = {**os.environ, "PYTHONPATH": str(installed)}
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=installed.parent, env=environment, capture_output=True)
    file, shown = done.stdout.decode().splitlines()
    assert Path(file).is_relative_to(installed)
    assert shown.startswith("<Reference: Kepler, 90 frames;")
