"""One lab for all tests of the page that a process runs, and one Chromium for each file."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from tests.browser import axe, chromium, needs_chromium, page
from tests.laboratory.browser.recorded_page import served

__all__ = ["axe", "chromium", "needs_chromium", "page"]


@contextmanager
def running_lab(*arguments: str) -> Iterator[str]:
    """The address of a lab that runs as a user's does."""
    command = [sys.executable, "-m", "ropeode", "lab", "--no-browser", *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as process:
        assert process.stdout is not None
        said = b""
        while not (found := re.search(rb"http://\S+", said)):
            line = process.stdout.readline()
            assert line, said.decode()
            said += line
        try:
            yield found.group().decode()
        finally:
            process.terminate()


@pytest.fixture(scope="session")
def lab(needs_chromium) -> Iterator[str]:
    """A lab for all tests that ask it for no file."""
    with running_lab() as address:
        yield address


@pytest.fixture(scope="session")
def address():
    with served() as url:
        yield url


@pytest.fixture
def alone(page):
    """The page as one without Python."""
    page.route(
        re.compile(r"/(\?.*)?(#.*)?$"),
        lambda route: route.fulfill(
            response=(found := route.fetch()),
            body=found.text().replace('<meta name="lab-socket" content="socket">', ""),
        ),
    )
    return page
