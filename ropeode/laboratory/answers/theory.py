"""What theory predicts of the error as the step size goes to zero."""

from __future__ import annotations

import numpy as np

from ropeode.laboratory.answers import Answer
from ropeode.laboratory.messages import AskTheory, Theory
from ropeode.laboratory.setup import Laboratory
from ropeode.progress import Progress, part_of
from ropeode.study.error_constant import leading_term
from ropeode.theory import predicted_error


def answer(ask: AskTheory, laboratory: Laboratory, progress: Progress) -> Answer:
    """See `ropeode.laboratory.answers.answer_to`."""
    motion = laboratory.motion(ask.problem, part_of(progress, 0.0, 0.5))
    method = laboratory.method(motion.problem, ask.stepper, ask.version)
    found = predicted_error(motion.reference, method, part_of(progress, 0.5, 1.0))
    order = constant = None
    if isinstance(found, str):
        words = f"no error is predicted: {found}"
    elif (sizes := leading_term(motion.problem, motion.norm, found)) is None:
        words = f"no error is predicted: the term with dt^{found.order} vanishes"
    else:
        order, constant = found.order, float(np.max(sizes))
        power = "dt" if order == 1 else f"dt^{order}"
        words = f"predicted error {constant:.4g} {power}"
    return Theory(stepper=method.stepper.label, order=order, constant=constant, words=words), {}
