"""The command line as a process of its own; `run` calls it in this one."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import pytest

from ropeode.errors import InputError
from tests.time_limit import HANGS_AFTER_S


def interrupted(process):
    """What a process still says after Ctrl-C, and its exit code."""
    process.send_signal(signal.SIGINT)
    return (*process.communicate(timeout=HANGS_AFTER_S), process.returncode)


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
def started(environment, tmp_path):
    """A function that starts ropeode in an empty folder; what still runs in the end is killed."""
    processes = []

    def call(*arguments):
        process = subprocess.Popen(
            [sys.executable, "-m", "ropeode", *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=tmp_path,
            env={**environment, "PYTHONUNBUFFERED": "1"},
        )
        processes.append(process)
        return process

    yield call
    for process in processes:
        process.kill()
        process.communicate()


@pytest.fixture
def run_process(started):
    """Run ropeode in an empty folder as a process."""

    def call(*arguments):
        process = started(*arguments)
        said = process.communicate(timeout=HANGS_AFTER_S)
        return subprocess.CompletedProcess(arguments, process.returncode, *said)

    return call
