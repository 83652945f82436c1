"""The JSON form of the published report, run again."""

from __future__ import annotations

from typing import Literal, TypedDict

from ropeode.analysis.motion import Thresholds, Verdict
from ropeode.case_studies.figures import Claim, Meaning
from ropeode.case_studies.report import RoundingEffect, ThresholdEffect


class ReadingForm(TypedDict):
    """A figure under one of its meanings, measured. Frames are null for what did not happen.

    Fields:
        meaning: `words`, or `listing` for what the printed program does.
        damping: that was used.
        measured: what the rope did, in words.
        verdict: on the claim.
        verdict_of_mirror_image: on the claim, for the rope drawn to the right.
        mirror_image_identical: whether that rope did the same to the last bit, mirrored.
        motion: what the rope did, in one word: `diverges`, `settles`, `settles_without_swinging` or
            `never_settles`.
        diverged_at: the first frame that is not finite or has a spring too long.
        settled_at: the frame from which on it was at rest.
        unsettled_at: the frame at which it left that rest.
        swings: how often it swung from one side of the vertical to the other.
        reached_vertical_at: the first frame at which its centre of mass was near the vertical.
        largest_stretch: of any spring, in its rest lengths; null where it was not finite.
        jitter: the rate at which springs change length at the end, in rest lengths per frame.
        predicted_rate: of growth of a disturbance per frame, by linear theory.
        predicted_stable: whether disturbances do not grow, by linear theory.
        predicted_blow_up: the frame by which rounding has grown to a length, by linear theory.
        stable_from_steps_per_frame: by linear theory; null if there is no such number.
    """

    meaning: Meaning
    damping: float
    measured: str
    verdict: str
    verdict_of_mirror_image: str
    mirror_image_identical: bool
    motion: Verdict
    diverged_at: int | None
    settled_at: int | None
    unsettled_at: int | None
    swings: int
    reached_vertical_at: int | None
    largest_stretch: float | None
    jitter: float | None
    predicted_rate: float
    predicted_stable: bool
    predicted_blow_up: int | None
    stable_from_steps_per_frame: int | None


class FigureForm(TypedDict):
    """A figure and what became of its claim.

    Fields:
        figure: its number.
        stepper: what the report calls it; `none` where nothing moves.
        run_as: the stepper with its options; null where nothing moves.
        steps_per_frame: as the report has it.
        damping: as the report has it.
        num_nodes: as the report has it.
        claim: what the report sees in it, as one word: those of `motion`, `swings` or `drawn`.
        words: what the report sees in it.
        measured: what was seen, in words.
        verdict: `holds`, `does not hold`, `holds until frame N` or, with too few `--frames`,
            `not watched long enough`.
        diverged_at: frame; null if it did not.
        settled_at: frame; null if it did not.
        frames: that were watched; 0 where nothing moves.
        meanings: the figure as the words have it, and as the listing has it if that is something
            else; none where nothing moves.
    """

    figure: int
    stepper: str
    run_as: str | None
    steps_per_frame: int
    damping: float
    num_nodes: int
    claim: Claim
    words: str
    measured: str
    verdict: str
    diverged_at: int | None
    settled_at: int | None
    frames: int
    meanings: list[ReadingForm]


class ComparisonForm(TypedDict):
    """A claim that compares figures.

    Fields:
        figures: their numbers.
        claim: what the report says.
        measured: what was seen, in words.
        verdict: `holds`, `does not hold` or `not watched long enough`.
    """

    figures: list[int]
    claim: str
    measured: str
    verdict: str


class ReportForm(TypedDict):
    """The published report, claim by claim: `ropeode report --format json`.

    Fields:
        schema: name and version of this form.
        figures: one for each figure.
        comparisons: claims that compare figures.
        thresholds: behind the words, as in `classify_motion`.
        sensitive_to_thresholds: verdicts that change when a threshold is halved or doubled.
        sensitive_to_rounding: measurements that change with the last digits of the start.
    """

    schema: Literal["ropeode.report/1"]
    figures: list[FigureForm]
    comparisons: list[ComparisonForm]
    thresholds: Thresholds
    sensitive_to_thresholds: list[ThresholdEffect]
    sensitive_to_rounding: list[RoundingEffect]
