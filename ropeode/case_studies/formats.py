"""The rope report in every format."""

from __future__ import annotations

from typing import Any, Literal

from ropeode.case_studies.claims import FAILS, HOLDS, TOO_SHORT, predicted
from ropeode.case_studies.comparisons import Compared
from ropeode.case_studies.report import FigureResult, Reading, Report
from ropeode.case_studies.report_form import FigureForm, ReadingForm, ReportForm
from ropeode.render.formats import formats_of, formatted
from ropeode.render.markup import Block, Grid, Heading, Paragraph
from ropeode.render.text_layout import wrapped
from ropeode.validation import check_kind

SCHEMA: Literal["ropeode.report/1"] = "ropeode.report/1"
TITLE = "The published rope report, run again"

_HEADERS = ("figure", "stepper", "steps/frame", "damping", "claim", "verdict")


def as_text(report: Report) -> str:
    """A row for each figure with what was measured below it, for 80 columns."""
    lines = [*wrapped(f"{TITLE}. {summary(report)}"), "", _row(_HEADERS)]
    for each in report.figures:
        lines.append(_row(_setting(each)))
        lines += wrapped(f"claim: {_setting(each)[4]}: {each.figure.words}", 4)
        lines += wrapped(f"measured: {measured_words(each)}", 4)
        if theory := theory_words(each):
            lines += wrapped(f"theory: {theory}", 4)
    if report.comparisons:
        lines += ["", "Comparisons"]
    for compared in report.comparisons:
        lines += wrapped(f"{_numbers(compared)}: {compared.comparison.claim}", 0)
        lines += wrapped(f"{compared.verdict}. {compared.measured}", 4)
    for words in (threshold_words(report), rounding_words(report)):
        lines += ["", *wrapped(words)]
    return "\n".join([*lines, ""])


def line(report: Report) -> str:
    """How many claims hold."""
    return summary(report)


def blocks(report: Report) -> list[Block]:
    """The figures, the comparisons, and the words around them."""
    figures = [
        (*_setting(each), measured_words(each), theory_words(each), str(each.frames or "-"))
        for each in report.figures
    ]
    comparisons = [
        (_numbers(each), each.comparison.claim, each.measured, each.verdict)
        for each in report.comparisons
    ]
    written: list[Block] = [
        Heading(TITLE),
        Paragraph(summary(report)),
        Grid(
            (*_HEADERS, "measured", "linear theory", "frames"),
            figures,
            left=frozenset({1, 4, 5, 6, 7}),
            long=frozenset({4, 6, 7}),
        ),
    ]
    if comparisons:
        written.append(
            Grid(
                ("figures", "claim", "measured", "verdict"),
                comparisons,
                left=frozenset(range(4)),
                long=frozenset({1, 2}),
            )
        )
    return [*written, Paragraph(threshold_words(report)), Paragraph(rounding_words(report))]


def summary(report: Report) -> str:
    """How many claims hold."""
    verdicts = [each.verdict for each in report.figures]
    holds, fails = verdicts.count(HOLDS), verdicts.count(FAILS)
    short = verdicts.count(TOO_SHORT)
    some = len(verdicts) - holds - fails - short
    words = [
        f"{holds} hold{'s' * (holds == 1)}",
        f"{fails} {'does' if fails == 1 else 'do'} not",
        *([f"{some} hold{'s' * (some == 1)} for a while"] if some else []),
        *([f"{short} {'was' if short == 1 else 'were'} not watched long enough"] if short else []),
    ]
    count = f"{len(verdicts)} figure{'s' if len(verdicts) > 1 else ''}"
    return f"Of the claims of {count}, {', '.join(words)}."


def measured_words(each: FigureResult) -> str:
    """What was measured, and for how long."""
    return f"{each.measured}; {each.frames} frames" if each.frames else each.measured


def theory_words(each: FigureResult) -> str:
    """What the eigenvalues at the hanging equilibrium predict."""
    if not each.readings:
        return ""
    reading = each.readings[0]
    needs = f"stable from {reading.limit} steps/frame on"
    if reading.limit is None:
        needs = "unstable at any step size"
    elif reading.limit == 1:
        needs = "stable at any whole number of steps/frame"
    return f"{predicted(reading.growth)}; {needs}"


def threshold_words(report: Report) -> str:
    """The thresholds, and the verdicts that depend on them."""
    t = report.thresholds
    words = (
        f"Thresholds: at rest below {t.speed:g} sqrt(gL) for {t.rest:g} sqrt(L/g); apart where "
        f"a spring is longer than {1 + t.stretch:g} rest lengths; a swing goes {t.swing:g} L past "
        "the vertical on both sides. Each was halved and doubled: "
    )
    effects = "; ".join(
        f"figure {each.figure}{_listing(each)} is '{each.verdict}' at {each.threshold} "
        f"{each.value:g}"
        for each in report.sensitive_to_thresholds
    )
    return f"{words}{effects or 'no verdict changes'}."


def rounding_words(report: Report) -> str:
    """The figures whose measurements depend on rounding."""
    words = "Rounding: each rope was run again with the last digits of its start changed: "
    effects: dict[str, list[str]] = {}
    for each in report.sensitive_to_rounding:
        change = f"{_MEASURES[each.measure]} {_or_none(each.value)} becomes {_or_none(each.nudged)}"
        effects.setdefault(f"figure {each.figure}{_listing(each)}", []).append(change)
    changes = "; ".join(f"{name}: {', '.join(each)}" for name, each in effects.items())
    return f"{words}{changes or 'no measurement changes'}."


_MEASURES = {
    "diverged_at": "apart at",
    "settled_at": "at rest from",
    "unsettled_at": "at rest to",
    "swings": "swings",
}


def _or_none(value: int | None) -> str:
    return "none" if value is None else str(value)


def _listing(each: Any) -> str:
    return " (listing)" if each.meaning == "listing" else ""


def _setting(each: FigureResult) -> tuple[str, ...]:
    figure = each.figure
    moves = figure.run_as is not None
    return (
        str(figure.figure),
        (figure.run_as or "-").split(":")[0],
        str(figure.steps_per_frame) if moves else "-",
        f"{figure.damping:g}" if moves else "-",
        figure.claim.replace("_", " "),
        each.verdict,
    )


def _row(cells: tuple[str, ...]) -> str:
    figure, stepper, steps, damping, _, verdict = cells
    return f"{figure:>6}  {stepper:<19} {steps:>11} {damping:>8}  {verdict}"


def _numbers(compared: Compared) -> str:
    return ", ".join(str(number) for number in compared.comparison.figures)


def as_dict(report: Report) -> ReportForm:
    """The report in its JSON form."""
    return {
        "schema": SCHEMA,
        "figures": [_figure(each) for each in report.figures],
        "comparisons": [
            {
                "figures": list(each.comparison.figures),
                "claim": each.comparison.claim,
                "measured": each.measured,
                "verdict": each.verdict,
            }
            for each in report.comparisons
        ],
        "thresholds": report.thresholds,
        "sensitive_to_thresholds": list(report.sensitive_to_thresholds),
        "sensitive_to_rounding": list(report.sensitive_to_rounding),
    }


def _figure(each: FigureResult) -> FigureForm:
    figure = each.figure
    first = _reading(each.readings[0]) if each.readings else {}
    return {
        "figure": figure.figure,
        "stepper": figure.stepper,
        "run_as": figure.run_as,
        "steps_per_frame": figure.steps_per_frame,
        "damping": figure.damping,
        "num_nodes": figure.num_nodes,
        "claim": figure.claim,
        "words": figure.words,
        "measured": each.measured,
        "verdict": each.verdict,
        "diverged_at": first.get("diverged_at"),
        "settled_at": first.get("settled_at"),
        "frames": each.frames,
        "meanings": [_reading(reading) for reading in each.readings],
    }


def _reading(reading: Reading) -> ReadingForm:
    motion, growth = reading.motion, reading.growth
    return {
        "meaning": reading.meaning,
        "damping": float(reading.trajectory.problem.parameters["damping"]),
        "measured": reading.measured,
        "verdict": reading.verdict,
        "verdict_of_mirror_image": reading.verdict_mirrored,
        "mirror_image_identical": reading.mirrored,
        "motion": motion.verdict,
        "diverged_at": motion.diverged_at,
        "settled_at": motion.settled_at,
        "unsettled_at": motion.unsettled_at,
        "swings": motion.swings,
        "reached_vertical_at": motion.reached_vertical_at,
        "largest_stretch": motion.largest_stretch,
        "jitter": motion.jitter,
        "predicted_rate": growth.rate,
        "predicted_stable": growth.stable,
        "predicted_blow_up": growth.predicted_blow_up,
        "stable_from_steps_per_frame": reading.limit,
    }


def as_lines(report: Report) -> list[dict[str, Any]]:
    """One line for each figure, with the prediction for the report's words."""
    more = ("swings", "unsettled_at", "largest_stretch", "jitter", "predicted_rate")
    lines = []
    for each in report.figures:
        line = dict(_figure(each))
        del line["meanings"]
        first = _reading(each.readings[0]) if each.readings else {}
        lines.append({**line, **{name: first.get(name) for name in more}})
    return lines


FORMATS = formats_of(as_text, blocks, as_lines, as_dict)


def format_report(report: Report, form: str = "text") -> str:
    """A report as text.

    Arguments:
        report: from `ropeode.rope_report`.
        form: `text`, `markdown`, `latex`, `csv`, `json` or `html`.

    Raises:
        InputError: there is no such format.

    Examples:
        >>> from ropeode import format_report, rope_report
        >>> print(format_report(rope_report([8], frames=20)))
        The published rope report, run again. Of the claims of 1 figure, 0 hold, 0 do
        not, 1 was not watched long enough.
        ...
    """
    check_kind("report", report, Report, "rope_report")
    return formatted(report, form, FORMATS)
