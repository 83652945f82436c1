"""`--no-code`: whatever a command takes, no file of a user's is run."""

from __future__ import annotations

import pytest

from ropeode.cli import cli
from ropeode.files import NO_CODE
from tests.cli.conftest import commands

COMMANDS = {" ".join(path): each for path, each in commands(cli).items()}
EVIL = "from pathlib import Path\nPath('ran').touch()\ndef named(*_, **__): return 1\n"
SWEEP = 'steppers = ["evil.py:named"]\nsteps_per_frame = [16, 32, 64]\n[grid]\ndamping = [0.1]\n'
# Where code may be named: a parameter, and words that name some there.
PLACES = {
    "problem": ["--problem", "evil.py:named"],
    "steppers": ["--steppers", "evil.py:named"],
    "step": ["evil.py:named"],
    "spec": ["evil.toml"],
    "files": ["evil.toml"],
}
# Words that a command needs besides.
BESIDE = {
    "explain problem": ["rk4"],
    "grade problem": ["a.csv"],
    "grade files": ["--problem", "evil.toml"],
    "reference verify problem": ["kepler"],
    "reference compute spec": ["-o", "a.nc"],
    "reference compute problem": ["-o", "a.nc"],
    "sweep run spec": ["-o", "out"],
}
CASES = [
    (name, param.name)
    for name, each in COMMANDS.items()
    for param in each.params
    if param.name in PLACES
]


@pytest.mark.parametrize(("name", "place"), CASES)
def test_no_file_is_run(name, place, run, tmp_path, monkeypatch):
    monkeypatch.setenv(NO_CODE, "")
    (tmp_path / "evil.py").write_text(EVIL)
    (tmp_path / "evil.toml").write_text(
        SWEEP if name == "sweep run" else 'problem = "evil.py:named"\n'
    )
    words = [*name.split(), *PLACES[place], *BESIDE.get(f"{name} {place}", [])]
    done = run(*words, "--no-code")
    assert not (tmp_path / "ran").exists()
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert "evil.py' given; allowed: no Python file, with --no-code" in line


@pytest.mark.parametrize("value", ["1", ""])
def test_the_variable_does_the_same_and_without_either_it_is_run(value, run, tmp_path, monkeypatch):
    (tmp_path / "evil.py").write_text(EVIL)
    monkeypatch.setenv(NO_CODE, value)
    assert run("table", "--steppers", "evil.py:named").returncode == 2
    assert (tmp_path / "ran").exists() == (not value)
