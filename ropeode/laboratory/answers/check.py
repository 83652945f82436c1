"""The verdict of `ropeode check` on a stepper."""

from __future__ import annotations

from ropeode.checking import CHECKS, check_stepper
from ropeode.laboratory.answers import Answer
from ropeode.laboratory.messages import AskCheck, Checked
from ropeode.laboratory.report_lines import lines_of
from ropeode.laboratory.setup import Laboratory
from ropeode.progress import Progress

# Of processor time that the step may take in each check: somebody looks on.
_SECONDS = 10.0


def answer(ask: AskCheck, laboratory: Laboratory, progress: Progress) -> Answer:
    """See `ropeode.laboratory.answers.answer_to`."""
    stepper = laboratory.stepper(ask.stepper, ask.version)
    report = check_stepper(stepper, quick=ask.quick, time_limit=_SECONDS, progress=progress)
    made, checks = len(report.findings), len(CHECKS)
    lines = lines_of(report, judged=made == checks)
    return Checked(stepper=stepper.label, made=made, checks=checks, lines=lines), {}
