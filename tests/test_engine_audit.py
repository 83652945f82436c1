"""The audit of engines: its judge's pure parts, its exporters, and the pages that show them."""

from __future__ import annotations

import importlib
import re
import runpy
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from tests.checking.trajectory_writing import csv_lines, node_values

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def audit():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "docs"))
        yield importlib.import_module("engine_audit")


@pytest.fixture(scope="module")
def judge():
    return SimpleNamespace(**runpy.run_path(str(ROOT / "benchmarks/audit/judge.py")))


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


def test_the_largest_stable_step_has_only_stable_ones_below(judge):
    assert judge.largest_stable({1: False, 2: True, 3: False, 4: True, 5: True}) == 4
    assert judge.largest_stable({1: True, 2: True}) == 1
    assert judge.largest_stable({1: True, 2: False}) is None


def test_states_of_a_file_that_ends_early_are_not_numbers(judge, tmp_path):
    problem = judge.job_of("springs").given
    lines = csv_lines([0], node_values(problem, problem.y0[None]))
    (tmp_path / "rope-8.csv").write_text("\n".join([*lines, "1,0,0.0,0.0"]))
    states = judge.states_in(tmp_path / "rope-8.csv", problem)
    np.testing.assert_array_equal(states[0], problem.y0)
    assert np.all(np.isnan(states[1:]))
    (tmp_path / "rope-9.csv").write_text(f"{lines[0]}\n")
    assert judge.states_in(tmp_path / "rope-9.csv", problem) is None
