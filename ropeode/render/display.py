"""Problems, references, runs and curves, as a line and as a page.

Results that are reports of their own are written in the modules of their formats.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable
from typing import Any

import numpy as np

from ropeode.analysis.errors import ErrorSeries
from ropeode.analysis.lyapunov import LyapunovExponent
from ropeode.analysis.motion import Motion
from ropeode.checking.trajectories.studies import TrajectoryErrors
from ropeode.problems.ensemble import Ensemble
from ropeode.problems.no_equations import NoEquations
from ropeode.problems.problem import Problem
from ropeode.references.certificate import Certificate
from ropeode.references.files.verify import Verification
from ropeode.references.reference import Reference
from ropeode.render.markup import Block, Grid, Heading, Paragraph
from ropeode.render.reference import claim, sparkline, value_words
from ropeode.render.table_words import (
    RUN_HEADERS,
    error_cell,
    error_words,
    interval,
    observed_words,
    problem_words,
    reference_words,
    trust_words,
)
from ropeode.simulation import JaxStepper, Trajectories, Trajectory
from ropeode.study.curves import Curve, ErrorCurves
from ropeode.study.energy import EnergyCurves
from ropeode.study.node_paths import NodePath, NodePaths
from ropeode.validation import counted

_FACTS = ("", "")


@functools.singledispatch
def line(result: Any) -> str:
    """A result in a line, without its type."""
    raise TypeError(f"nobody has written how a {type(result).__name__} looks")


@functools.singledispatch
def blocks(result: Any) -> list[Block]:
    """A result as a page; by default its line."""
    return [Paragraph(f"{type(result).__name__}: {line(result)}")]


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
    return [Heading(f"Problem: {problem.name}"), _grid(facts)]


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


@line.register
def _(certificate: Certificate) -> str:
    return _certified(certificate)


@blocks.register
def _(certificate: Certificate) -> list[Block]:
    return [Heading("Certificate"), *_certificate(certificate, None)]


def _certified(certificate: Certificate) -> str:
    """The solver, the bound of the first quantity, and how far it is trusted."""
    series = next(iter(certificate.bounds.values()))
    bound = series[certificate.trusted - 1]
    return f"{certificate.solver}, estimated bound {bound:.1e}, {trust_words(certificate)}"


def _certificate(certificate: Certificate, times: np.ndarray | None) -> list[Block]:
    """The claim, the bounds over time, and the runs that they rest on."""
    bounds = {name: each[: certificate.trusted] for name, each in certificate.bounds.items()}
    rows = [
        (name, f"{np.min(each):.1e}", sparkline(each), f"{np.max(each):.1e}")
        for name, each in bounds.items()
    ]
    end = "" if times is None else f" to t = {times[certificate.trusted - 1]:g}"
    witnesses = [
        (str(each.solver), f"{each.tolerance:.0e}", each.role, f"{each.difference:.1e}")
        for each in certificate.witnesses
    ]
    return [
        Paragraph(claim(certificate)),
        Grid(("error bound", "least", f"over time{end}", "most"), rows, left=frozenset({0, 2})),
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
def _(errors: TrajectoryErrors) -> str:
    (each,) = errors.orders
    files = counted(len(errors.rows), "file")
    return f"{problem_words(errors.problem)}; {files}; order: {observed_words(each.order)}"


@blocks.register
def _(errors: TrajectoryErrors) -> list[Block]:
    (each,) = errors.orders
    order = each.order
    runs = [(f"{row.dt:.4g}", error_cell(row.error_max, row.resolution)) for row in errors.rows]
    return [
        Heading(f"Errors of {each.stepper}: {problem_words(errors.problem)}"),
        Paragraph(error_words(errors)),
        Grid(RUN_HEADERS[1:3], runs, left=frozenset()),
        Paragraph(f"Observed order: {observed_words(order)}, 95% interval {interval(order)}."),
        Paragraph(reference_words(errors)),
    ]


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


def _grid(facts: dict[str, str]) -> Grid:
    return Grid(_FACTS, list(facts.items()), left=frozenset({0, 1}), long=frozenset({1}))
