"""The certified reference, as it is drawn."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ropeode.laboratory.answers import Answer
from ropeode.laboratory.messages import AskTruth, Truth
from ropeode.laboratory.setup import Laboratory
from ropeode.problems import Problem, rope_of
from ropeode.progress import Progress
from ropeode.references import Reference, remarks
from ropeode.render import certificate_claim, problem_words
from ropeode.simulation import frame_lengths


def answer(ask: AskTruth, laboratory: Laboratory, progress: Progress) -> Answer:
    """See `ropeode.laboratory.answers.answer_to`."""
    motion = laboratory.motion(ask.problem, progress)
    problem, finer, drawing = motion.problem, motion.finer, motion.drawing
    arrays = {
        "times": finer.times,
        "points": motion.points,
        "bound": finer.bound(motion.norm),
    }
    if motion.energy is not None:
        arrays |= {"energy": motion.energy.values, "energy_bound": motion.energy.bound}
    rope = rope_of(problem) is not None
    message = Truth(
        words=problem_words(problem),
        frame=float(np.max(frame_lengths(problem))),
        frames=problem.frames,
        samples_per_frame=motion.samples_per_frame,
        trusted=finer.trusted,
        horizon=finer.horizon,
        accuracy=motion.reference.certificate.accuracy,
        norm=motion.norm.words,
        drawing=drawing.kind,
        links=drawing.links,
        fixed=drawing.fixed,
        nodes=drawing.nodes,
        axes=drawing.axes,
        time_unit="frames" if counts_frames(problem) else "",
        energy_unit="mass length²/frame²" if rope else "",
        certificate=tuple(_certificate(motion.reference)),
    )
    return message, arrays


def _certificate(reference: Reference) -> Iterator[str]:
    """What is claimed of the reference, and by which runs."""
    yield certificate_claim(reference.certificate)
    yield from remarks(reference)
    for each in reference.certificate.witnesses:
        yield f"{each.role}: {each.solver} at {each.tolerance:.0e}, {each.difference:.1e} apart"


def counts_frames(problem: Problem) -> bool:
    """Whether the time unit of the problem is one frame."""
    whole = bool(np.array_equal(problem.ts, np.arange(problem.frames + 1.0)))
    # A duration may be as many units of time as there are frames by chance.
    return whole and not {"duration", "periods"} & {*problem.parameters}
