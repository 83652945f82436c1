"""Studies that hold all that a picture can be asked to show, made up."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pandas as pd

from ropeode.analysis import REASONS, UNRESOLVED, UNSTABLE, LeftOut, ObservedOrder
from ropeode.norms import NORMS
from ropeode.problems import Problem
from ropeode.study import (
    AccuracyTable,
    Curve,
    EnergyCurves,
    ErrorCurves,
    Explanation,
    NodePath,
    NodePaths,
    StepperOrder,
    WorkPrecision,
)
from ropeode.study.error_constant import ErrorConstant
from ropeode.sweep import COLUMNS
from ropeode.theory import Spectrum, StabilityFunction, stability_region
from tests.quartic import HOSTILE, quartic
from tests.render.made_up import (
    explanation,
    problem,
    reference,
    table_of,
    table_row,
    work_of,
    work_precision,
    work_row,
)


def order_of(stepper, observed, used, left_out) -> StepperOrder:
    around = observed and (observed - 0.0625, observed + 0.0625)
    verdict = "converges" if observed else "undetermined"
    found = ObservedOrder(observed, around, verdict, tuple(used), tuple(left_out))
    return StepperOrder(stepper, 2, found, True, None)


def every_reason() -> AccuracyTable:
    """Runs that are left out for each reason, beside a stepper of order 4 with a prediction."""
    name = "stormer-verlet:start=rest,damping=per-step"
    reasons = dict(zip((1, 2, 4, 64, 128, 256, 512), (UNSTABLE, *REASONS), strict=True))
    errors = dict(zip(reasons, (None, 1e9, None, None, 1e-9, 0.05, 1e-5), strict=True))
    status = {1: {"status": "diverged", "diverged_at": 2}, 4: {"status": "unsolved"}}
    used = (8, 16, 32)
    rows = [
        table_row(name, steps, errors.get(steps, 1.1 * steps**-2.0), **status.get(steps, {}))
        for steps in sorted((*reasons, *used))
    ]
    rows += [table_row("rk4", steps, 1.1 * steps**-4.0) for steps in used]
    left_out = [LeftOut(1 / steps, reason) for steps, reason in reasons.items()]
    dts = [1 / steps for steps in used]
    fourth = order_of("rk4", 4.0, dts, ())
    known = ErrorConstant(order=4, predicted_at=np.array([1.0, 1.2]), why=None, measured_at={})
    return table_of(
        rows,
        [order_of(name, 2.0, dts, left_out), dataclasses.replace(fourth, constant=known)],
    )


def all_twice() -> AccuracyTable:
    """The same with steppers of which each two do the same."""
    table = every_reason()

    def twice(each):
        return (*each, *(dataclasses.replace(one, stepper=f"{one.stepper}:b") for one in each))

    return table_of(twice(table.rows), twice(table.orders))


def no_order(*steps, **more) -> AccuracyTable:
    """Two steppers with too few runs; those of the second are not resolved."""
    rows = [table_row("a", each, 1 / each, **more) for each in steps]
    rows += [table_row("b", each, None, **more) for each in steps]
    few = [LeftOut(1 / each, REASONS[-1]) for each in steps]
    unresolved = [LeftOut(1 / each, UNRESOLVED) for each in steps]
    return table_of(rows, [order_of("a", None, (), few), order_of("b", None, (), unresolved)])


def still() -> AccuracyTable:
    """Of a rope that hangs still, of which all is known: zero is on no logarithmic axis."""
    return no_order(4, 8, resolution=0.0)


TIMES = np.arange(7) / 2
BOUND = 1e-13 * 4.0 ** np.arange(7)


def curve(stepper, steps, values, start=1, **more) -> Curve:
    values = np.array(values)
    times = TIMES[start : start + len(values)]
    label = f"{steps} steps/frame"
    return Curve(stepper, label, 1 / steps, times, values, steps_per_frame=steps, **more)


def error_curves(*curves, **more) -> ErrorCurves:
    known: dict[str, Any] = {
        "problem": problem(),
        "reference": reference(),
        "norm": NORMS["position-max"],
        "motion": 2.0,
        "times": TIMES[1:],
        "bound": BOUND[1:],
        "resolution": 10 * BOUND[1:],
    }
    return ErrorCurves(**{**known, **more}, curves=curves)


SMALL = (1e-14, 1e-12, 1e-10, 2e-10, 3e-10, 4e-10)
LARGE = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)


def errors() -> ErrorCurves:
    """Unresolved at first; off the axis and diverged; beside a prediction."""
    predicted = {"predicted": 1.1 * np.array(LARGE)}
    return error_curves(
        curve("rk4", 16, 1e4 * np.array(SMALL)),
        curve("rk4", 64, SMALL),
        curve("explicit-euler", 16, [0.1, 1.0, 10.0, 1e3], diverged_at=2.5, status="diverged"),
        curve("explicit-euler", 64, LARGE, **predicted),
    )


def errors_in_one_panel() -> ErrorCurves:
    """One run of each stepper, of a problem without units and with a hostile name."""
    return error_curves(
        curve("implicit-euler", 16, LARGE[:3], diverged_at=2.0, status="unsolved"),
        curve("rk4", 16, SMALL),
        problem=quartic(),
    )


def energies() -> EnergyCurves:
    """Too much and too little, unresolved at first; and one that blew up."""
    sizes = np.array([0.0, 1e-14, 1e-6, -1e-5, 2e-5, -4e-5, 5e-5])
    curves = (
        curve("rk4", 16, 1.0 + sizes, 0),
        curve("rk4", 64, 1.0 - sizes / 16, 0),
        curve("explicit-euler", 16, [1.0, 2.0, 0.5, 1e30], 0, diverged_at=2.0, status="diverged"),
    )
    return EnergyCurves(problem(), reference(), False, TIMES, np.ones(7), BOUND, curves)


def work() -> WorkPrecision:
    """Certified, unresolved, unstable, diverged and failed runs, one uncounted, a hostile name."""

    def changed(row):
        """Whose errors differ in each measure."""
        name = HOSTILE if row.method.startswith("stormer") else row.method
        largest = row.error_max
        measures = {"error_final": largest / 2, "energy_error": 4 * largest} if largest else {}
        return dataclasses.replace(row, method=name, **measures)

    rk4, *others = map(changed, work_precision().rows)
    diverged = work_row("rk4", 4, None, 16, status="diverged")
    return work_of(diverged, rk4, *others, work_row("uncounted", 1e-2, 1e-3, None))


def gap() -> WorkPrecision:
    """Nothing is interpolated over a run that failed, so nothing is drawn there."""
    failed = work_row("gap", 1e-3, None, None, status="failed", why="it stopped.")
    tight = [work_row("gap", 1e-4, 1e-3, 1000), work_row("gap", 1e-5, 1e-4, 10000)]
    return work_of(work_row("gap", 1e-2, 1e-1, 10), failed, *tight)


def stability() -> Explanation:
    """Explicit Euler on modes of which two decay and two grow, one of them far out."""
    found = explanation()
    function = StabilityFunction(
        *("explicit-euler", "y' = lambda y", True, True, (1.0, 1.0), None, None, None, None)
    )
    modes = np.array([[-0.1 + 1j, -0.1 - 1j, 0.5, 100.0]])
    along = Spectrum(np.zeros(1), modes, np.full(1, 1e-9))
    linear = dataclasses.replace(found.stability, function=function, along=along)
    region = stability_region(function, linear.limits, points=5)
    return dataclasses.replace(found, stability=linear, region=region)


DAMPINGS, STEPS = (0.01, 0.1, 1.0), (16, 32, 64, 128)


def frame_of(rows) -> pd.DataFrame:
    return pd.DataFrame([{**dict.fromkeys(COLUMNS), "problem": "rope", **row} for row in rows])


def sweep() -> pd.DataFrame:
    """Two steppers; one case of the first diverged, one has no order, one is not there."""
    rows = [
        {
            "stepper": stepper,
            "damping": damping,
            "steps_per_frame": steps,
            "status": "ok",
            "resolved": True,
            "order_verdict": "converges",
            "observed_order": order + damping / 100,
            "error_max": damping / steps**order,
        }
        for stepper, order in (("rk4", 4), ("explicit-euler", 1))
        for damping in DAMPINGS
        for steps in STEPS
    ]
    bad = frame_of(rows)
    euler = bad.index[bad["stepper"] == "explicit-euler"]
    bad.loc[euler[0], ["status", "observed_order"]] = ["diverged", None]
    bad.loc[euler[1], ["order_verdict", "observed_order"]] = ["undetermined", None]
    return bad.drop(euler[2])


def blown_up() -> pd.DataFrame:
    """The same with runs that blew up, which do not stretch the colours."""
    found = sweep().assign(motion_size=0.5)
    found.loc[found.index[[3, 4]], "error_max"] = [1e200, np.inf]
    return found


def without_orders() -> pd.DataFrame:
    found = sweep()
    return found[found["status"] == "ok"].assign(observed_order=None, order_verdict="undetermined")


def draws() -> pd.DataFrame:
    """Draws of two parameters that never meet; each fourth has diverged."""
    rows = [
        {
            "stepper": "rk4",
            "damping": 0.1 * i,
            "stiffness": 0.3 * i % 1.0,
            "status": "ok" if i % 4 else "diverged",
            "error_max": 0.02 * i if i % 4 else None,
        }
        for i in range(1, 10)
    ]
    return frame_of(rows)


def paths(start: Problem | None = None) -> NodePaths:
    """Errors that are seen only magnified, that nobody can tell, that explode, and that end.

    Arguments:
        start: a rope of 4 nodes and 3 frames.
    """
    start = start or problem()
    states = np.repeat(start.y0[None], 4, axis=0)
    states[:, 0, 1, 1] -= 20.0 * np.arange(4)
    truth = dataclasses.replace(reference(), problem=start, states=states)
    nodes = np.ones_like(truth.positions) * np.arange(4)[:, None]

    def path(name, sizes, status="ok", diverged_at=None) -> NodePath:
        differences = np.array(sizes)[:, None, None] * nodes[: len(sizes)]
        positions = truth.positions[: len(sizes)] + differences
        errors = differences.max(axis=(1, 2))[: truth.trusted]
        return NodePath(name, positions, errors, differences, diverged_at, status)

    long = "stormer-verlet:start=rest,damping=per-step"
    return NodePaths(
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
