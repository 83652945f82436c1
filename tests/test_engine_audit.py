"""The audit of engines: its judge's pure parts, its exporters, and the pages that show them."""

from __future__ import annotations

import importlib.util
import re
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[1]
AGAIN = "run: cd docs && cog -P -r -I . validation/engines.md howto/engines.md"


@pytest.fixture(scope="module")
def audit():
    sys.path.insert(0, str(ROOT / "docs"))
    try:
        import engine_audit

        yield engine_audit
    finally:
        sys.path.remove(str(ROOT / "docs"))


@pytest.fixture(scope="module")
def judge():
    spec = importlib.util.spec_from_file_location("judge", ROOT / "benchmarks/audit/judge.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("part", ["orders", "limits", "claims", "diagnoses", "left_out"])
def test_page_agrees_with_the_data(audit, part):
    page = (ROOT / "docs/validation/engines.md").read_text()
    assert getattr(audit, part)() in page, AGAIN


def test_howto_shows_the_exporters(audit):
    assert audit.exporters() in (ROOT / "docs/howto/engines.md").read_text(), AGAIN


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


def test_an_order_is_shown_with_its_interval_or_not_at_all(audit):
    found = {"observed": 1.004, "ci95": [0.987, 1.02], "verdict": "converges"}
    assert audit.order_words(found) == "1.00 [0.99, 1.02]"
    for verdict in ("undetermined", "does not converge"):
        nothing = {"observed": None, "ci95": None, "verdict": verdict}
        assert audit.order_words(nothing) == verdict
    assert audit.order_words({**found, "verdict": "does not converge"}) == "does not converge"


@pytest.mark.parametrize(
    ("stable", "fewest"),
    [
        ({1: False, 2: True, 3: False, 4: True, 5: True}, 4),
        ({1: True, 2: True}, 1),
        ({1: True, 2: False}, None),
    ],
)
def test_the_largest_stable_step_has_only_stable_ones_below(judge, stable, fewest):
    assert judge.largest_stable(stable) == fewest


def test_states_of_a_file_that_ends_early_are_not_numbers(judge, tmp_path):
    problem = judge.job_of("springs").given
    start = np.concatenate(
        [problem.quantity(q, problem.y0[None]) for q in problem.quantities], axis=2
    )
    lines = ["t,node,x,y,vx,vy"]
    lines += [",".join(map(repr, [0, i, *row])) for i, row in enumerate(start[0].tolist())]
    (tmp_path / "rope-8.csv").write_text("\n".join([*lines, "1,0,0.0,0.0"]))
    states = judge.states_in(tmp_path / "rope-8.csv", problem)
    np.testing.assert_array_equal(states[0], problem.y0)
    assert np.all(np.isnan(states[1:]))
    (tmp_path / "rope-9.csv").write_text("t,node,x,y,vx,vy\n")
    assert judge.states_in(tmp_path / "rope-9.csv", problem) is None
