"""The benchmark against other packages: it refuses to compare what is not the same."""

from __future__ import annotations

import importlib
import json
from pathlib import Path
from types import SimpleNamespace

import jax
import numpy as np
import pytest

from ropeode import Rope

ROOT = Path(__file__).parents[1]


@pytest.fixture
def against(monkeypatch):
    """The benchmark's modules, and nobody there but what ropeode itself needs."""
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    names = ("many", "reasons", "references", "right_hand_sides", "stepping", "tables", "timing")
    modules = {name: importlib.import_module(f"against.{name}") for name in names}

    class Nobody(modules["timing"].Peers):
        def get(self, module, package):
            self.leave_out(package, "not asked")

    return SimpleNamespace(**modules, nobody=Nobody())


def test_what_ends_elsewhere_is_not_timed(against):
    problem = Rope(num_nodes=3).problem(1)
    step = against.stepping
    known, *_ = step.works(problem, "semi-implicit-euler", against.nobody, None)
    wrong = step.Work("liar", "a step too few", lambda steps: known.run(steps - 1))
    with pytest.raises(SystemExit, match="a rope: liar .* away from ropeode"):
        step.check("a rope", [known, known, wrong], 32)


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
