"""The command line as a process of its own; `run` calls it in this one."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from ropeode.errors import InputError
from tests.time_limit import HANGS_AFTER_S


def commands(command, path=()):
    """Every command and group below one, by the words that call it."""
    found = {path: command}
    for name, each in getattr(command, "commands", {}).items():
        found |= commands(each, (*path, name))
    return found


@pytest.fixture
def table_job(run, monkeypatch):
    """The job of `ropeode table`, which takes seconds to be computed, and is not."""
    # Not above: this file is also imported where help is shown, which must not import JAX.
    from ropeode.study import TableJob

    def call(*words):
        jobs = []

        def noted(job, *_):
            jobs.append(job)
            raise InputError(["noted"])

        monkeypatch.setattr(TableJob, "run", noted)
        assert run("table", *words).stderr == "ropeode: noted\n"
        return jobs[0]

    return call


@pytest.fixture(scope="session")
def environment(cache):
    """For processes: the variables of this one, with that folder."""
    return {**os.environ, "XDG_CACHE_HOME": cache}


@pytest.fixture
def run_process(environment, tmp_path):
    """Run ropeode in an empty folder as a process, where asked without a package."""

    def call(*arguments, without=None):
        code = (
            f"import sys; sys.modules[{without!r}] = None; sys.argv[1:] = {list(arguments)!r}\n"
            "from ropeode.cli import run_process; run_process()"
        )
        return subprocess.run(
            [sys.executable, "-c", code]
            if without
            else [sys.executable, "-m", "ropeode", *arguments],
            capture_output=True,
            text=True,
            timeout=HANGS_AFTER_S,
            cwd=tmp_path,
            env=environment,
            check=False,
        )

    return call
