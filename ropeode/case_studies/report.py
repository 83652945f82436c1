"""The published rope report, run again: what became of each of its claims."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from ropeode.analysis import DEFAULT_THRESHOLDS, classify_motion, sensitivity
from ropeode.case_studies import claims
from ropeode.case_studies.comparisons import Compared, compared
from ropeode.case_studies.figures import ENDS, Figure, Meaning, all_comparisons, check_figures
from ropeode.case_studies.results import (
    FigureResult,
    Reading,
    Report,
    RoundingEffect,
    ThresholdEffect,
)
from ropeode.case_studies.runs import (
    Images,
    Run,
    code_fingerprint,
    frames_for,
    growth_of,
    run_all,
    stable_from,
)
from ropeode.problems.rope import Rope
from ropeode.progress import Progress, bar, shows_progress
from ropeode.simulation import Trajectory
from ropeode.validation import check_whole

# What a change of the last digits must leave as it is.
_MEASURES = ("diverged_at", "settled_at", "unsettled_at", "swings")


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
        thresholds=DEFAULT_THRESHOLDS,
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
