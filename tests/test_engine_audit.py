"""The audit of engines: the pages that show its data."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def audit():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "docs"))
        yield importlib.import_module("engine_audit")


@pytest.mark.parametrize(
    ("page", "part"),
    [
        *(("validation", part) for part in ("orders", "limits", "claims", "diagnoses", "left_out")),
        ("howto", "exporters"),
    ],
)
def test_pages_agree_with_the_data(audit, page, part):
    again = "run: cd docs && cog -P -r -I . validation/engines.md howto/engines.md"
    assert getattr(audit, part)() in (ROOT / f"docs/{page}/engines.md").read_text(), again
