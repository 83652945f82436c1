"""The command line as a whole process."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest


@pytest.fixture(scope="session")
def environment(tmp_path_factory):
    """Everything that a command caches goes to a folder of the test's own."""
    return {**os.environ, "XDG_CACHE_HOME": str(tmp_path_factory.mktemp("cache"))}


@pytest.fixture
def run(environment, tmp_path):
    """Run ropeode in an empty folder, where wished without a package that it might import."""

    def call(*arguments, without=None):
        code = (
            f"import sys; sys.modules[{without!r}] = None\n"
            f"from ropeode.cli.main import main; main({list(arguments)!r})"
        )
        return subprocess.run(
            [sys.executable, "-c", code]
            if without
            else [sys.executable, "-m", "ropeode", *arguments],
            capture_output=True,
            text=True,
            timeout=180,
            cwd=tmp_path,
            env=environment,
            check=False,
        )

    return call
