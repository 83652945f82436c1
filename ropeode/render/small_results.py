"""Problems, references, runs and curves, as a line, as a page and in rows."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterable
from typing import Any

import numpy as np

from ropeode.analysis import ErrorSeries, LyapunovExponent, Motion
from ropeode.problems import Ensemble, NoEquations, Problem
from ropeode.references import Certificate, Reference, Verification
from ropeode.render.markup import Block, Grid, Heading, Paragraph
from ropeode.render.reference import certificate_claim, sparkline, value_words
from ropeode.render.results import blocks, line, rows
from ropeode.render.table_words import (
    problem_words,
    trust_words,
)
from ropeode.simulation import JaxStepper, Trajectories, Trajectory
from ropeode.study import Curve, EnergyCurves, ErrorCurves, NodePath, NodePaths
from ropeode.validation import counted

_AXES = "xyz"
_LETTERS = {"position": "", "velocity": "v"}


@line.register
def _(problem: Problem) -> str:
    return problem_words(problem)


@blocks.register
def _(problem: Problem) -> list[Block]:
    ts, parameters = problem.ts, dict(problem.parameters)
    kind = "first order" if problem.mechanics is None else "second order"
    if isinstance(problem.rhs, NoEquations):
        kind += "; the file that it was read from has no equations"
    known = [name for name in ("energy", "exact", "constraints") if getattr(problem, name)]
    facts = {
        "equation": kind,
        "state": f"{' x '.join(map(str, problem.y0.shape)) or 'one'} numbers",
        "time": f"{ts[0]:g} to {ts[-1]:g}, {len(ts)} samples",
        **({"known": ", ".join(known)} if known else {}),
        **{name.replace("_", " "): value_words(value) for name, value in parameters.items()},
    }
    grid = Grid(("", ""), list(facts.items()), left=frozenset({0, 1}), long=frozenset({1}))
    return [Heading(f"Problem: {problem.name}"), grid]


@line.register
def _(ensemble: Ensemble) -> str:
    return f"{len(ensemble)} problems; the first is {problem_words(ensemble.first)}"


@line.register
def _(reference: Reference) -> str:
    certificate = reference.certificate
    return f"{problem_words(reference.problem)}; {_certified(certificate)}"


@blocks.register
def _(reference: Reference) -> list[Block]:
    return [
        Heading(f"Reference: {problem_words(reference.problem)}"),
        *_certificate(reference.certificate, reference.times),
    ]


@blocks.register
def _(certificate: Certificate) -> list[Block]:
    return [Heading("Certificate"), *_certificate(certificate, None)]


@line.register
def _certified(certificate: Certificate) -> str:
    """The solver, the bound of the first quantity, and how far it is trusted."""
    series = next(iter(certificate.bounds.values()))
    bound = series[certificate.trusted - 1]
    return f"{certificate.solver}, estimated bound {bound:.1e}, {trust_words(certificate)}"


def _certificate(certificate: Certificate, times: np.ndarray | None) -> list[Block]:
    """The claim, the bounds over time, and the runs that they rest on."""
    bounds = {name: each[: certificate.trusted] for name, each in certificate.bounds.items()}
    ranges = [
        (name, f"{np.min(each):.1e}", sparkline(each), f"{np.max(each):.1e}")
        for name, each in bounds.items()
    ]
    end = "" if times is None else f" to t = {times[certificate.trusted - 1]:g}"
    witnesses = [
        (str(each.solver), f"{each.tolerance:.0e}", each.role, f"{each.difference:.1e}")
        for each in certificate.witnesses
    ]
    return [
        Paragraph(certificate_claim(certificate)),
        Grid(("error bound", "least", f"over time{end}", "most"), ranges, left=frozenset({0, 2})),
        Grid(("witness", "tolerance", "role", "difference"), witnesses, left=frozenset({0, 2})),
    ]


@line.register
def _(run: Trajectory) -> str:
    at = "" if run.diverged_at is None else f" at frame {run.diverged_at}"
    steps = counted(run.steps_per_frame, "step")
    return (
        f"{run.stepper.label}, {steps}/frame; {problem_words(run.problem)}; "
        f"{run.status}{at}, {counted(len(run.times), 'sample')}"
    )


@line.register
def _(own: JaxStepper) -> str:
    return f"{own.method.stepper.label}; {problem_words(own.problem)}"


@line.register
def _(runs: Trajectories) -> str:
    unsolved = int(np.sum(~runs.finite & ~runs.solved))
    diverged = len(runs) - int(np.sum(runs.finite)) - unsolved
    steps = counted(runs.steps_per_frame, "step")
    return (
        f"{counted(len(runs), 'run')} of {runs.stepper.label}, {steps}/frame; "
        f"{diverged or 'none'} diverged{f', {unsolved} unsolved' if unsolved else ''}"
    )


@line.register
def _(errors: ErrorSeries) -> str:
    sizes = (errors.max, errors.final, errors.rms)
    shown = [f"< {errors.finest:.1e}" if each is None else f"{each:.3e}" for each in sizes]
    return (
        f"{errors.norm.name}, t = {errors.times[0]:g} to {errors.times[-1]:g}; "
        f"max {shown[0]}, final {shown[1]}, rms {shown[2]}"
    )


@line.register
def _(curves: ErrorCurves) -> str:
    return f"{problem_words(curves.problem)}; {curves.norm.name} {_of(curves.curves)}"


@line.register
def _(curves: EnergyCurves) -> str:
    return f"{problem_words(curves.problem)}; energies {_of(curves.curves)}"


@line.register
def _(curve: Curve) -> str:
    return f"{curve.stepper}, {curve.label}; {counted(len(curve.values), 'sample')}"


@line.register
def _(paths: NodePaths) -> str:
    samples = counted(len(paths.times), "sample")
    return f"{problem_words(paths.problem)}; {samples} {_of(paths.paths)}"


@line.register
def _(path: NodePath) -> str:
    samples, nodes, _ = path.positions.shape
    return f"{path.stepper}; {counted(nodes, 'node')}, {counted(samples, 'sample')}"


def _of(runs: Iterable[Curve | NodePath]) -> str:
    names = [each.stepper for each in runs]
    some = ", ".join(dict.fromkeys(names))
    return f"of {counted(len(names), 'run')} ({some})"


@line.register
def _(motion: Motion) -> str:
    at = motion.largest_stretch_at
    return f"largest stretch {motion.largest_stretch:.2g} at frame {at}, jitter {motion.jitter:.1e}"


@line.register
def _(exponent: LyapunovExponent) -> str:
    low, high = exponent.interval
    return (
        f"{exponent.value:.4g} [{low:.4g}, {high:.4g}] per time unit, {exponent.sign}; "
        f"over {exponent.span:g} time units"
    )


@line.register
def _(verification: Verification) -> str:
    found = "agrees" if verification.agrees else "DISAGREES"
    count = f"{verification.samples} of {verification.of} samples"
    return f"{verification.path}: {found}, {count} compared"


@rows.register
def _(reference: Reference) -> dict[str, np.ndarray]:
    columns = _states(reference.problem, reference.times, reference.states)
    return {**columns, **bound_columns(reference.certificate, len(reference.times))}


@rows.register
def _(run: Trajectory) -> dict[str, np.ndarray]:
    return _states(run.problem, run.times, run.states)


@rows.register
def _(errors: ErrorSeries) -> dict[str, np.ndarray]:
    return {"time": errors.times, "error": errors.values, "resolution": errors.resolution}


@rows.register
def _(curves: ErrorCurves) -> list[dict[str, Any]]:
    return [point for each in curves.curves for point in _curve(each, "error")]


@rows.register
def _(curves: EnergyCurves) -> list[dict[str, Any]]:
    lines = []
    for each in curves.curves:
        # Outside the trust horizon the true energy, and so the error, is not a number.
        errors = itertools.chain(curves.errors(each).tolist(), itertools.repeat(float("nan")))
        points = zip(_curve(each, "energy"), errors, strict=False)
        lines += [{**point, "error": error} for point, error in points]
    return lines


@rows.register
def _(curve: Curve) -> list[dict[str, Any]]:
    return _curve(curve, "value")


def _curve(curve: Curve, name: str) -> list[dict[str, Any]]:
    run = {"stepper": curve.stepper, "run": curve.label, "dt": curve.dt}
    pairs = zip(curve.times.tolist(), curve.values.tolist(), strict=False)
    return [{**run, "time": time, name: value} for time, value in pairs]


@rows.register
def _(runs: Trajectories) -> dict[str, np.ndarray]:
    columns = [
        {"member": np.full(len(each.times), runs.start + index), **rows(each)}
        for index, each in enumerate(runs)
    ]
    return {name: np.concatenate([each[name] for each in columns]) for name in columns[0]}


@rows.register
def _(paths: NodePaths) -> list[dict[str, Any]]:
    return [
        {"stepper": path.stepper, "time": time, "node": node, **dict(zip(_AXES, x, strict=False))}
        for path in paths.paths
        for time, positions in zip(paths.times.tolist(), path.positions.tolist(), strict=False)
        for node, x in enumerate(positions)
    ]


@rows.register
def _(exponent: LyapunovExponent) -> dict[str, np.ndarray]:
    growth = {f"log_growth{index}": row for index, row in enumerate(exponent.log_growth)}
    return {"time": exponent.times, **growth}


@rows.register
def _(certificate: Certificate) -> list[dict[str, Any]]:
    names = ("tolerance", "role", "steps", "seconds", "difference")
    return [
        {"solver": str(each.solver), **{name: getattr(each, name) for name in names}}
        for each in certificate.witnesses
    ]


@rows.register
def _(verification: Verification) -> list[dict[str, Any]]:
    outside = verification.outside
    return [
        {"quantity": name, "distance": distance, "outside_at": outside.get(name)}
        for name, distance in verification.distances.items()
    ]


@rows.register
def _(motion: Motion) -> list[dict[str, Any]]:
    names = [*(field.name for field in dataclasses.fields(motion)), "energy_at_rest"]
    plain = {name: getattr(motion, name) for name in names}
    numbers = {n: each for n, each in plain.items() if isinstance(each, (int, float, str))}
    return [numbers]


def _states(problem: Problem, times: np.ndarray, states: np.ndarray) -> dict[str, np.ndarray]:
    """The time, and each number of the state under a name such as ``x0``, ``vy3`` or ``y2``."""
    columns = {"time": times}
    for quantity in problem.quantities:
        values = problem.quantity(quantity, states)
        for node, axis in itertools.product(*map(range, values.shape[1:])):
            if problem.mechanics is None:
                name = f"y{node}"
            else:
                name = f"{_LETTERS[quantity]}{_AXES[axis : axis + 1] or f'x{axis}_'}{node}"
            columns[name] = values[:, node, axis]
    return columns


def bound_columns(certificate: Certificate, samples: int) -> dict[str, np.ndarray]:
    """The bound of each quantity; not a number outside the trust horizon."""
    columns = {}
    for quantity, series in certificate.bounds.items():
        bound = np.full(samples, np.nan)
        bound[: certificate.trusted] = series[: certificate.trusted]
        columns[f"{quantity}_bound"] = bound
    return columns
