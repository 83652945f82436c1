"""The report run again, in every format."""

from __future__ import annotations

import csv
import dataclasses
import io
import json
from typing import Any

from ropeode.case_studies.claims import FAILS, HOLDS, predicted
from ropeode.case_studies.report import Judged, Moved, Reading, Report
from ropeode.render import markup
from ropeode.render.markup import Block, Grid, Heading, Paragraph
from ropeode.render.plain_text import wrapped

SCHEMA = "ropeode.report/1"
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
    return "\n".join([*lines, "", *wrapped(threshold_words(report)), ""])


def as_markdown(report: Report) -> str:
    """Two pipe tables between paragraphs."""
    return markup.markdown(blocks(report))


def as_latex(report: Report) -> str:
    """Two tabulars in the style of the booktabs package."""
    return markup.latex(blocks(report))


def as_html(report: Report) -> str:
    """A page that needs nothing beside it."""
    return markup.html_page(blocks(report))


def as_json(report: Report) -> str:
    """Schema `ropeode.report/1`; what does not exist is null."""
    return json.dumps(as_dict(report), indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def as_csv(report: Report) -> str:
    """One line for each figure."""
    lines = [_flat(_figure(each)) for each in report.figures]
    text = io.StringIO()
    names = list(dict.fromkeys(name for line in lines for name in line))
    writer = csv.DictWriter(text, fieldnames=names, lineterminator="\n")
    writer.writeheader()
    writer.writerows(lines)
    return text.getvalue()


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
    found: list[Block] = [
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
        found.append(
            Grid(
                ("figures", "claim", "measured", "verdict"),
                comparisons,
                left=frozenset(range(4)),
                long=frozenset({1, 2}),
            )
        )
    return [*found, Paragraph(threshold_words(report))]


def summary(report: Report) -> str:
    """How many claims hold."""
    verdicts = [each.verdict for each in report.figures]
    holds, fails = verdicts.count(HOLDS), verdicts.count(FAILS)
    some = len(verdicts) - holds - fails
    words = [
        f"{holds} hold{'s' * (holds == 1)}",
        f"{fails} {'does' if fails == 1 else 'do'} not",
        *([f"{some} hold{'s' * (some == 1)} for a while"] if some else []),
    ]
    count = f"{len(verdicts)} figure{'s' if len(verdicts) > 1 else ''}"
    return f"Of the claims of {count}, {', '.join(words)}."


def measured_words(each: Judged) -> str:
    """What was measured, and for how long."""
    return f"{each.measured}; {each.frames} frames" if each.frames else each.measured


def theory_words(each: Judged) -> str:
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
    """The thresholds, and the verdicts that hang on them."""
    t = report.thresholds
    said = (
        f"Thresholds: at rest below {t.speed:g} sqrt(gL) for {t.rest:g} sqrt(L/g); apart where "
        f"a spring is longer than {1 + t.stretch:g} rest lengths; a swing goes {t.swing:g} L past "
        "the vertical on both sides. Each was halved and doubled: "
    )
    if not report.moved:
        return said + "no verdict changes."
    return said + "; ".join(_moved_words(each) for each in report.moved) + "."


def _moved_words(each: Moved) -> str:
    meaning = " (listing)" if each.meaning == "listing" else ""
    return f"figure {each.figure}{meaning} is '{each.verdict}' at {each.threshold} {each.value:g}"


def _setting(each: Judged) -> tuple[str, ...]:
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


def _numbers(compared: Any) -> str:
    return ", ".join(str(number) for number in compared.comparison.figures)


def as_dict(report: Report) -> dict[str, Any]:
    """The report as nested plain values."""
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
        "thresholds": dataclasses.asdict(report.thresholds),
        "sensitive_to_thresholds": [dataclasses.asdict(each) for each in report.moved],
    }


def _figure(each: Judged) -> dict[str, Any]:
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


def _reading(reading: Reading) -> dict[str, Any]:
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


def _flat(figure: dict[str, Any]) -> dict[str, Any]:
    """A figure without its nested parts, but with its prediction."""
    meanings = figure.pop("meanings")
    first = meanings[0] if meanings else {}
    more = ("swings", "unsettled_at", "largest_stretch", "jitter", "predicted_rate")
    return {**figure, **{name: first.get(name) for name in more}}
