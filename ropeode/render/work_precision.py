"""A work-precision study: what errors cost, and the runs that show it."""

from __future__ import annotations

from typing import Any

from ropeode.render import table_words
from ropeode.render.markup import Block, Grid, Heading, Paragraph
from ropeode.render.results import blocks, line, rows
from ropeode.study import COSTS, RUN_LIMIT, TARGETS, Cost, CostToReach, WorkPrecision, WorkRow
from ropeode.validation import counted

COST_WORDS: dict[Cost, str] = {
    "seconds": "milliseconds",
    "rhs_evaluations": "evaluations of the right-hand side",
    "steps": "steps",
}
RUN_HEADERS = ("effort", "max error", "/ tol", "RHS evals", "steps", "ms", "range", "")
_ON_FRONT = "*"
_KEY = (
    "In brackets: how many times the cost of the best method. *: the best of its family. <: at "
    "most that, which is the cost of a run with a smaller error. -: no run is known to reach it, "
    "and nothing is extrapolated."
)


@line.register
def _(study: WorkPrecision) -> str:
    words = f"{table_words.problem_words(study.problem)}; {counted(len(study.rows), 'run')}"
    return f"{words} of {counted(len(study.methods), 'method')}"


@blocks.register
def _(study: WorkPrecision) -> list[Block]:
    parts: list[Block] = [
        Heading(f"Work and precision: {table_words.problem_words(study.problem)}"),
        Paragraph(error_words(study)),
    ]
    for cost in COSTS:
        parts += [Paragraph(f"Least {COST_WORDS[cost]} known to reach a max error:")]
        parts += [_reached_grid(study, cost)]
    front = study.front()
    runs = [
        (f"{row.method} ({row.family})", *run_cells(study, row, row in front)) for row in study.rows
    ]
    parts += [
        Paragraph(_KEY),
        Paragraph(run_words(study)),
        Grid(("method", *RUN_HEADERS), runs, left=frozenset({0})),
    ]
    if whys := _whys(study):
        parts += [Paragraph(f"Runs without an error: {'; '.join(whys)}.")]
    return [*parts, Paragraph(table_words.reference_words(study))]


def error_words(study: WorkPrecision) -> str:
    """Which error it is, and what is not told."""
    return (
        f"{table_words.error_words(study)} Below {study.resolution:.1e}, ten times the reference's "
        "estimated bound, an error is unresolved."
    )


def run_words(study: WorkPrecision) -> str:
    """What the columns of the runs hold."""
    limit = f", up to {study.run_limit:g} s each" if study.run_limit != RUN_LIMIT else ""
    return (
        "Runs: the effort is the number of steps per frame, or the relative tolerance; the "
        "absolute one is that times the scale of the state. A tolerance is no error: / tol is the "
        f"max error over the absolute one. ms: the median of {counted(study.rounds, 'round')} in "
        f"turns{limit}, without compiling, with the shortest and the longest. *: no other "
        "run is better in less time."
    )


def _whys(study: WorkPrecision) -> list[str]:
    """Why runs failed, or were not made; the first of each method."""
    found: dict[str, str] = {}
    for row in study.rows:
        if row.status in ("failed", "time limit", "step limit"):
            words = f"{row.method} at {effort_words(row)}: {(row.why or '').rstrip('.')}"
            found.setdefault(row.method, words)
    return list(found.values())


def effort_words(row: WorkRow) -> str:
    """The effort with its unit."""
    if row.rtol:
        return f"rtol {effort_cell(row)}"
    return f"{counted(round(row.effort), 'step')}/frame"


def effort_cell(row: WorkRow) -> str:
    """The effort as a number, a power of ten as such."""
    if row.rtol is None:
        return f"{row.effort:.0f}"
    digits, power = f"{row.effort:.2e}".split("e")
    return f"{float(digits):g}e{int(power)}"


def run_cells(study: WorkPrecision, row: WorkRow, on_front: bool) -> tuple[str, ...]:
    """One run as the cells under `RUN_HEADERS`."""
    over = row.error_over_tolerance
    span = ""
    if row.status == "ok" and row.seconds_min is not None and row.seconds_max is not None:
        span = f"{_ms(row.seconds_min)}-{_ms(row.seconds_max)}"
    return (
        effort_cell(row),
        error_words_of(study, row),
        "" if over is None or row.status != "ok" else f"{over:.2g}",
        "-" if row.rhs_evaluations is None else str(row.rhs_evaluations),
        "-" if row.steps is None else str(row.steps),
        "-" if row.seconds is None else _ms(row.seconds),
        span,
        _ON_FRONT * on_front,
    )


def error_words_of(study: WorkPrecision, row: WorkRow) -> str:
    """The largest error of a run, what it is below, or the status of a run that has none."""
    if row.status != "ok":
        return row.status
    return table_words.error_cell(row.error_max, study.resolution)


def _ms(seconds: float) -> str:
    return f"{1e3 * seconds:.3g}" if seconds < 10 else f"{1e3 * seconds:.0f}"


def _reached_grid(study: WorkPrecision, cost: Cost) -> Grid:
    by_target = [study.costs_to_reach(target, cost) for target in TARGETS]
    methods = [
        (of_method[0].method, *(_reached_cell(each, cost) for each in of_method))
        for of_method in zip(*by_target, strict=True)
    ]
    return Grid(("method", *(f"{target:g}" for target in TARGETS)), methods, left=frozenset({0}))


def _reached_cell(each: CostToReach, cost: Cost) -> str:
    if each.cost is None:
        return "-"
    value = _ms(each.cost) if cost == "seconds" else f"{each.cost:.0f}"
    ratio = each.ratio or 1.0
    times = f"{ratio:.2g}" if ratio < 100.0 else f"{ratio:.0f}"
    most, star = "<" * each.at_most, _ON_FRONT * each.best_of_family
    return f"{most}{value} ({times}){star}"


@rows.register
def _(study: WorkPrecision) -> list[dict[str, Any]]:
    """One for each run, with what the reference resolves and the fronts that it is on."""
    fronts = {cost: study.front(cost) for cost in COSTS}
    return [
        {
            **vars(row),
            "resolution": study.resolution,
            "energy_resolution": study.energy_resolution,
            **{f"on_front_of_{cost}": row in front for cost, front in fronts.items()},
        }
        for row in study.rows
    ]
