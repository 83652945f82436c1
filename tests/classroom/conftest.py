"""Commands of a class, run as processes, and what they write."""

from __future__ import annotations

import csv
import os
import subprocess
import sys

import pytest

from tests.time_limit import HANGS_AFTER_S


@pytest.fixture
def ropeode(cache, tmp_path):
    """Run the command as a process in an empty folder."""

    def call(*words):
        return subprocess.run(
            [sys.executable, "-m", "ropeode", *words],
            capture_output=True,
            text=True,
            timeout=HANGS_AFTER_S,
            cwd=tmp_path,
            env={**os.environ, "XDG_CACHE_HOME": cache},
            check=False,
        )

    return call


@pytest.fixture
def rows_in():
    """The rows of a grade book in a folder, by the names of submissions."""

    def read(folder):
        with open(folder / "gradebook.csv") as file:
            return {row["submission"]: row for row in csv.DictReader(file)}

    return read
