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


@pytest.mark.slow
def test_steps_and_ropes_without_other_packages(against):
    small = against.stepping.Size((3,), (("semi-implicit-euler", 0.0),), 48, 24, rounds=3)
    few = against.many.Size((2,), 32, 16, ("semi-implicit-euler",), rounds=1)
    with jax.enable_x64(True):
        (one,) = against.stepping.same_steps(small, against.nobody, None)
    (many,) = against.many.run(few, against.nobody, None)
    assert [row["by"] for row in one["rows"]] == ["ropeode", "lax.scan", "diffrax", "NumPy"]
    assert all(len(row["values"]) == 3 and min(row["values"]) > 0 for row in one["rows"])
    assert [row["by"] for row in many["rows"]] == ["ropeode", "lax.scan", "NumPy"]


def test_what_ends_elsewhere_is_not_timed(against):
    problem = Rope(num_nodes=3).problem(1)
    step = against.stepping
    known, *_ = step.works(problem, "semi-implicit-euler", against.nobody, None)
    wrong = step.Work("liar", "a step too few", lambda steps: known.run(steps - 1))
    with pytest.raises(SystemExit, match="a rope: liar .* away from ropeode"):
        step.check("a rope", [known, known, wrong], 32)


@pytest.mark.slow
def test_references_reach_the_true_error(against):
    """At the loosest tolerance: the next looser one of the ladder does not reach it."""
    module = against.references
    kepler = module.Case("kepler", 30, "Kepler")
    size = module.Size((kepler,), (1e-5,), (1e-5,), rounds=1)
    known = module.truth(kepler)
    with jax.enable_x64(True):
        rows = module.solved(kepler, size, against.nobody)[0]["rows"]
        (primary,) = module.families(known.problem, stiff=False, peers=against.nobody)[0]
        looser = module.TOLERANCES[module.TOLERANCES.index(rows[0]["tolerance"]) - 1]
        assert known.error(primary(None).solve(looser)) > 1e-5
    found = {row["how"]: row for row in rows}
    assert found.keys() >= {"primary: diffrax Dopri8", module.CERTIFIED, "DOP853"}
    assert all(row["true_error"] <= 1e-5 for row in rows)
    assert all(row.get("evaluations", 1) > 0 for row in rows)
    assert found[module.CERTIFIED]["true_error"] <= found[module.CERTIFIED]["bound"]


def test_right_hand_sides_of_all_references_are_those_of_the_problems(against):
    for case in against.references.CASES:
        problem = against.references.truth(case).problem
        y = problem.y0.reshape(-1) + 0.25
        with jax.enable_x64(True):
            own = problem.rhs(0.0, y.reshape(problem.y0.shape), problem.args)
        theirs = against.right_hand_sides.plain(problem)(0.0, y)
        np.testing.assert_allclose(theirs, np.ravel(own), rtol=1e-12)


def test_a_loss_needs_its_reason(against, monkeypatch):
    """It is one against ropeode in the same round: the second was slow for both."""
    rows = [
        {"by": "ropeode", "how": "a", "values": [2.0, 20.0]},
        {"by": "them", "how": "b", "values": [1.0, 10.0]},
    ]
    lost = {"cases": [{"part": "stepping", "case": "a rope", "unit": "ns", "rows": rows}]}
    with pytest.raises(SystemExit, match="does not say why"):
        against.tables.losses(lost)
    monkeypatch.setitem(against.reasons.REASONS, ("stepping", "them"), "They run downhill.")
    told = against.tables.losses(lost)
    assert "faster in 1 of 1 cases, 0.500 of ropeode's time. They run downhill." in told


def test_the_page_shows_the_stored_results(against):
    page = (ROOT / "docs/performance/peers.md").read_text()
    stored = json.loads((ROOT / "docs/data/peers.json").read_text())
    for name, table in against.tables.TABLES.items():
        assert table(stored) in page, name
