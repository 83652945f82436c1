"""One lab for all tests of the page that a process runs, and one Chromium for each file."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.laboratory.browser.recorded_page import served

sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")

# Debian's; the one that playwright would download is not needed.
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
# Milliseconds; a busy machine takes its time.
LONGEST = 60_000
AXE = Path(__file__).parents[3] / "tools/node_modules/axe-core/axe.min.js"


@pytest.fixture(scope="session")
def needs_chromium() -> None:
    if CHROMIUM is None:
        pytest.skip("there is no Chromium on this machine")


# Not for all files: other tests of this process run loops of asyncio, which playwright's forbids.
@pytest.fixture(scope="module")
def chromium(needs_chromium) -> Iterator[sync_api.Browser]:
    with sync_api.sync_playwright() as playwright:
        sync_api.expect.set_options(timeout=LONGEST)
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield browser
        browser.close()


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


@pytest.fixture
def page(chromium) -> Iterator[sync_api.Page]:
    """An empty page; the test fails if one of its scripts raises or loads what it may not."""
    context = chromium.new_context(locale="en-GB", viewport={"width": 1280, "height": 800})
    complaints = []
    context.on("weberror", lambda each: complaints.append(str(each.error)))
    opened = context.new_page()
    opened.on("console", lambda each: each.type == "error" and complaints.append(each.text))
    opened.set_default_timeout(LONGEST)
    yield opened
    context.close()
    assert not complaints, complaints


@pytest.fixture(scope="session")
def axe() -> str:
    """The script of axe-core, which looks for faults of accessibility."""
    if not AXE.exists():
        pytest.skip("axe-core is not installed: make check-page")
    return AXE.read_text()


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
