"""Whether files are those of the other kind of rope: springs for rigid links, or the reverse."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ropeode.analysis import distances, largest_distance
from ropeode.checking.report import Diagnosis
from ropeode.checking.trajectories.convergence import is_right, order_finding
from ropeode.checking.trajectories.run_files import Run
from ropeode.errors import InputError, ReferenceRefused
from ropeode.norms import NORMS
from ropeode.problems import ROPES, Problem
from ropeode.progress import silent
from ropeode.references import Reference
from ropeode.simulation import simulate

# By kind: the links of the rope, and methods that solve it.
_LINKS = {
    "rope": ("springs", "methods that add up forces"),
    "inextensible-rope": ("rigid links", "a Verlet that restores lengths"),
}

# How many times as far the runs must be from the given rope as from the other.
_FURTHER = 10.0
# As much in the first half of the run, at least, from a run of the classical Runge-Kutta method
# with so many steps per frame, which is nearly exact.
_NEARER, _FEWEST_STEPS = 3.0, 64


def other_rope(
    reference: Reference, runs: Sequence[Run], certified: Callable[[Problem], Reference]
) -> Diagnosis | None:
    """The rope of another kind, with the same parameters, to which runs converge with an order.

    Arguments:
        reference: of the problem that they should solve.
        runs: from coarse to fine.
        certified: makes the reference of a problem.
    """
    given, finest = reference.problem, runs[-1]
    norm = NORMS[f"{given.quantities[0]}-max"]
    away = distances(finest.states, reference, norm)
    for problem, added in _others(given):
        # A reference takes a hundred times as long as a run that shows which rope is nearer.
        steps = max(_FEWEST_STEPS, round(float(np.max(np.diff(problem.ts))) / finest.dt))
        near, early = simulate(problem, "rk4", steps, progress=silent), slice(len(away) // 2 + 1)
        if near.status == "ok" and np.max(away[early]) < _NEARER * largest_distance(
            problem, norm, near.states[early], finest.states[early]
        ):
            continue
        try:
            other = certified(problem)
        except ReferenceRefused:
            continue
        own, error = (
            float(np.max(distances(finest.states, each, norm))) for each in (reference, other)
        )
        theirs = [dataclasses.replace(run, problem=problem) for run in runs]
        finding, _ = order_finding(other, theirs, None)
        if own < _FURTHER * error or not is_right(finding):
            continue
        kind, (springs, _) = problem.parameters["kind"], _LINKS[given.parameters["kind"]]
        links, methods = _LINKS[kind]
        links = " ".join([links, *(f"of {name} {value:g}" for name, value in added.items())])
        line = (
            f"the files fit the same rope with {links}: at dt = {finest.dt:.4g} the error is "
            f"{error:.1e} against that rope, and {own:.1e} against the given one, with {springs}; "
            f"against that rope, {finding.line}"
        )
        spec = f'kind = "{kind}" in the spec'
        fix = f"if that rope is meant, as for {methods}, grade them with {spec}"
        evidence = {"error": own, "error_of_other": error, "other": dict(problem.parameters)}
        return Diagnosis("other-rope", line, evidence, fix)
    return None


def _others(problem: Problem) -> list[tuple[Problem, dict[str, Any]]]:
    """The ropes of other kinds with the parameters of a rope, and those that it does not have."""
    own = ROPES.get(problem.parameters.get("kind", ""))
    if own is None:
        return []
    given = {name: problem.parameters[name] for name in own.model_fields}
    # Its numbers may have been changed since it was built.
    if own(**given).problem(problem.frames) != problem:
        return []
    found = []
    for kind in ROPES.values():
        if kind is own:
            continue
        shared = {name: value for name, value in given.items() if name in kind.model_fields}
        try:
            made = kind(**shared).problem(problem.frames)
        except InputError:
            # Rigid links allow fewer pins and velocities.
            continue
        added = {name: made.parameters[name] for name in kind.model_fields if name not in given}
        found.append((made, added))
    return found
