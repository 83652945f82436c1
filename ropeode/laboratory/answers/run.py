"""One run of a stepper, beside the reference."""

from __future__ import annotations

import math

from ropeode.laboratory.answers import Answer
from ropeode.laboratory.messages import AskRun, Run
from ropeode.laboratory.runs_beside import differences_of
from ropeode.laboratory.setup import Laboratory
from ropeode.progress import Progress, part_of


def answer(ask: AskRun, laboratory: Laboratory, progress: Progress) -> Answer:
    """See `ropeode.laboratory.answers.answer_to`."""
    motion = laboratory.motion(ask.problem, progress)
    method, steps = laboratory.method(motion.problem, ask.stepper, ask.version), ask.steps_per_frame
    row = laboratory.row(motion, method, steps, part_of(progress, 0.0, 0.6))
    run = laboratory.run(motion, method, steps, part_of(progress, 0.6, 1.0))
    message = Run(
        stepper=row.stepper,
        steps_per_frame=steps,
        dt=row.dt,
        every=motion.every(steps),
        status=row.status,
        diverged_at=row.diverged_at,
        error_final=row.error_final,
        error_max=row.error_max,
        error_rms=row.error_rms,
        resolution=row.resolution,
        round_off=_finite(row.round_off),
        rhs_evaluations=row.rhs_evaluations,
        seconds=row.seconds,
    )
    return message, differences_of(motion, run.states, motion.every(steps))


def _finite(number: float | None) -> float | None:
    # Infinite where the run in other units diverged, though this one did not.
    return number if number is None or math.isfinite(number) else None
