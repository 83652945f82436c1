"""Benchmarks against other packages and against published values, and pages that show them."""

from __future__ import annotations

import importlib
import json
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import jax
import numpy as np
import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture
def against(monkeypatch):
    """The benchmark's modules."""
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    names = ("references", "right_hand_sides", "tables")
    return SimpleNamespace(**{each: importlib.import_module(f"against.{each}") for each in names})


def test_right_hand_sides_of_all_references_are_those_of_the_problems(against):
    for case in against.references.CASES:
        problem = against.references.truth(case).problem
        y = problem.y0.reshape(-1) + 0.25
        with jax.enable_x64(True):
            own = problem.rhs(0.0, y.reshape(problem.y0.shape), problem.args)
        theirs = against.right_hand_sides.plain(problem)(0.0, y)
        np.testing.assert_allclose(theirs, np.ravel(own), rtol=1e-12)


def test_the_page_shows_the_stored_results(against):
    page = (ROOT / "docs/performance/peers.md").read_text()
    stored = json.loads((ROOT / "docs/data/peers.json").read_text())
    for name, table in against.tables.TABLES.items():
        assert table(stored) in page, name


@pytest.mark.slow
def test_a_published_problem_is_certified_in_each_component(tmp_path):
    out = tmp_path / "rows.json"
    run = [sys.executable, "benchmarks/published.py", "--out", out, "--only", "DETEST E2"]
    subprocess.run(run, cwd=ROOT, check=True)
    (row,) = json.loads(out.read_text())
    assert row["error"] < row["bound"] < row["accuracy"] == 1e-9
