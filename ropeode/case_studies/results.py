"""The results of the report run again: what became of each claim, and how that reads."""

from __future__ import annotations

import dataclasses
from typing import Any, ClassVar

from ropeode.analysis import Motion, Thresholds
from ropeode.case_studies.claims import FAILS, HOLDS, TOO_SHORT, predicted
from ropeode.case_studies.comparisons import Compared
from ropeode.case_studies.figures import Figure, Meaning
from ropeode.display import Tabular
from ropeode.json_form import json_of, json_shows
from ropeode.render import Block, Grid, Heading, Paragraph, blocks, formatted, line, rows
from ropeode.simulation import Trajectory
from ropeode.theory import Growth
from ropeode.validation import check_kind

TITLE = "The published rope report, run again"

_HEADERS = ("figure", "stepper", "steps/frame", "damping", "claim", "verdict")


@json_shows(
    *("meaning", "damping", "measured", "verdict", "verdict_of_mirror_image=verdict_mirrored"),
    *("mirror_image_identical=mirrored", "motion=motion.verdict", "motion.diverged_at"),
    *("motion.settled_at", "motion.unsettled_at", "motion.swings", "motion.reached_vertical_at"),
    *("motion.largest_stretch", "motion.jitter", "predicted_rate=growth.rate"),
    *("predicted_stable=growth.stable", "growth.predicted_blow_up"),
    "stable_from_steps_per_frame=limit",
)
@dataclasses.dataclass(frozen=True, eq=False)
class Reading:
    """A figure under one of its meanings, measured.

    Arguments:
        meaning: `words`, or `listing` for what the printed program does.
        trajectory: of the rope that is drawn to the left.
        motion: what that rope did.
        mirrored: whether the rope drawn to the right did the same to the last bit, mirrored.
        growth: of disturbances of hanging still, by linear theory.
        limit: steps per frame from which on the stepper lets the rope hang still, by theory;
            None where there is no such number.
        measured: what the rope did, in words.
        verdict: on the claim.
        verdict_mirrored: on the claim, for the rope drawn to the right.
    """

    meaning: Meaning
    trajectory: Trajectory
    motion: Motion
    mirrored: bool
    growth: Growth
    limit: int | None
    measured: str
    verdict: str
    verdict_mirrored: str

    @property
    def damping(self) -> float:
        """The damping that was used."""
        return float(self.trajectory.problem.parameters["damping"])


@dataclasses.dataclass(frozen=True)
class ThresholdEffect:
    """A threshold that a verdict depends on.

    Arguments:
        figure: number of the figure.
        meaning: its meaning.
        threshold: name of the threshold.
        value: of the threshold, which changes the verdict.
        verdict: with that value.
    """

    figure: int
    meaning: Meaning
    threshold: str
    value: float
    verdict: str


@dataclasses.dataclass(frozen=True)
class RoundingEffect:
    """A measurement that changes with the last digits of the initial positions.

    Arguments:
        figure: number of the figure.
        meaning: its meaning.
        measure: `diverged_at`, `settled_at`, `unsettled_at` or `swings`.
        value: as it is reported; None if there is none.
        nudged: with the last digits changed; likewise.
        verdict: with the last digits changed.
    """

    figure: int
    meaning: Meaning
    measure: str
    value: int | None
    nudged: int | None
    verdict: str


@json_shows(
    *(f"figure.{name}" for name in ("figure", "stepper", "run_as", "steps_per_frame", "damping")),
    *(f"figure.{name}" for name in ("num_nodes", "claim", "words")),
    *("measured", "verdict", "motion.diverged_at", "motion.settled_at", "frames"),
    "meanings=readings",
)
@dataclasses.dataclass(frozen=True, eq=False)
class FigureResult:
    """A figure and what became of its claim.

    Arguments:
        figure: setting and claim.
        measured: what the rope did, in words.
        verdict: `holds`, `does not hold`, `holds until frame N` or, if it was not watched for long
            enough, `not watched long enough`.
        frames: that were watched; 0 where nothing moves.
        readings: one for each meaning, the report's words first; none where nothing moves.
    """

    figure: Figure
    measured: str
    verdict: str
    frames: int
    readings: tuple[Reading, ...]

    @property
    def motion(self) -> Motion | None:
        """What the rope did, as the report's words have it."""
        return self.readings[0].motion if self.readings else None


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Report(Tabular):
    """The report, run again.

    Arguments:
        figures: the chosen ones, by number.
        comparisons: those whose figures are all among them.
        thresholds: behind the words.
        sensitive_to_thresholds: verdicts that change where a threshold is halved or doubled.
        sensitive_to_rounding: measurements that change with the last digits of the start.

    Examples:
        >>> from ropeode import rope_report
        >>> report = rope_report([8], frames=20)
        >>> report.figures[0].figure.claim, report.figures[0].verdict
        ('diverges', 'not watched long enough')
    """

    SCHEMA: ClassVar[str] = "ropeode.report/1"

    figures: tuple[FigureResult, ...]
    comparisons: tuple[Compared, ...]
    thresholds: Thresholds
    sensitive_to_thresholds: tuple[ThresholdEffect, ...]
    sensitive_to_rounding: tuple[RoundingEffect, ...]


@line.register
def _(report: Report) -> str:
    return summary(report)


@blocks.register
def _(report: Report) -> list[Block]:
    figures = [
        (*_setting(each), measured_words(each), theory_words(each)) for each in report.figures
    ]
    comparisons = [
        (_numbers(each), each.comparison.claim, each.measured, each.verdict)
        for each in report.comparisons
    ]
    written: list[Block] = [
        Heading(TITLE),
        Paragraph(summary(report)),
        Grid(
            (*_HEADERS, "measured", "linear theory"),
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
        f"{figure.claim.replace('_', ' ')}: {figure.words}",
        each.verdict,
    )


def _numbers(compared: Compared) -> str:
    return ", ".join(str(number) for number in compared.comparison.figures)


@rows.register
def _(report: Report) -> list[dict[str, Any]]:
    """One for each figure, with the prediction for the report's words."""
    more = ("swings", "unsettled_at", "largest_stretch", "jitter", "predicted_rate")
    lines = []
    for each in report.figures:
        figure = json_of(each)
        first = next(iter(figure.pop("meanings")), {})
        lines.append({**figure, **{name: first.get(name) for name in more}})
    return lines


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
        The published rope report, run again
        <BLANKLINE>
        Of the claims of 1 figure, 0 hold, 0 do not, 1 was not watched long enough.
        ...
    """
    check_kind("report", report, Report, "rope_report")
    return formatted(report, form)
