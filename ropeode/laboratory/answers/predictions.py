"""What theory says: errors as the step size goes to zero, and where a stepper is stable."""

from __future__ import annotations

import numpy as np

from ropeode.laboratory.answers import Answer
from ropeode.laboratory.certified_motion import CertifiedMotion
from ropeode.laboratory.messages import AskStability, AskTheory, Stability, Theory
from ropeode.laboratory.setup import Laboratory
from ropeode.progress import Progress, part_of
from ropeode.render import limit_words, region_words
from ropeode.study.error_constant import leading_term
from ropeode.theory import (
    Spectrum,
    predicted_error,
    spectral_limit,
    spectrum_of,
    stability_function_of,
    stability_limits_of,
    stability_region,
)

# Multiplications, of which eigenvalues take some dozens for the cube of the size of a matrix.
_MOST_WORK, _OF_A_MATRIX = 3e9, 30.0
_POINTS = 120


def theory(ask: AskTheory, laboratory: Laboratory, progress: Progress) -> Answer:
    """See `ropeode.laboratory.answers.answer_to`."""
    motion = laboratory.motion(ask.problem, part_of(progress, 0.0, 0.5))
    method = laboratory.method(motion.problem, ask.stepper, ask.version)
    found = predicted_error(motion.reference, method, part_of(progress, 0.5, 1.0))
    label = method.stepper.label
    if isinstance(found, str):
        return Theory(stepper=label, words=f"no error is predicted: {found}"), {}
    sizes = leading_term(motion.problem, motion.norm, found)
    if sizes is None:
        words = f"no error is predicted: the term with dt^{found.order} vanishes"
        return Theory(stepper=label, words=words), {}
    order, constant = found.order, float(np.max(sizes))
    words = f"predicted error {constant:.4g} {'dt' if order == 1 else f'dt^{order}'}"
    return Theory(stepper=label, order=order, constant=constant, words=words), {}


def stability(ask: AskStability, laboratory: Laboratory, progress: Progress) -> Answer:
    """See `ropeode.laboratory.answers.answer_to`."""
    motion = laboratory.motion(ask.problem, progress)
    method = laboratory.method(motion.problem, ask.stepper, ask.version)
    progress("the problem's eigenvalues", 0.3)
    along = _along(motion)
    arrays = {
        "times": along.times,
        "eigenvalues": np.stack([np.real(along.eigenvalues), np.imag(along.eigenvalues)], axis=2),
    }
    progress(f"{ask.stepper}: the stability region", 0.6)
    label, function = method.stepper.label, stability_function_of(motion.problem, method)
    if isinstance(function, str):
        return Stability(stepper=label, why_none=function, words=function), arrays
    limit = spectral_limit(motion.problem, function, along)
    largest = None if limit is None or limit.steps.steps_per_frame is None else limit.steps.dt
    if largest is not None and not np.isfinite(largest):
        largest = None
    words = f"{region_words(function)}; {limit_words(limit)}"
    found = Stability(stepper=label, largest_stable_dt=largest, words=words)
    region = stability_region(function, stability_limits_of(function), _POINTS)
    if region is None:
        why = "it takes no damping, and has an interval of stability in place of a region"
        return found.model_copy(update={"why_none": why}), arrays
    # What is infinite is far outside of every level that is drawn.
    arrays["radius"] = np.minimum(region.radius, np.finfo(np.float32).max)
    box = {"real": region.real, "imaginary": region.imaginary}
    ends = {name: (float(each[0]), float(each[-1])) for name, each in box.items()}
    return found.model_copy(update=ends), arrays


def _along(motion: CertifiedMotion) -> Spectrum:
    """At the frames, or at fewer of them where a matrix is large."""
    reference = motion.reference
    most = int(_MOST_WORK / (_OF_A_MATRIX * motion.problem.y0.size**3))
    count = min(reference.trusted, max(1, most))
    some = np.unique(np.linspace(0, reference.trusted - 1, count).astype(int))
    return spectrum_of(motion.problem, reference.times[some], reference.states[some])
