"""A small result of each kind, made up: its numbers are the same on every machine."""

from __future__ import annotations

import dataclasses
import functools
from collections import Counter
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from ropeode import (
    CheckReport,
    ProblemClass,
    Report,
    Rope,
    Verification,
    analysis,
    case_studies,
    checking,
    references,
    study,
    theory,
)
from ropeode.norms import NORMS
from ropeode.study.error_constant import ErrorConstant
from ropeode.sweep import StepperSummary, SweepSummary
from tests.exact_reference import exact_reference
from tests.quartic import HOSTILE


@functools.cache
def problem():
    return Rope(num_nodes=4).problem(frames=3)


@functools.cache
def reference():
    """Trusted at its first three samples."""
    bounds = {
        "position": np.array([0.0, 1e-13, 2.5e-13, np.inf]),
        "velocity": np.array([0.0, 2e-13, 5e-13, np.inf]),
    }

    def witness(solver, role, *sizes):
        differences = {"position": np.array(sizes), "velocity": 2 * np.array(sizes)}
        return references.Witness(solver, 1e-12, role, 345, 0.25, differences, sizes[2])

    exact = exact_reference(problem(), np.zeros((4, *problem().y0.shape)))
    certificate = dataclasses.replace(
        exact.certificate,
        bounds=bounds,
        drift={"position": np.array([0.0, 1e-15, 3e-15, 9e-15])},
        trusted=3,
        horizon=3.0,
        horizon_reason="a solver got no further",
        witnesses=(
            witness(references.DOPRI8, "looser", 0.0, 3e-13, 4e-13, 5e-13),
            witness(references.SCIPY_DOP853, "independent", 0.0, 1e-14, np.inf, np.inf),
        ),
        versions={"diffrax": "0.7", "python": "3.12"},
        sampling=references.Sampling(512, 0.0625),
    )
    return dataclasses.replace(exact, certificate=certificate)


def constant(**changes):

    known = {
        "order": 1,
        "predicted_at": np.array([4.0, 8.765]),
        "why": None,
        "measured_at": {1 / 64: 8.77, 1 / 32: 8.9, 1 / 16: 12.5},
    }
    return ErrorConstant(**{**known, **changes})


def table_row(stepper, steps, error, **more):
    """A run with this error, if it is resolved."""
    known = {
        "status": "ok",
        "diverged_at": None,
        "error_final": error and error * 0.75,
        "error_max": error,
        "error_rms": error and error / 2,
        "resolved": error is not None,
        "resolution": 2.5e-12,
        "round_off": 1e-14,
        "rhs_evaluations": 3 * steps,
        "seconds": 0.0125,
    }
    return study.Row(stepper, steps, 1 / steps, **{**known, **more})


def table_of(rows, orders):
    truth, norm = reference(), NORMS["position-max"]
    return study.AccuracyTable(problem(), truth, norm, tuple(rows), tuple(orders))


def accuracy_table():
    blown = {"status": "diverged", "diverged_at": 2, "resolved": False, "round_off": None}
    long = "stormer-verlet:damping=lagged,start=rest"
    euler = analysis.ObservedOrder(
        1.0,
        (0.99, 1.01),
        "converges",
        (1 / 16, 1 / 32, 1 / 64),
        (analysis.LeftOut(0.5, "unstable"),),
    )
    few = "1 of 2 step sizes can be used, 3 are needed"
    unresolved = analysis.LeftOut(1 / 64, "below the reference's bound")
    verlet = analysis.ObservedOrder(None, None, "undetermined", (), (unresolved,), few, (1 / 128,))
    unknown = constant(predicted_at=None, why="its step has memory", order=None, measured_at={})
    return table_of(
        (
            table_row("explicit-euler", 2, None, **blown),
            table_row("explicit-euler", 16, 0.5),
            table_row("explicit-euler", 32, 0.25),
            table_row("explicit-euler", 64, 0.125, seconds=12.3),
            table_row(long, 16, 1e-4, rhs_evaluations=None),
            table_row(long, 64, None),
        ),
        (
            study.StepperOrder("explicit-euler", 1, euler, True, constant()),
            study.StepperOrder(long, 2, verlet, False, unknown),
        ),
    )


def check_report():
    def order(observed):
        around, dts = (observed - 0.0625, observed + 0.0625), (0.0625, 0.03125)
        unstable = analysis.LeftOut(0.125, "unstable")
        return analysis.ObservedOrder(observed, around, "converges", dts, (unstable,))

    convergence = checking.Convergence(
        problem="free",
        dts=(0.125, 0.0625, 0.03125),
        errors={"position": (None, 1e-3, 5e-4), "velocity": (None, 2e-3, 1e-13)},
        rounding={"position": (0.0, 1e-15, 2e-15), "velocity": (0.0, 1e-15, 2e-15)},
        resolution={"position": 1e-12, "velocity": 2e-12},
        orders={"position": order(1.0), "velocity": order(1.25)},
        expected=2,
        limits={"position": (1e-6, 2e-6)},
    )
    long = "momentum drifts by 1.0e-16 of its size in 100 steps, which rounding of so many explains"
    return CheckReport(
        "steps.py:euler",
        checking.Claims(order=2, symplectic=False),
        (
            checking.Finding("purity", "pass", long, {"drift": 1e-16}),
            checking.Finding(
                "order-free",
                "fail",
                "positions order 1.00, expected 2",
                {"order": 1.0},
                convergence,
            ),
            checking.Finding(
                "stability", "note", "stable from 17 steps per frame on", {"steps": 17}
            ),
            checking.Finding("reversible", "undetermined", "the evidence is too thin"),
            checking.Finding("zero-length", "skip", "the problem has no links"),
        ),
        (
            theory.Diagnosis(
                "start", "the first step is half a step", {"steps": 0.5}, "start with v0"
            ),
            theory.Diagnosis("unknown", "no other cause stands out"),
        ),
        ("the stepper prints", "the step may be written as\n\ny = y + dt * f\nreturn y"),
        1.5,
    )


def work_row(method, effort, error, cost, **more):
    """A run with this error, if it is resolved, and so many evaluations, if they are counted."""
    rtol = effort if effort < 1 else None
    known = {
        "method": method,
        "family": "SciPy" if rtol else "runge-kutta",
        "effort": effort,
        "dt": None if rtol else 1 / effort,
        "rtol": rtol,
        "error_final": error,
        "error_max": error,
        "error_rms": error,
        "energy_error": error,
        "error_over_tolerance": error and rtol and error / rtol / 256,
        "resolved": error is not None,
        "status": "ok",
        "why": None,
        "rhs_evaluations": cost,
        "jacobian_evaluations": None,
        "steps": cost and cost // 4,
        "seconds": cost and cost / 4096,
        "seconds_min": cost and cost / 8192,
        "seconds_max": cost and cost / 2048,
    }
    return study.WorkRow(**{**known, **more})


def work_of(*rows):
    return study.WorkPrecision(
        problem=problem(),
        reference=reference(),
        norm=NORMS["position-max"],
        resolution=2.5e-12,
        energy_resolution=1e-9,
        run_limit=5.0,
        rounds=3,
        rows=rows,
    )


def work_precision():
    verlet = "stormer-verlet:damping=per-step,start=rest"
    return work_of(
        work_row("rk4", 16, 1e-3, 64),
        work_row("rk4", 64, 1e-5, 256),
        work_row("rk4", 1024, 1e-10, 4096),
        work_row(verlet, 16, 2.0, 16, status="unstable"),
        work_row(verlet, 12345678, 1e-6, 1234567),
        work_row("scipy:DOP853", 1e-2, 1e-2, 48),
        work_row("scipy:DOP853", 1e-6, None, 512),
        work_row("scipy:DOP853", 1e-9, None, None, status="failed", why="it stopped."),
        work_row("wild", 1e-3, None, 8192, energy_error=study.INFINITE),
    )


def horizon():
    def errors(*later):
        return np.array([0.0, *later])

    times, other = problem().ts, references.SCIPY_DOP853
    truth = references.ExtendedSolution(
        states=np.zeros((4, *problem().y0.shape)),
        bounds={},
        differences={},
        agreed=4,
        coarse=SimpleNamespace(precision=100),
        fine=SimpleNamespace(precision=124),
        seconds=0.75,
        failure=None,
    )
    exponent = analysis.LyapunovExponent(
        0.125, (0.0625, 0.25), 0.03125, times, np.zeros((2, 4)), references.DOPRI8, 1e-10, None
    )
    return study.Horizon(
        problem=problem(),
        reference=reference(),
        truth=truth,
        times=times,
        size=400.0,
        runs=(
            study.Run(references.DOPRI8, 1e-13, "reference", 270, errors(1e-14, 1e-13, 5e-10)),
            study.Run(other, 1e-12, "rounding", 300, errors(2e-14, 2e-13, 2e-12)),
            study.Run(other, 1e-12, "rounding", 300, errors(2e-14, np.inf, np.inf)),
        ),
        lost=np.array([0.0, 0.5, 1.0, 1.5]),
        digits_left=(study.DigitsLeft(14, 3.0, None, 2.0), study.DigitsLeft(13, 3.0, None, None)),
        float64_growth=study.Growth("exponential", 2.0, (1.75, 2.25), 1.0, 3.0),
        extended_growth=None,
        exponent=exponent,
        digits=18,
        needs=(
            study.Need(3.0, 1.5, 19.5, (19.5, 19.5), 65, True),
            study.Need(100.0, 20.0, 38.0, (36.5, 39.5), 132, False),
        ),
    )


def explanation():

    nothing = study.Part(0.0, 1e-12, False, 0.0, 0, None)
    wrong = study.Part(0.75, 1e-9, True, 1.5, 2, None)
    table = accuracy_table()
    table = table_of(table.rows[:4], table.orders[:1])
    limit = theory.SpectralLimit(theory.StableSteps(12, 0.0875), 1.0, 2j, 3)
    limits = theory.StabilityLimits(
        theory.StableInterval(0.0, 1000.0, growth=theory.LeadingTerm(0.5, 2)),
        theory.StableInterval(2.0, 1000.0),
        False,
        1000.0,
        1.0,
    )
    return study.Explanation(
        stepper="steps.py:heavy",
        problem=problem(),
        reference=reference(),
        local=study.LocalStep(
            0,
            0,
            True,
            (
                study.LocalQuantity("position", 1, 1, nothing, nothing, None),
                study.LocalQuantity("velocity", 0, 0, nothing, wrong, None),
            ),
            (0.0, 1.5),
            (0.01, 0.02),
            None,
            theory.Diagnosis(
                "parameters",
                "it solves another equation: the acceleration is 1% too large",
                {"acceleration": 1.01},
                "leave out the factor 1.01",
            ),
        ),
        orders=(
            study.ClassOrder(ProblemClass(True, True), True, 0, 0, 1),
            study.ClassOrder(ProblemClass(False, False), False, None, 4, None),
        ),
        tables=(table,),
        against_time=(),
        tableau=theory.StepTableau(None, "iterates without end"),
        stability=theory.LinearStability(
            problem(),
            theory.NoStabilityFunction("it takes no modes"),
            limits,
            None,
            limit,
            None,
            theory.StableSteps(14, 0.07),
            11,
            ("the equilibrium was not found",),
        ),
        region=None,
        structure={
            "symplectic": theory.Property(False, 1.5e-3, 2, 0.25),
            "reversible": theory.Property(None, None, None, 0.25, "it has no step back"),
        },
        modified=theory.ModifiedEnergy(
            1,
            64,
            1 / 64,
            np.array([0.0, 1.0, 2.0]),
            np.array([0.0, 4.0, 8.0]),
            np.array([0.0, 0.0625, 0.125]),
        ),
        equal=(),
        compared=theory.StepDifference("explicit-euler", 1e-3, 2.0),
    )


def sweep_summary():

    counts = {
        "status": Counter({"ok": 5, "diverged": 1}),
        "order_verdict": Counter({"converges": 4, "undetermined": 1, None: 1}),
        "resolved": Counter({True: 4, False: 1}),
        "expected_order": Counter({4: 6}),
    }
    ranges = {"error_max": (1e-9, 1e-3), "observed_order": (3.9, 4.1)}
    return SweepSummary(
        folder=Path("ropes"),
        spec={
            "name": "ropes",
            "problem": "rope",
            "steppers": ["rk4"],
            "grid": {"damping": [0.0, 0.1], "num_nodes": [4]},
            "fixed": {"frames": 3},
        },
        total=8,
        done=6,
        steppers={"rk4": StepperSummary(counts, ranges)},
        reasons={("diverged", "the state at frame 2 is not finite"): 1},
    )


def hostile():
    """Names with signs that mean something to HTML, Markdown, LaTeX or CSV."""
    table = accuracy_table()
    (row, *_), (order, _) = table.rows, table.orders
    return dataclasses.replace(
        table,
        problem=dataclasses.replace(problem(), name=HOSTILE),
        rows=(dataclasses.replace(row, stepper=HOSTILE),),
        orders=(dataclasses.replace(order, stepper=HOSTILE),),
    )


def report():
    figures, (comparison, *_) = case_studies.all_figures(), case_studies.all_comparisons()

    def reading(meaning, damping, verdict):
        setting = SimpleNamespace(parameters={"damping": damping})
        motion = analysis.Motion(
            *("settles", None, 120, None, np.array([1.5, 30.25]), 15, 400, analysis.Thresholds()),
            largest_stretch=np.inf,
            largest_stretch_at=7,
            energy=None,
            energy_at_rest=None,
            jitter=1e-4,
        )
        disturbed = theory.Growth(16, 1.001, 1.0161, 0.016, 1e-9, 2.5, 2250)
        run = SimpleNamespace(problem=setting)
        return case_studies.Reading(
            *(meaning, run, motion, False, disturbed, None),
            *("comes to rest in frame 120", verdict, "does not hold"),
        )

    moving = reading("words", 0.01, "holds"), reading("listing", 0.0, "does not hold")
    return Report(
        (
            case_studies.FigureResult(figures[1], "16 nodes, evenly spaced", "holds", 0, ()),
            case_studies.FigureResult(
                figures[8], "comes to rest in frame 120", "holds", 400, moving
            ),
        ),
        (case_studies.Compared(comparison, "figure 8 swings twice", "not watched long enough"),),
        analysis.Thresholds(),
        (case_studies.ThresholdEffect(8, "words", "speed", 0.002, "holds until frame 12"),),
        (case_studies.RoundingEffect(8, "listing", "settled_at", None, 251, "holds"),),
    )


def verification():
    known = reference()
    distances, outside = {"position": 1e-12, "velocity": 1e-13}, {"position": 2.0}
    return Verification(Path("x.nc"), "0" * 8, known, known, 3, 4, distances, outside)


MADE_UP = {
    "accuracy-table": accuracy_table,
    "check": check_report,
    "explain": explanation,
    "horizon": horizon,
    "hostile": hostile,
    "report": report,
    "sweep": sweep_summary,
    "verification": verification,
    "work-precision": work_precision,
}
