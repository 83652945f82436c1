"""The published rope report, run again: what became of each of its claims."""

from __future__ import annotations

import dataclasses
import functools
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ropeode.analysis.motion import DEFAULTS, Motion, Thresholds, classify_motion, sensitivity
from ropeode.analysis.stability import Growth, stability_limit
from ropeode.case_studies import claims
from ropeode.case_studies.comparisons import Compared, judge
from ropeode.case_studies.figures import (
    ENDS,
    Figure,
    Meaning,
    all_comparisons,
    check_figures,
)
from ropeode.case_studies.runs import (
    Finished,
    Progress,
    Run,
    code_fingerprint,
    frames_for,
    growth_of,
    run_all,
    run_of,
)
from ropeode.problems.rope import Rope
from ropeode.simulation import Trajectory
from ropeode.validation import check_whole


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
        measured: what was seen, in words.
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
class Moved:
    """A threshold that a verdict hangs on.

    Arguments:
        figure: number of the figure.
        meaning: of which.
        threshold: its name.
        value: at which the verdict is another one.
        verdict: that other one.
    """

    figure: int
    meaning: Meaning
    threshold: str
    value: float
    verdict: str


@dataclasses.dataclass(frozen=True, eq=False)
class Judged:
    """A figure with what became of its claim.

    Arguments:
        figure: setting and claim.
        measured: what was seen, in words.
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


@dataclasses.dataclass(frozen=True, eq=False)
class Report:
    """The report, run again.

    Arguments:
        figures: those that were asked for, by number.
        comparisons: those whose figures are all among them.
        thresholds: behind the words.
        moved: the thresholds that verdicts hang on, within a factor of two.
    """

    figures: tuple[Judged, ...]
    comparisons: tuple[Compared, ...]
    thresholds: Thresholds
    moved: tuple[Moved, ...]


def rope_report(
    figures: Sequence[int] | None = None,
    frames: int | None = None,
    *,
    folder: Path | None = None,
    progress: Progress = lambda text, fraction: None,
) -> Report:
    """Run figures of the published rope report again and judge their claims.

    Arguments:
        figures: numbers from 1 to 41; all where none are given.
        frames: how long each rope is watched; by default 4000 frames, or longer where linear
            theory needs it to show a rope at rest, or apart.
        folder: where finished runs are kept until all are done, so that an interrupted report
            goes on from there; None keeps nothing.
        progress: called with what has been finished and the fraction that is done.

    Raises:
        InputError: there is no such figure, or `frames` is not a whole number >= 1.
    """
    chosen = check_figures(figures)
    if frames is not None:
        frames = check_whole("frames", frames, at_least=1, example="1000")
    progress("linear stability", 0.0)
    growths: dict[tuple[Figure, Meaning], Growth] = {
        (figure, meaning): growth_of(figure, meaning)
        for figure in chosen
        if figure.run_as
        for meaning in figure.meanings
    }
    lengths = {
        figure: frames or frames_for(figure, [growths[figure, each] for each in figure.meanings])
        for figure in chosen
        if figure.run_as
    }
    runs: dict[tuple[Figure, Meaning], Run] = {
        (figure, meaning): run_of(figure, meaning, lengths[figure]) for figure, meaning in growths
    }
    wanted: dict[Any, Any] = {}
    for (figure, meaning), run in runs.items():
        wanted.setdefault(run, functools.partial(_problem, figure, meaning, lengths[figure]))
    kept = folder / code_fingerprint() if folder else None
    finished = run_all(wanted, kept, progress) if wanted else {}

    moved: list[Moved] = []
    judged = []
    limits: dict[Any, int | None] = {}
    for figure in chosen:
        progress(f"judging figure {figure.figure}", 1.0)
        readings = []
        for meaning in figure.meanings if figure.run_as else ():
            done, growth = finished[runs[figure, meaning]], growths[figure, meaning]
            problem = done.images[0].problem
            stepper = done.images[0].stepper
            setting = (stepper, problem.parameters["damping"])
            if setting not in limits:
                limits[setting] = stability_limit(problem, stepper)
            readings.append(_reading(figure, meaning, done, growth, limits[setting]))
            moved += _moved(figure, readings[-1])
        judged.append(_judged(figure, readings, lengths.get(figure, 0)))
    report = Report(
        figures=tuple(judged),
        comparisons=_compared(judged),
        thresholds=DEFAULTS,
        moved=tuple(moved),
    )
    if kept:
        shutil.rmtree(kept, ignore_errors=True)
    return report


def _problem(figure: Figure, meaning: Meaning, frames: int, end: Sequence[float]) -> Any:
    return figure.problem(meaning, end, frames)


def _reading(
    figure: Figure, meaning: Meaning, done: Finished, growth: Growth, limit: int | None
) -> Reading:
    trajectory, other = done.images
    motion, motion_right = classify_motion(trajectory), classify_motion(other)
    return Reading(
        meaning=meaning,
        trajectory=trajectory,
        motion=motion,
        mirrored=done.mirrored,
        growth=growth,
        limit=limit,
        measured=claims.measured(motion, growth),
        verdict=claims.verdict(figure.claim, motion, growth),
        verdict_mirrored=claims.verdict(figure.claim, motion_right, growth),
    )


def _moved(figure: Figure, reading: Reading) -> list[Moved]:
    """The thresholds that change a verdict when they are halved or doubled.

    That a claim ends at another frame is no other verdict.
    """
    found = []
    for each in sensitivity(reading.trajectory):
        verdict = claims.verdict(figure.claim, each.words, reading.growth)
        if _kind(verdict) != _kind(reading.verdict):
            found.append(Moved(figure.figure, reading.meaning, each.threshold, each.value, verdict))
    return found


def _kind(verdict: str) -> str:
    return verdict.rstrip("0123456789")


def _judged(figure: Figure, readings: Sequence[Reading], frames: int) -> Judged:
    if not readings:
        measured, verdict = _drawn(figure)
        return Judged(figure, measured, verdict, 0, ())
    measured = readings[0].measured
    for other in readings[1:]:
        if figure.damping:
            measured += f"; as the listing has it (no damping): {other.measured}, {other.verdict}"
    for each in readings:
        if each.verdict_mirrored != each.verdict:
            measured += f"; mirror image: {each.verdict_mirrored}"
        elif not each.mirrored:
            measured += "; mirror image: the same but for rounding"
    return Judged(figure, measured, readings[0].verdict, frames, tuple(readings))


def _drawn(figure: Figure) -> tuple[str, str]:
    """Whether a rope that does not move can be drawn as it is claimed, in both images."""
    told = []
    for end in ENDS:
        problem = Rope(end=end, num_nodes=figure.num_nodes).problem(1)
        places = problem.positions(problem.y0[None])[0]
        gaps = np.linalg.norm(np.diff(places, axis=0), axis=1)
        even = bool(np.ptp(gaps) <= 1e-12 * np.max(gaps))
        ends = np.array_equal(places[[0, -1]], [Rope().start, end])
        told.append(len(places) == figure.num_nodes and even and ends)
    measured = f"{figure.num_nodes} nodes, evenly spaced from (0, 200) to (±400, 200)"
    return measured, claims.HOLDS if all(told) else claims.FAILS


def _compared(judged: Sequence[Judged]) -> tuple[Compared, ...]:
    motions = {each.figure.figure: each.motion for each in judged if each.motion is not None}
    return tuple(
        judge(comparison, [motions[number] for number in comparison.figures])
        for comparison in all_comparisons()
        if set(comparison.figures) <= set(motions)
    )
