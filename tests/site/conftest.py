"""The site that `make site` built."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.browser import axe, chromium, needs_chromium, page, served
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
    with served(site) as url:
        yield url
