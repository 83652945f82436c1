"""The site that `make site` built."""

from __future__ import annotations

import functools
import http.server
import threading
from pathlib import Path

import pytest

from tests.browser import axe, chromium, needs_chromium, page
from tests.site.pages import Page, read_page

__all__ = ["axe", "chromium", "needs_chromium", "page"]

SITE = Path(__file__).parents[2] / "build/site"


@pytest.fixture(scope="session")
def site() -> Path:
    """Its folder."""
    if not (SITE / "index.html").exists():
        pytest.skip("there is no site: make site builds and tests it")
    return SITE


@pytest.fixture(scope="session")
def pages(site) -> dict[str, Page]:
    """Its pages by their paths; not the files that the lab wrote."""
    found = (path for path in site.rglob("*.html") if not {"lab", "_static"} & {*path.parts})
    return {str(path.relative_to(site)): read_page(path, site) for path in sorted(found)}


@pytest.fixture(scope="session")
def address(site):
    """Where it is served: browsers refuse some of what a page asks for in files."""

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *_):
            pass

    server = http.server.ThreadingHTTPServer(
        ("127.0.0.1", 0), functools.partial(Quiet, directory=site)
    )
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    server.server_close()
