"""The published rope report, run again: what became of each of its claims."""

from __future__ import annotations

import dataclasses
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from ropeode.analysis.motion import DEFAULTS, Motion, Thresholds, classify_motion, sensitivity
from ropeode.case_studies import claims
from ropeode.case_studies.comparisons import Compared, compared
from ropeode.case_studies.figures import ENDS, Figure, Meaning, all_comparisons, check_figures
from ropeode.case_studies.runs import (
    Images,
    Run,
    code_fingerprint,
    frames_for,
    growth_of,
    run_all,
    stable_from,
)
from ropeode.display import Tabular
from ropeode.problems.rope import Rope
from ropeode.progress import Progress, bar, shows_progress
from ropeode.simulation import Trajectory
from ropeode.theory import Growth
from ropeode.validation import check_whole

# What a change of the last digits must leave as it is.
_MEASURES = ("diverged_at", "settled_at", "unsettled_at", "swings")


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


@dataclasses.dataclass(frozen=True, eq=False)
class FigureResult:
    """A figure and what became of its claim.

    Arguments:
        figure: setting and claim.
        measured: what the rope did, in words.
        verdict: `holds`, `does not hold` or `holds until frame N`.
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
class Report(Tabular, written_by="ropeode.case_studies.formats"):
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

    figures: tuple[FigureResult, ...]
    comparisons: tuple[Compared, ...]
    thresholds: Thresholds
    sensitive_to_thresholds: tuple[ThresholdEffect, ...]
    sensitive_to_rounding: tuple[RoundingEffect, ...]


@shows_progress
def rope_report(
    figures: Sequence[int] | None = None,
    frames: int | None = None,
    *,
    folder: Path | None = None,
    progress: Progress = bar,
) -> Report:
    """Run figures of the published rope report again and test their claims.

    Arguments:
        figures: numbers from 1 to 41; all where there are none.
        frames: how long each rope is watched; by default 4000 frames, or longer where linear
            theory needs it to show a rope at rest, or apart.
        folder: where finished runs are kept until all are done, so that an interrupted report
            goes on from there; None keeps nothing.
        progress: called with what has been finished and the fraction that is done.

    Raises:
        InputError: there is no such figure, or `frames` is not a whole number >= 1.

    Examples:
        >>> from ropeode import rope_report
        >>> rope_report([8], frames=20)
        <Report: Of the claims of 1 figure, 0 hold, 0 do not, 1 was not watched long enough.>
    """
    chosen = check_figures(figures)
    if frames is not None:
        frames = check_whole("frames", frames, at_least=1, example="1000")
    progress("linear stability", 0.0)
    runs: dict[tuple[Figure, Meaning], Run] = {}
    for figure in chosen:
        length = frames or frames_for(map(figure.setting, figure.meanings))
        for meaning in figure.meanings:
            runs[figure, meaning] = Run(figure.setting(meaning), length)
    kept = folder / code_fingerprint() if folder else None
    images = run_all(set(runs.values()), kept, progress)

    results: list[FigureResult] = []
    by_threshold: list[ThresholdEffect] = []
    by_rounding: list[RoundingEffect] = []
    for figure in chosen:
        progress(f"testing the claim of figure {figure.figure}", 1.0)
        readings = []
        for meaning in figure.meanings:
            run = runs[figure, meaning]
            readings.append(_reading(figure, meaning, run, images[run]))
            by_threshold += _threshold_effects(figure, readings[-1])
            by_rounding += _rounding_effects(figure, readings[-1], images[run].nudged)
        results.append(_result(figure, readings))
    if kept:
        shutil.rmtree(kept, ignore_errors=True)
    return Report(
        figures=tuple(results),
        comparisons=_comparisons(results),
        thresholds=DEFAULTS,
        sensitive_to_thresholds=tuple(by_threshold),
        sensitive_to_rounding=tuple(by_rounding),
    )


def _reading(figure: Figure, meaning: Meaning, run: Run, images: Images) -> Reading:
    motion, motion_right = classify_motion(images.left), classify_motion(images.right)
    growth = growth_of(run.setting)
    return Reading(
        meaning=meaning,
        trajectory=images.left,
        motion=motion,
        mirrored=images.mirrored,
        growth=growth,
        limit=stable_from(run.setting),
        measured=claims.measured(motion, growth),
        verdict=claims.verdict(figure.claim, motion, growth),
        verdict_mirrored=claims.verdict(figure.claim, motion_right, growth),
    )


def _threshold_effects(figure: Figure, reading: Reading) -> Iterator[ThresholdEffect]:
    """The thresholds that change a verdict when they are halved or doubled.

    That a claim ends at another frame is no other verdict.
    """
    for each in sensitivity(reading.trajectory):
        verdict = claims.verdict(figure.claim, each.words, reading.growth)
        if verdict.rstrip("0123456789") != reading.verdict.rstrip("0123456789"):
            yield ThresholdEffect(
                figure.figure, reading.meaning, each.threshold, each.value, verdict
            )


def _rounding_effects(
    figure: Figure, reading: Reading, nudged: Trajectory
) -> Iterator[RoundingEffect]:
    """The measurements that come out otherwise once the last digits are changed."""
    motion = classify_motion(nudged)
    verdict = claims.verdict(figure.claim, motion, reading.growth)
    for measure in _MEASURES:
        value, other = getattr(reading.motion, measure), getattr(motion, measure)
        if value != other:
            yield RoundingEffect(figure.figure, reading.meaning, measure, value, other, verdict)


def _result(figure: Figure, readings: Sequence[Reading]) -> FigureResult:
    if not readings:
        return FigureResult(figure, *_drawn(figure), 0, ())
    first, *others = readings
    measured = first.measured
    for other in others:
        if figure.damping:
            measured += f"; as the listing has it (no damping): {other.measured}, {other.verdict}"
    for each in readings:
        if each.verdict_mirrored != each.verdict:
            measured += f"; mirror image: {each.verdict_mirrored}"
        elif not each.mirrored:
            measured += "; mirror image: the same but for rounding"
    frames = first.trajectory.problem.frames
    return FigureResult(figure, measured, first.verdict, frames, tuple(readings))


def _drawn(figure: Figure) -> tuple[str, str]:
    """Whether a rope that does not move can be drawn as the figure has it, in both images."""
    holds = True
    for end in ENDS:
        problem = Rope(end=end, num_nodes=figure.num_nodes).problem(1)
        places = problem.positions(problem.y0[None])[0]
        gaps = np.linalg.norm(np.diff(places, axis=0), axis=1)
        even = bool(np.ptp(gaps) <= 1e-12 * np.max(gaps))
        holds &= even and np.array_equal(places[[0, -1]], [Rope().start, end])
    measured = f"{figure.num_nodes} nodes, evenly spaced from (0, 200) to (±400, 200)"
    return measured, claims.HOLDS if holds else claims.FAILS


def _comparisons(results: Sequence[FigureResult]) -> tuple[Compared, ...]:
    motions = {each.figure.figure: each.motion for each in results if each.motion is not None}
    return tuple(
        compared(comparison, [motions[number] for number in comparison.figures])
        for comparison in all_comparisons()
        if set(comparison.figures) <= set(motions)
    )
