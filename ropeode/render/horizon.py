"""A horizon study: when which digit is lost, and what longer spans need."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any

import numpy as np

from ropeode.norms import NORMS
from ropeode.problems import rope_of
from ropeode.render import table_words
from ropeode.render.markup import Block, Grid, Heading, Paragraph
from ropeode.render.results import blocks, line, rows
from ropeode.study import Growth, Horizon, Run

# Digits that are left where errors are a few units of rounding.
_KEPT = 14
_RUNS = ("run", "tolerance", "role", "steps", "largest error", "digits left")
_DIGITS = ("digits left", "reference", "luckiest run", "certificate")
_NEEDS = ("span", "digits lost", "digits needed", "95% interval", "bits", "known by")


@rows.register
def _(study: Horizon) -> list[dict[str, Any]]:
    """One for each sample: the bound, each run's error, and the digits lost."""
    columns = {"time": study.times, "bound": study.bound}
    kinds: Counter[str] = Counter()
    for run in study.runs:
        kind = f"{run.role} {run.solver} {run.tolerance:.0e}"
        kinds[kind] += 1
        # There are two runs whose rounding is moved.
        columns[kind if kinds[kind] == 1 else f"{kind}, {kinds[kind]}"] = run.errors
    columns["digits lost in extended precision"] = study.lost
    samples = zip(*(column.tolist() for column in columns.values()), strict=True)
    return [dict(zip(columns, values, strict=True)) for values in samples]


@line.register
def _(study: Horizon) -> str:
    trust = table_words.trust_words(study.reference.certificate)
    return f"{table_words.problem_words(study.problem)}; float64 {trust}"


@blocks.register
def _(study: Horizon) -> list[Block]:
    parts: list[Block] = [
        Heading(f"Horizon of float64 references: {table_words.problem_words(study.problem)}"),
        Paragraph(truth_words(study)),
        Grid(_RUNS, [_run_cells(study, run) for run in study.runs], left=frozenset({0, 2})),
        Paragraph(loss_words(study)),
    ]
    if _loses(study):
        digits = [
            (str(each.digits), _time(each.reference), _time(each.luckiest), _time(each.certificate))
            for each in study.digits_left
        ]
        parts += [Grid(_DIGITS, digits, left=frozenset())]
    parts += [Paragraph(words) for words in growth_words(study)]
    parts += [
        Paragraph(
            f"Working precision for {study.digits} digits at the end of a span (in "
            f"{unit(study)}s); the bits are those of the interval's upper end:"
        ),
        Grid(_NEEDS, need_rows(study), left=frozenset({5})),
    ]
    return parts


def need_rows(study: Horizon) -> list[tuple[str, ...]]:
    """The cells of the table of what spans need."""
    return [
        (
            f"{each.span:g}",
            f"{each.lost:.1f}",
            f"{each.digits:.1f}",
            "-" if each.measured else f"[{each.interval[0]:.1f}, {each.interval[1]:.1f}]",
            str(each.bits),
            "measurement" if each.measured else "prediction",
        )
        for each in study.needs
    ]


def truth_words(study: Horizon) -> str:
    """What is compared with what."""
    truth, words = study.truth, NORMS[f"{study.problem.quantities[0]}-max"].words
    reach = (
        "to the end"
        if truth.agreed == len(study.problem.ts)
        else f"up to t = {study.times[-1]:g} only ({truth.failure})"
    )
    return (
        f"Errors: {words}, against heyoka Taylor series with {truth.coarse.precision} and "
        f"{truth.fine.precision} bits, which agree to {study.digits} digits {reach}. Digits are "
        f"counted against the largest component, {study.size:.4g}."
    )


def loss_words(study: Horizon) -> str:
    """Where the trust ends, and whether the bound holds."""
    trust = table_words.trust_words(study.reference.certificate)
    words = (
        f"The certificate: {trust}. Inside, the reference's error is at most "
        f"{study.worst_cover:.2f} of the bound."
    )
    if not _loses(study):
        return f"{words} Only rounding is lost: {_KEPT} digits are left at every sample."
    return f"{words} First times at which fewer digits are left:"


def _loses(study: Horizon) -> bool:
    """Whether the reference loses more than rounding does anywhere."""
    return any(each.reference is not None and each.digits <= _KEPT for each in study.digits_left)


def growth_words(study: Horizon) -> list[str]:
    """How differences grow, and the exponent."""
    per = f"per {unit(study)}"
    exponent, rate = study.exponent, study.exponent.value
    low, high = exponent.interval
    meaning = {
        "positive": f"{rate / math.log(10):.3f} digits {per}, in the end, at any precision",
        "negative": "neighbouring solutions converge, and no digit is lost for long",
        "not told from zero": "growth, if any, is slower than this span can show",
    }[exponent.sign]
    return [
        f"Growth of the differences of float64 runs: {_growth_words(study.float64_growth, per)}. "
        f"Of the runs in extended precision: {_growth_words(study.extended_growth, per)}.",
        f"Largest Lyapunov exponent: {rate:.3g} [{low:.3g}, {high:.3g}] {per}, over t = "
        f"{exponent.times[len(exponent.times) // 2]:g} to {exponent.times[-1]:g}: {meaning}.",
    ]


def unit(study: Horizon) -> str:
    """The unit of the problem's time."""
    return "frame" if rope_of(study.problem) else "time unit"


def _growth_words(growth: Growth | None, per: str) -> str:
    if growth is None:
        return "less than a digit above rounding"
    low, high = growth.interval
    law = {
        "exponential": f"exponential, rate {growth.rate:.3g} [{low:.3g}, {high:.3g}] {per}",
        "algebraic": f"like t to the {growth.rate:.2g} [{low:.2g}, {high:.2g}]",
    }[growth.law]
    return f"{law}, t = {growth.start:g} to {growth.end:g}"


def _run_cells(study: Horizon, run: Run) -> tuple[str, ...]:
    largest = float(np.max(run.errors))
    arrived = math.isfinite(largest)
    left = -math.log10(max(largest / study.size, 1e-16)) if arrived else 0.0
    return (
        str(run.solver),
        f"{run.tolerance:.0e}",
        run.role,
        str(run.steps),
        f"{largest:.1e}" if arrived else "ended early",
        f"{max(left, 0.0):.1f}" if arrived else "-",
    )


def _time(time: float | None) -> str:
    return "-" if time is None else f"{time:g}"
