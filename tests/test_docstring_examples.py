"""Every public name shows how it is used, and the example prints what it says."""

from __future__ import annotations

import doctest
import inspect
from pathlib import Path

import pytest

import ropeode
from tests.sampled import sampled

# It changes what IPython shows of an exception.
WITHOUT_RESULT = {"full_tracebacks"}
# What these compile, other tests compile too; the others take up to 5 seconds each.
QUICK = {
    *["InputError", "UserCodeError", "Problem", "Problem.second_order", "Problem.from_scipy"],
    *["Ensemble", "Rope", "InextensibleRope", "RopeInput.problem", "as_stepper", "Stepper"],
    *["Phase", "simulate", "Trajectory", "reference", "Reference", "load", "save_reference"],
    *["error_series", "observed_order", "accuracy_table", "format_table", "grade", "SweepSpec"],
}
HEYOKA = {"Horizon", "horizon", "format_horizon", "plot_horizon"}


def examples() -> dict[str, doctest.DocTest]:
    """The example of each public name, and of each method, by name.

    A method that classes share is there once, under its owner.
    """
    finder, found = doctest.DocTestFinder(), {}
    for value in PUBLIC.values():
        bases = inspect.getmro(value) if inspect.isclass(value) else [value]
        for each in bases:
            if each.__module__.startswith("ropeode."):
                tests = finder.find(each, each.__name__, module=False, globs={})
                found |= {test.name: test for test in tests if test.examples}
    return found


PUBLIC = {name: getattr(ropeode, name) for name in vars(ropeode)["__all__"]}
PUBLIC = {name: each for name, each in PUBLIC.items() if not inspect.ismodule(each)}
EXAMPLES = examples()


@pytest.mark.parametrize("name", sorted({*PUBLIC, *EXAMPLES}))
def test_every_public_name_has_an_example_at_its_end(name):
    lines = inspect.cleandoc(EXAMPLES[name].docstring).splitlines()
    assert lines.count("Examples:") == 1, f"{name} has no section `Examples:`"
    rest = lines[lines.index("Examples:") + 1 :]
    assert rest[0].startswith("    >>> ")
    assert all(line.startswith("    ") for line in rest), "something follows, or is blank"
    results = [each for each in EXAMPLES[name].examples if each.want or each.exc_msg]
    assert results or name in WITHOUT_RESULT, f"the example of {name} shows no result"


@pytest.mark.parametrize("name", sampled(EXAMPLES, QUICK))
@pytest.mark.usefixtures("same_jax_settings")
def test_examples_print_what_they_say(name, tmp_path, monkeypatch, cache):
    if name in HEYOKA:
        pytest.importorskip("heyoka", reason="heyoka is an extra")
    monkeypatch.chdir(tmp_path)
    # As a command does: many examples ask for the same reference, and it is computed once.
    monkeypatch.setattr("ropeode.cache._folder", Path(cache))
    said = []
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    assert runner.run(EXAMPLES[name], out=said.append).failed == 0, "".join(said)


def test_the_lists_name_what_exists():
    assert EXAMPLES.keys() >= QUICK | WITHOUT_RESULT | HEYOKA
