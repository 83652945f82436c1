"""References in the cache folder: found again where all is the same, and nowhere else."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from ropeode.problems import Problem
from ropeode.references.compute import reference_for
from ropeode.references.files.encoding import texts_of
from ropeode.references.files.library import find
from ropeode.references.files.store import load_reference
from ropeode.references.options import ReferenceOptions

OPTIONS = ReferenceOptions()


@pytest.fixture(scope="module")
def stored():
    """A reference that nobody needs to compute."""
    return load_reference(find("kepler"))


@pytest.fixture
def folder(cache_folder):
    return cache_folder / "references"


@pytest.fixture
def solve(stored, monkeypatch):
    """`reference_for`, whose solver returns that reference and counts its calls."""
    calls = []

    def solved(problem, options, progress):
        calls.append(options)
        return stored

    monkeypatch.setattr("ropeode.references.compute._reference", solved)
    return lambda problem, options=OPTIONS: (reference_for(problem, options), len(calls))


def test_a_kept_reference_is_the_one_that_was_computed(stored, solve, folder):
    assert solve(stored.problem) == (stored, 1)
    again, calls = solve(stored.problem)
    assert calls == 1
    assert again is not stored
    assert again.states.tobytes() == stored.states.tobytes()
    assert texts_of(again) == texts_of(stored)
    for name, bound in stored.certificate.bounds.items():
        np.testing.assert_array_equal(again.certificate.bounds[name], bound)


def test_a_damaged_file_is_computed_anew(stored, solve, folder):
    solve(stored.problem)
    (path,) = folder.iterdir()
    whole = path.read_bytes()
    for count, damage in enumerate((b"", b"x\n", whole[:-1], whole[:-9] + b"9" + whole[-8:]), 2):
        path.write_bytes(damage)
        assert solve(stored.problem) == (stored, count)
        assert path.read_bytes() == whole


def test_other_settings_have_another(stored, solve, folder):
    problem = stored.problem
    solve(problem)
    assert solve(problem, ReferenceOptions(accuracy=1e-6))[1] == 2
    assert solve(problem, ReferenceOptions(time_limit=1.0))[1] == 3
    assert solve(problem.changed(y0=problem.y0 * 2.0))[1] == 4


def test_the_equation_counts(stored, solve, folder):
    """Parameters of the library are no evidence."""
    solve(stored.problem)
    rhs = stored.problem.rhs
    changed = stored.problem.changed(rhs=lambda t, y, args: 1.001 * rhs(t, y, args))
    assert solve(changed)[1] == 2
    assert solve(changed)[1] == 3


@pytest.mark.parametrize(("last", "kept"), [(1.0, True), (np.inf, False)])
def test_a_horizon_is_kept_unless_a_run_ended_before_it(stored, folder, monkeypatch, last, kept):
    """A run that the time limit ended is not compared with the reference any more."""
    claims = stored.certificate
    bounds = {name: np.append(bound[:-1], last) for name, bound in claims.bounds.items()}
    ends = len(stored.times) - 1
    claims = dataclasses.replace(
        claims, bounds=bounds, trusted=ends, horizon=stored.times[ends], horizon_reason="chaos"
    )
    found = dataclasses.replace(stored, certificate=claims)
    monkeypatch.setattr("ropeode.references.compute._reference", lambda *_: found)
    assert reference_for(stored.problem).horizon == stored.times[ends]
    assert folder.exists() == kept
    monkeypatch.setattr("ropeode.references.compute._reference", lambda *_: stored)
    assert reference_for(stored.problem) == (found if kept else stored)


def test_what_is_no_problem_of_the_library_is_not_kept(stored, solve, folder, monkeypatch):
    own = Problem(lambda t, y, args: -y, [1.0], [0.0, 1.0])
    solve(own)
    assert not folder.exists()
    monkeypatch.setattr("ropeode.cache._folder", None)
    assert solve(stored.problem)[1] == 2
