"""Labs that run as a user's does, the page's files alone, and one Chromium for each file."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager

import pytest

from ropeode.laboratory import PAGE
from tests.browser import axe, chromium, needs_chromium, page, served

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


@pytest.fixture(scope="module")
def start_lab(needs_chromium) -> Iterator[Callable[..., str]]:
    """A function that starts a lab and returns its address.

    Labs outlive the page of a test, also of one that fails: a page that is left alone asks for its
    lab again, and complains that there is none.
    """
    with ExitStack() as labs:
        yield lambda *arguments: labs.enter_context(running_lab(*arguments))


@pytest.fixture(scope="session")
def address():
    with served(PAGE) as url:
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
