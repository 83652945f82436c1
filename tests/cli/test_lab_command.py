"""`ropeode lab` as a process: what it prints, how it ends, and what it leaves."""

from __future__ import annotations

import re
import signal
import urllib.request

import psutil
import pytest

from tests.time_limit import HANGS_AFTER_S


@pytest.fixture
def opened(started):
    """A function that opens the lab and returns its process and its address."""

    def call(*arguments):
        process = started("lab", "--no-browser", *arguments)
        line = process.stdout.readline()
        found = re.search(r"The lab is at (http://127\.0\.0\.1:\d+/\?token=\S+)", line)
        return process, found and found[1]

    return call


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_it_closes_with_one_line_and_leaves_no_process(how, opened):
    process, address = opened()
    page = urllib.request.urlopen(address, timeout=HANGS_AFTER_S).read().decode()
    assert "lab" in page
    children = psutil.Process(process.pid).children(recursive=True)
    assert children
    process.send_signal(how)
    out, err = process.stdout.read(), process.stderr.read()
    if how == signal.SIGINT:
        assert (process.wait(HANGS_AFTER_S), err) == (0, "")
        assert out.splitlines() == ["Ctrl-C closes it.", "The lab is closed."]
    assert not psutil.wait_procs(children, timeout=10)[1]


@pytest.mark.slow
def test_a_wrong_problem_ends_it(opened):
    process, address = opened("--problem", "ropes")
    assert address is None
    out, err = process.communicate(timeout=HANGS_AFTER_S)
    assert (process.returncode, out) == (2, "")
    assert err.startswith("ropeode: problem: 'ropes' given")
    assert len(err.splitlines()) == 1
