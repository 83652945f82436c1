"""The same as a GIF."""

from __future__ import annotations

import base64

from ropeode.laboratory import limits
from ropeode.laboratory.answers import Answer
from ropeode.laboratory.messages import AskFilm, FilmFile
from ropeode.laboratory.setup import Laboratory
from ropeode.progress import Progress, part_of
from ropeode.references import problem_of
from ropeode.render import animate, film_bytes
from ropeode.study import check_positions
from ropeode.study.node_paths import node_paths


def film(ask: AskFilm, laboratory: Laboratory, progress: Progress) -> Answer:
    """See `ropeode.laboratory.answers.answer_to`."""
    source = laboratory.source(ask.problem)
    problem = problem_of(source)
    check_positions(problem)
    steppers = [laboratory.stepper(name, ask.version) for name in ask.steppers]
    for stepper in steppers:
        # What runs in Python says so itself, or is tried when it runs.
        limits.check_work(problem, stepper, ask.steps_per_frame, stepper.compiled is not False)
    paths = node_paths(source, steppers, ask.steps_per_frame, progress=part_of(progress, 0.0, 0.4))
    contents = film_bytes(animate(paths), ".gif", progress=part_of(progress, 0.4, 1.0))
    return FilmFile(gif=base64.b64encode(contents).decode()), {}
