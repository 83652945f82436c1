"""Chromium, an empty page in it, axe-core, and a server of files: for tests of pages."""

from __future__ import annotations

import functools
import http.server
import shutil
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")

# Debian's; the one that playwright would download is not needed.
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
# Milliseconds; a busy machine takes its time.
LONGEST = 60_000
AXE = Path(__file__).parents[1] / "tools/node_modules/axe-core/axe.min.js"
# What axe-core finds wrong, with the places.
VIOLATIONS = """async (part) => {
  const { violations } = await axe.run(part ?? document, { resultTypes: ["violations"] });
  return violations.map(({ id, nodes }) => [id, ...nodes.map(({ target }) => target.join(" "))]);
}"""


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


_FILES = http.server.SimpleHTTPRequestHandler


class _Quiet(_FILES):
    # The registry of a machine may have other types, with which browsers run no module.
    extensions_map = _FILES.extensions_map | {".js": "text/javascript"}

    def log_message(self, *_):
        """Nothing."""


@contextmanager
def served(folder: Path) -> Iterator[str]:
    """The address of a folder: browsers refuse some of what a page asks for in files."""
    handler = functools.partial(_Quiet, directory=folder)
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()
