"""Labs that run as a user's does, the page's files alone, and one Chromium for each file."""

from __future__ import annotations

import re
import subprocess
import sys

import pytest

from ropeode.laboratory import PAGE
from tests.browser import axe, chromium, needs_chromium, page, served

__all__ = ["axe", "chromium", "needs_chromium", "page"]


@pytest.fixture(scope="module")
def start_lab(needs_chromium):
    """A function that starts a lab as a user does, and returns its address.

    Labs outlive the page of a test, also of one that fails: a page that is left alone asks for its
    lab again, and complains that there is none.
    """
    labs = []

    def start(*arguments):
        command = [sys.executable, "-m", "ropeode", "lab", "--no-browser", *arguments]
        labs.append(subprocess.Popen(command, stdout=subprocess.PIPE, text=True))
        line = labs[-1].stdout.readline()
        found = re.search(r"http://\S+", line)
        assert found, line
        return found[0]

    yield start
    for each in labs:
        each.terminate()
        each.communicate()


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
