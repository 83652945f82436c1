"""Every public name shows how it is used, and the example prints what it says."""

from __future__ import annotations

import doctest
import inspect
import types
from pathlib import Path

import pytest

import ropeode

# Methods that only ropeode calls, and those that the example of the class shows in use.
WITHOUT = {
    "Problem": "changed without_equations require_equations up_to_date with_numbers "
    "require_mechanics",
    "Ensemble": "numbers up_to_date",
    "RopeInput": "functions y0 free lengths args common_args from_parameters",
    "Rope": "functions args",
    "InextensibleRope": "functions args",
    "JaxStepper": "init step state",
    "Stepper": "init step state solves require on refusal",
    "System": "rhs acceleration undamped_acceleration",
    "SweepSpec": "cases tasks",
}
# It changes what IPython shows of an exception.
WITHOUT_RESULT = {"full_tracebacks"}
# These take from 0.1 to 5 seconds, most of it to compile what no other example runs.
SLOW = {
    *["AccuracyTable", "CheckArgs", "CheckReport", "check_stepper", "format_check"],
    *["Explanation", "explain_stepper", "format_explanation", "plot_stability"],
    *["Horizon", "horizon", "format_horizon", "plot_horizon"],
    *["WorkPrecision", "WorkPrecision.front", "WorkPrecision.costs_to_reach", "work_precision"],
    *["format_work_precision", "plot_work_precision"],
    *["LyapunovExponent", "lyapunov_exponent"],
    *["Report", "rope_report", "format_report"],
    *["SweepSummary", "run_sweep", "load_sweep", "plot_sweep"],
    *["Film", "Film.save", "animate", "node_paths"],
    *["Reference.at", "Reference.bound_at", "Verification", "verify_reference"],
    *["lab", "JaxStepper", "JaxStepper.states", "each_reference", "Problem.drift", "System"],
    *["energy_curves", "trajectory_energy_curves", "plot_energies"],
    *["growth_per_frame", "stability_limit", "ErrorSeries", "ReferenceRefused"],
    *["Motion", "Thresholds", "classify_motion", "hanging_equilibrium", "Sampled.to_xarray"],
}
HEYOKA = {"Horizon", "horizon", "format_horizon", "plot_horizon"}


def classes(value):
    """The class itself, and those of ropeode that it derives from; none of a function."""
    bases = inspect.getmro(value) if inspect.isclass(value) else ()
    return [each for each in bases if each.__module__.startswith("ropeode.")]


def public():
    """What a user meets in `help`, by name; a method that classes share once, under its owner."""
    kinds = types.FunctionType | classmethod | staticmethod
    found, owners = {}, {}
    for name in ropeode.__all__:
        value = getattr(ropeode, name)
        if not isinstance(value, types.ModuleType):
            found[name] = value
            owners |= {owner.__name__: owner for owner in classes(value)}
    for owner, value in owners.items():
        found |= {
            f"{owner}.{name}": getattr(value, name)
            for name, each in vars(value).items()
            if isinstance(each, kinds)
            and not name.startswith("_")
            and name not in WITHOUT.get(owner, "").split()
        }
    return found, owners


PUBLIC, OWNERS = public()


def example_of(name):
    (test,) = doctest.DocTestFinder(recurse=False).find(PUBLIC[name], name, module=False, globs={})
    return test


@pytest.mark.parametrize("name", PUBLIC)
def test_every_public_name_has_an_example_at_its_end(name):
    lines = inspect.getdoc(PUBLIC[name]).splitlines()
    assert lines.count("Examples:") == 1, f"{name} has no section `Examples:`"
    rest = lines[lines.index("Examples:") + 1 :]
    assert rest[0].startswith("    >>> ")
    assert all(line.startswith("    ") for line in rest), "something follows, or is blank"
    results = [each for each in example_of(name).examples if each.want or each.exc_msg]
    assert results or name in WITHOUT_RESULT, f"the example of {name} shows no result"


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name in SLOW)) for name in PUBLIC]
)
@pytest.mark.usefixtures("same_jax_settings")
def test_examples_print_what_they_say(name, tmp_path, monkeypatch, cache):
    if name in HEYOKA:
        pytest.importorskip("heyoka", reason="heyoka is an extra")
    monkeypatch.chdir(tmp_path)
    # As a command does: many examples ask for the same reference, and it is computed once.
    monkeypatch.setattr("ropeode.cache._folder", Path(cache))
    said = []
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    assert runner.run(example_of(name), out=said.append).failed == 0, "".join(said)


def test_the_lists_name_what_exists():
    assert PUBLIC.keys() >= SLOW | WITHOUT_RESULT
    for owner, names in WITHOUT.items():
        assert vars(OWNERS[owner]).keys() >= set(names.split())
