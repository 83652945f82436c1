"""The audit of engines: its judge's pure parts, its exporters, and the pages that show them."""

from __future__ import annotations

import importlib
import re
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


def test_every_engine_has_its_claim_its_pins_and_its_rows(audit):
    rows = {(row["exporter"], row["method"]): row for row in audit.rows()}
    listed = audit.listed()["engine"]
    assert rows.keys() == {(e["exporter"], m["name"]) for e in listed for m in e["methods"]}
    for engine in listed:
        assert engine["claim"], engine["name"]
        assert re.fullmatch(r"https://\S+", engine["source"]), engine["name"]
        environment = ROOT / f"benchmarks/audit/requirements/{engine['environment']}.txt"
        for method in engine["methods"]:
            row = rows[engine["exporter"], method["name"]]
            assert set(row["cases"]) == set(method["runs"])
            assert f"{engine['package']}=={row['version']}" in environment.read_text().split()
