"""References in the cache folder: found again where all is the same, and nowhere else."""

from __future__ import annotations

import numpy as np
import pytest

from ropeode.problems.problem import Problem
from ropeode.references import cache_folder, kept
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
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(cache_folder, "_folder", tmp_path)
    return tmp_path / "references"


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


def test_other_settings_and_software_have_another(stored, solve, folder, monkeypatch):
    problem = stored.problem
    solve(problem)
    assert solve(problem, ReferenceOptions(accuracy=1e-6))[1] == 2
    assert solve(problem, ReferenceOptions(time_limit=1.0))[1] == 3
    assert solve(problem.changed(y0=problem.y0 * 2.0))[1] == 4
    monkeypatch.setattr(kept, "_heyoka", lambda: "another")
    assert solve(problem)[1] == 5
    monkeypatch.setattr(kept, "_SOURCES", ("*.py",))
    assert solve(problem)[1] == 6


def test_what_is_in_a_file_must_be_of_the_problem(stored, solve, folder, monkeypatch):
    """The name of a file is no evidence: its problem is compared, the equation included."""
    monkeypatch.setattr(kept, "_key", lambda *_: "one")
    solve(stored.problem)
    rhs = stored.problem.rhs
    changed = stored.problem.changed(rhs=lambda t, y, args: 1.001 * rhs(t, y, args))
    assert solve(changed)[1] == 2


def test_what_ends_early_or_is_no_problem_of_the_library_is_not_kept(
    stored, solve, folder, monkeypatch
):
    own = Problem(lambda t, y, args: -y, [1.0], [0.0, 1.0])
    solve(own)
    monkeypatch.setattr(type(stored), "horizon", 3.0)
    assert solve(stored.problem)[1] == solve(stored.problem)[1] - 1 == 2
    assert not folder.exists()
    monkeypatch.setattr(cache_folder, "_folder", None)
    assert solve(stored.problem)[1] == 4
