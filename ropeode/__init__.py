"""ODE steppers held against certified reference solutions.

The public names are imported when they are first used, so that `import ropeode` costs nothing
and the command line can show its help without importing JAX.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ropeode.analysis.equilibrium import hanging_equilibrium
    from ropeode.analysis.errors import ErrorSeries, error_series
    from ropeode.analysis.lyapunov import LyapunovExponent, lyapunov_exponent
    from ropeode.analysis.motion import Motion, Thresholds, classify_motion
    from ropeode.analysis.order import ObservedOrder, observed_order
    from ropeode.analysis.stability import growth_per_frame, stability_limit
    from ropeode.case_studies.report import Report, rope_report
    from ropeode.checking.check import check_stepper
    from ropeode.checking.grade import grade
    from ropeode.checking.problems import CheckArgs
    from ropeode.checking.report import CheckReport
    from ropeode.errors import InputError, ReferenceRefused, RopeodeError, UserCodeError
    from ropeode.problems.ensemble import Ensemble
    from ropeode.problems.inextensible_rope import InextensibleRope
    from ropeode.problems.links import LinearDamping, Links
    from ropeode.problems.problem import Problem
    from ropeode.problems.rope import Rope
    from ropeode.references.ensemble import each_reference
    from ropeode.references.files.library import load
    from ropeode.references.files.store import load_reference, save_reference
    from ropeode.references.files.verify import Verification, verify_reference
    from ropeode.references.reference import Reference, reference
    from ropeode.render.formats import (
        format_check,
        format_horizon,
        format_report,
        format_table,
    )
    from ropeode.render.plots.animation import animate
    from ropeode.render.plots.convergence import plot_convergence
    from ropeode.render.plots.energy import plot_energies
    from ropeode.render.plots.error import plot_errors
    from ropeode.render.plots.horizon import plot_horizon
    from ropeode.render.plots.sweep_map import plot_sweep
    from ropeode.simulation import Trajectories, Trajectory, simulate, simulate_chunks
    from ropeode.steppers.base import ProblemClass, Stepper, System
    from ropeode.steppers.phase import Phase
    from ropeode.steppers.stepper_loading import as_stepper
    from ropeode.study.accuracy_table import AccuracyTable, accuracy_table
    from ropeode.study.curves import energy_curves, error_curves
    from ropeode.study.horizon import Horizon, horizon
    from ropeode.study.node_paths import node_paths
    from ropeode.sweep.design.spec import SweepSpec, read_sweep
    from ropeode.sweep.run import run_sweep
    from ropeode.sweep.storage.load import load_sweep
    from ropeode.sweep.storage.summary import SweepSummary

_MODULES = {
    "analysis.equilibrium": ("hanging_equilibrium",),
    "analysis.errors": ("ErrorSeries", "error_series"),
    "analysis.lyapunov": ("LyapunovExponent", "lyapunov_exponent"),
    "analysis.motion": ("Motion", "Thresholds", "classify_motion"),
    "analysis.order": ("ObservedOrder", "observed_order"),
    "analysis.stability": ("growth_per_frame", "stability_limit"),
    "case_studies.report": ("Report", "rope_report"),
    "errors": ("InputError", "ReferenceRefused", "RopeodeError", "UserCodeError"),
    "checking.check": ("check_stepper",),
    "checking.grade": ("grade",),
    "checking.problems": ("CheckArgs",),
    "checking.report": ("CheckReport",),
    "problems.ensemble": ("Ensemble",),
    "problems.inextensible_rope": ("InextensibleRope",),
    "problems.links": ("LinearDamping", "Links"),
    "problems.problem": ("Problem",),
    "problems.rope": ("Rope",),
    "references.ensemble": ("each_reference",),
    "references.reference": ("Reference", "reference"),
    "references.files.library": ("load",),
    "references.files.store": ("load_reference", "save_reference"),
    "references.files.verify": ("Verification", "verify_reference"),
    "render.formats": (
        "format_check",
        "format_horizon",
        "format_report",
        "format_table",
    ),
    "render.plots.animation": ("animate",),
    "render.plots.convergence": ("plot_convergence",),
    "render.plots.energy": ("plot_energies",),
    "render.plots.error": ("plot_errors",),
    "render.plots.horizon": ("plot_horizon",),
    "render.plots.sweep_map": ("plot_sweep",),
    "simulation": ("Trajectories", "Trajectory", "simulate", "simulate_chunks"),
    "steppers.base": ("ProblemClass", "Stepper", "System"),
    "steppers.phase": ("Phase",),
    "steppers.stepper_loading": ("as_stepper",),
    "study.accuracy_table": ("AccuracyTable", "accuracy_table"),
    "study.curves": ("energy_curves", "error_curves"),
    "study.horizon": ("Horizon", "horizon"),
    "study.node_paths": ("node_paths",),
    "sweep.storage.load": ("load_sweep",),
    "sweep.run": ("run_sweep",),
    "sweep.design.spec": ("SweepSpec", "read_sweep"),
    "sweep.storage.summary": ("SweepSummary",),
}
_HOME = {name: module for module, names in _MODULES.items() for name in names}

__all__ = [
    "AccuracyTable",
    "CheckArgs",
    "CheckReport",
    "Ensemble",
    "ErrorSeries",
    "Horizon",
    "InextensibleRope",
    "InputError",
    "LinearDamping",
    "Links",
    "LyapunovExponent",
    "Motion",
    "ObservedOrder",
    "Phase",
    "Problem",
    "ProblemClass",
    "Reference",
    "ReferenceRefused",
    "Report",
    "Rope",
    "RopeodeError",
    "Stepper",
    "SweepSpec",
    "SweepSummary",
    "System",
    "Thresholds",
    "Trajectories",
    "Trajectory",
    "UserCodeError",
    "Verification",
    "accuracy_table",
    "animate",
    "as_stepper",
    "check_stepper",
    "classify_motion",
    "each_reference",
    "energy_curves",
    "error_curves",
    "error_series",
    "format_check",
    "format_horizon",
    "format_report",
    "format_table",
    "grade",
    "growth_per_frame",
    "hanging_equilibrium",
    "horizon",
    "load",
    "load_reference",
    "load_sweep",
    "lyapunov_exponent",
    "node_paths",
    "observed_order",
    "plot_convergence",
    "plot_energies",
    "plot_errors",
    "plot_horizon",
    "plot_sweep",
    "read_sweep",
    "reference",
    "rope_report",
    "run_sweep",
    "save_reference",
    "simulate",
    "simulate_chunks",
    "stability_limit",
    "verify_reference",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'ropeode' has no attribute {name!r}")
    return getattr(importlib.import_module(f"ropeode.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
