"""`ropeode lab` as a process: what it prints, how it ends, and what it leaves."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import urllib.request

import psutil
import pytest

from tests.time_limit import HANGS_AFTER_S


@pytest.fixture
def opened(environment, tmp_path):
    """A function that opens the lab and returns its process and its address."""
    started = []

    def call(*arguments):
        process = subprocess.Popen(
            [sys.executable, "-m", "ropeode", "lab", "--no-browser", *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=tmp_path,
            env={**environment, "PYTHONUNBUFFERED": "1"},
        )
        started.append(process)
        line = process.stdout.readline()
        found = re.search(r"The lab is at (http://127\.0\.0\.1:\d+/\?token=\S+)", line)
        return process, found and found[1]

    yield call
    for process in started:
        process.kill()
        process.communicate()


def test_ctrl_c_closes_it_with_one_line_and_leaves_no_process(opened):
    process, address = opened()
    page = urllib.request.urlopen(address, timeout=HANGS_AFTER_S).read().decode()
    assert "lab" in page
    children = psutil.Process(process.pid).children(recursive=True)
    assert children
    process.send_signal(signal.SIGINT)
    out, err = process.stdout.read(), process.stderr.read()
    assert (process.wait(HANGS_AFTER_S), err) == (0, "")
    assert out.splitlines() == ["Ctrl-C closes it.", "The lab is closed."]
    assert not psutil.wait_procs(children, timeout=10)[1]


def test_the_worker_ends_when_the_server_is_killed(opened):
    process, address = opened()
    urllib.request.urlopen(address, timeout=HANGS_AFTER_S).read()
    children = psutil.Process(process.pid).children(recursive=True)
    assert children
    process.kill()
    assert not psutil.wait_procs(children, timeout=10)[1]


@pytest.mark.slow
def test_a_wrong_problem_ends_it(opened):
    process, address = opened("--problem", "ropes")
    assert address is None
    out, err = process.communicate(timeout=HANGS_AFTER_S)
    assert (process.returncode, out) == (2, "")
    assert err.startswith("ropeode: problem: 'ropes' given")
    assert len(err.splitlines()) == 1


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["steps.txt"], "allowed: FILE.py or FILE.py:NAME"),
        (["none.py:step"], "none.py' given; allowed: a file that can be read"),
        (["rk4"], "those of ropeode are in the lab in any case"),
        (["--port", "x"], "port: 'x' given; allowed: a whole number"),
        (["--port", "99999"], "port: 99999 given"),
    ],
)
def test_bad_input_is_one_line(run, words, message):
    done = run("lab", "--no-browser", *words)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert re.search(message, line)


def test_a_package_that_is_missing_is_named_with_the_extra_that_has_it(run_process):
    done = run_process("lab", "--no-browser", without="uvicorn")
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert "pip install '.[lab]'" in line


def test_the_server_imports_no_jax_and_no_numpy():
    modules = "ropeode.cli.lab, ropeode.laboratory.server, ropeode.laboratory.dispatcher"
    code = f"import sys, {modules}; print({{'jax', 'numpy', 'scipy'}} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"
