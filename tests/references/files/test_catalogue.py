"""The stored library: recipes, manifest and files agree, and each file is reproduced."""

from __future__ import annotations

import dataclasses
import shutil

import numpy as np
import pytest

from ropeode import load
from ropeode.errors import InputError
from ropeode.references import (
    entries,
    extended_solution,
    find,
    folder,
    read_recipe,
    reference_for,
    verify_checksum,
)
from tests.problems.exact import EXACT
from tests.sampled import sampled

MOST_BYTES = 20 * 2**20
# Seconds that no run takes, however busy the machine is.
NEVER = 1e9
NAMES = sorted(entries())
RECIPES = {name: read_recipe(folder() / f"{name}.toml") for name in NAMES}
PUBLISHED = ("arenstorf", "hires", "oregonator", "pleiades", "robertson", "van-der-pol")
EXTENDED = [name for name, (recipe, _) in RECIPES.items() if recipe.level == "extended"]
# Equations that others have too, or that published values confirm; computing them takes long.
COSTLY = {
    *("rope-stiff", "rope-at-rest", "rope-damping-0.01", "rope-damping-0.001"),
    *("inextensible-rope", "van-der-pol"),
}
# How many samples are computed again where it is not a tenth.
FIRST_SAMPLES = {"lorenz": 40, "rope-damping-0.1": 4, "rope-undamped": 8}


def test_recipes_manifest_and_files_agree():
    assert {path.stem for path in folder().glob("*.toml")} == set(NAMES)
    assert {path.stem for path in folder().glob("*.nc")} == set(NAMES)
    assert sum(path.stat().st_size for path in folder().iterdir()) < MOST_BYTES
    for name, entry in entries().items():
        recipe, digest = RECIPES[name]
        assert entry.recipe_sha256 == digest, f"{name}: make it again, `make references`"
        assert entry.sha256 == verify_checksum(folder() / f"{name}.nc")
        assert (entry.title, entry.problem) == (recipe.title, recipe.problem)


@pytest.mark.parametrize("name", NAMES)
def test_what_is_loaded_is_what_the_manifest_says_and_others_have_found(name):
    known, entry, (recipe, _) = load(name), entries()[name], RECIPES[name]
    assert dict(known.problem.parameters) == dict(recipe.build().parameters)
    assert known.trusted == entry.samples == len(known.problem.ts)
    assert known.horizon is entry.horizon is None
    assert known.bound()[-1] == entry.bound
    assert known.times[-1] == entry.end
    assert known.certificate.level == entry.level == recipe.level
    if name in PUBLISHED:
        assert recipe.published_error(known) <= known.bound()[-1] + recipe.published.uncertainty
    if name not in EXACT:
        return
    exact = known.problem.exact(known.problem.ts)
    for quantity in known.problem.quantities:
        one, other = (known.problem.quantity(quantity, each) for each in (known.states, exact))
        # Either is rounded to float64; the exact solution's own rounding in extended
        # precision grows with what becomes of an error at the start (Kepler, near the sun).
        assert np.max(np.abs(one - other)) <= 2 * np.spacing(np.max(np.abs(other)))


@pytest.mark.parametrize(
    "name", sampled((name for name in EXTENDED if name not in COSTLY), fast=("oscillator",))
)
def test_extended_ones_are_reproduced_to_the_last_bit(name):
    pytest.importorskip("heyoka")
    known = load(name)
    samples = FIRST_SAMPLES.get(name, max(2, known.trusted // 10))
    problem = dataclasses.replace(known.problem, ts=known.problem.ts[:samples])
    found = extended_solution(problem, digits=RECIPES[name][0].digits, time_limit=NEVER)
    assert found.agreed == samples
    np.testing.assert_array_equal(found.states, known.states[:samples])


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(set(NAMES) - set(EXTENDED)))
def test_others_are_reproduced_within_their_bounds(name):
    known, (recipe, _) = load(name), RECIPES[name]
    problem = dataclasses.replace(known.problem, ts=known.problem.ts[:2])
    again = reference_for(problem, recipe.options.model_copy(update={"time_limit": NEVER}))
    apart = np.max(np.abs(again.states - known.states[:2]), axis=1)
    assert np.all(apart <= known.bound()[:2] + again.bound())


def test_the_rope_at_rest_obeys_statics():
    known = load("rope-at-rest")
    args = known.problem.args
    mass, stiffness, rest_length = (
        np.asarray(values, dtype=np.longdouble)
        for values in (args.mass, args.stiffness, args.rest_length)
    )
    # Each spring carries the masses below it; gravity is 1.
    below = np.cumsum(mass[::-1])[::-1][1:]
    depth = np.append(np.longdouble(0), np.cumsum(rest_length + below / stiffness))
    expected = np.stack([np.zeros(16), 200 - depth], axis=1)
    # Each mode is weakly damped and decays with half the damping.
    swing = 400.0 * np.exp(-0.5 * 0.1 * known.times[-1])
    assert np.max(np.abs(known.positions[-1] - expected)) <= swing + known.bound()[-1]
    assert swing < 1e-14


def test_a_file_comes_before_a_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert find("kepler") == folder() / "kepler.nc"
    shutil.copy(folder() / "lorenz.nc", tmp_path / "kepler")
    assert find("kepler").resolve() == tmp_path / "kepler"
    assert load("kepler").problem.name == "Kepler"
    assert find("nothing-here.nc").name == "nothing-here.nc"


@pytest.mark.parametrize("look", [load, find])
def test_what_is_not_there_is_told(look):
    with pytest.raises(InputError, match=r"did you mean 'kepler'"):
        look("keplr")


def test_a_file_that_is_not_the_manifests_is_refused(tmp_path, monkeypatch):
    shutil.copy(folder() / "manifest.json", tmp_path)
    shutil.copy(folder() / "lorenz.nc", tmp_path / "kepler.nc")
    monkeypatch.setattr("ropeode.references.files.library.folder", lambda: tmp_path)
    with pytest.raises(InputError, match=r"sha256 differs.*install ropeode again"):
        load("kepler")
