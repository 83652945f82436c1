"""References in the cache folder: found again where all is the same, and nowhere else."""

from __future__ import annotations

from ropeode import save_reference
from ropeode.problems import PROBLEMS
from ropeode.references import ReferenceOptions, reference_for
from tests.references.scalar_problems import scalar


def swing(**parameters):
    return PROBLEMS["oscillator"](frames=4, **parameters)


def runs_for(problem, options=ReferenceOptions()):  # noqa: B008
    """The reference, and how many runs of solvers it took."""
    said = []
    known = reference_for(problem, options, lambda text, fraction: said.append(text))
    return known, len(said)


def test_a_kept_reference_is_the_one_that_was_computed_and_what_differs_has_another(
    cache_folder, tmp_path, monkeypatch
):
    computed, runs = runs_for(swing())
    assert runs > 9
    again, runs = runs_for(swing())
    assert runs == 0
    first, second = (
        save_reference(each, tmp_path / f"{name}.nc").read_bytes()
        for name, each in (("a", computed), ("b", again))
    )
    assert first == second
    changed = swing()
    right = changed.rhs
    for problem, options in (
        (swing(), ReferenceOptions(rtol=1e-6)),
        (swing(x0=1.1), ReferenceOptions()),
        # Parameters of the library are no evidence of the equation.
        (changed.changed(rhs=lambda t, y, args: 1.001 * right(t, y, args)), ReferenceOptions()),
    ):
        assert runs_for(problem, options)[1] > 9
    monkeypatch.setattr("ropeode.cache._folder", None)
    assert runs_for(swing())[1] > 9


def test_what_ended_early_is_not_kept_and_neither_are_problems_of_the_users(cache_folder):
    """With more time a run may get further; here all of them end at a pole."""
    pole = swing(x0=0.4).changed(rhs=lambda t, y, args: y * y)
    assert runs_for(pole)[0].horizon == 3.0
    runs_for(scalar("decay", 1.0, range(6)))
    assert not (cache_folder / "references").exists()
