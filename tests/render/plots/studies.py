"""Studies that hold all that a picture can be asked to show, made up."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ropeode import study
from ropeode.norms import NORMS
from ropeode.problems import Problem
from ropeode.sweep import COLUMNS
from ropeode.theory import Spectrum, stability_function_of, stability_region
from tests.quartic import quartic
from tests.render.made_up import MADE_UP, made, problem, reference, table_of

FOLDER = Path(__file__).parent
DATA = json.loads((FOLDER / "studies.json").read_text())
KINDS = {
    "every-reason": study.AccuracyTable,
    "no-order": study.AccuracyTable,
    "still": study.AccuracyTable,
    "errors": study.ErrorCurves,
    "errors-in-one-panel": study.ErrorCurves,
    "energies": study.EnergyCurves,
    "gap": study.WorkPrecision,
    "work": study.WorkPrecision,
}


def named(name: str) -> Any:
    """The study of this name in `studies.json`.

    `every-reason` leaves out runs for each reason, beside a stepper of order 4 with a prediction;
    all is known of a rope that hangs `still`, and zero is on no logarithmic axis. The curves are
    unresolved at first, leave the axis and diverge. In a `gap` a run failed, so nothing is drawn.
    """
    return made(KINDS[name], DATA[name])


def all_twice() -> study.AccuracyTable:
    """Runs left out for every reason, by steppers of which each two do the same."""
    table = named("every-reason")

    def twice(each):
        return (*each, *(dataclasses.replace(one, stepper=f"{one.stepper}:b") for one in each))

    return table_of(twice(table.rows), twice(table.orders))


def errors_in_one_panel() -> study.ErrorCurves:
    """One run of each stepper, of a problem without units and with a hostile name."""
    return dataclasses.replace(named("errors-in-one-panel"), problem=quartic())


def stability() -> study.Explanation:
    """Explicit Euler on modes of which two decay and two grow, one of them far out."""
    found = MADE_UP["explain"]()
    function = stability_function_of(problem(), "explicit-euler")
    modes = np.array([[-0.1 + 1j, -0.1 - 1j, 0.5, 100.0]])
    along = Spectrum(np.zeros(1), modes, np.full(1, 1e-9))
    linear = dataclasses.replace(found.stability, function=function, along=along)
    region = stability_region(function, linear.limits, points=5)
    return dataclasses.replace(found, stability=linear, region=region)


def frame_of(rows) -> pd.DataFrame:
    return pd.DataFrame([{**dict.fromkeys(COLUMNS), "problem": "rope", **row} for row in rows])


def sweep(name: str = "sweep") -> pd.DataFrame:
    """The cases of a sweep that are finished.

    Arguments:
        name: `sweep`, of two steppers, of which one case diverged, one has no order and one is not
            there; or `draws` of two parameters that never meet, of which each fourth diverged.
    """
    return frame_of(pd.read_csv(FOLDER / f"{name}.csv").to_dict("records"))


def blown_up() -> pd.DataFrame:
    """The same with runs that blew up, which do not stretch the colours."""
    found = sweep().assign(motion_size=0.5)
    found.loc[found.index[[3, 4]], "error_max"] = [1e200, np.inf]
    return found


def without_orders() -> pd.DataFrame:
    found = sweep()
    return found[found["status"] == "ok"].assign(observed_order=None, order_verdict="undetermined")


def paths(start: Problem | None = None) -> study.NodePaths:
    """Errors that are seen only magnified, that nobody can tell, that explode, and that end.

    Arguments:
        start: a rope of 4 nodes and 3 frames.
    """
    start = start or problem()
    states = np.repeat(start.y0[None], 4, axis=0)
    states[:, 0, 1, 1] -= 20.0 * np.arange(4)
    truth = dataclasses.replace(reference(), problem=start, states=states)
    nodes = np.ones_like(truth.positions) * np.arange(4)[:, None]

    def path(name, sizes, status="ok", diverged_at=None) -> study.NodePath:
        differences = np.array(sizes)[:, None, None] * nodes[: len(sizes)]
        positions = truth.positions[: len(sizes)] + differences
        errors = differences.max(axis=(1, 2))[: truth.trusted]
        return study.NodePath(name, positions, errors, differences, diverged_at, status)

    long = "stormer-verlet:start=rest,damping=per-step"
    return study.NodePaths(
        problem=start,
        reference=truth,
        norm=NORMS["position-max"],
        samples_per_frame=1,
        steps_per_frame=16,
        resolution=10.0 * truth.bound()[: truth.trusted],
        paths=(
            path("rk4", [0.0, 1e-6, 2e-6, 3e-6]),
            path(long, [0.0, 1e-14, 1e-14, 1e-14]),
            path("explicit-euler", [0.0, 50.0, 5e4, 5e200]),
            path("explicit-euler:b", [0.0, 10.0], "diverged", 2),
        ),
    )
