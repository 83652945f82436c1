"""The stability region of a stepper, with the problem's eigenvalues along its solution."""

from __future__ import annotations

import functools

import numpy as np

from ropeode.laboratory.answers import Answer
from ropeode.laboratory.certified_motion import CertifiedMotion
from ropeode.laboratory.messages import AskStability, Stability
from ropeode.laboratory.setup import Laboratory
from ropeode.progress import Progress
from ropeode.render import limit_words, region_words
from ropeode.simulation import Method
from ropeode.theory import (
    NoStabilityFunction,
    Spectrum,
    spectral_limit,
    spectrum_of,
    stability_function_of,
    stability_limits_of,
    stability_region,
)

# Multiplications, of which eigenvalues take some dozens for the cube of the size of a matrix.
_MOST_WORK, _OF_A_MATRIX = 3e9, 30.0
_POINTS = 120


def answer(ask: AskStability, laboratory: Laboratory, progress: Progress) -> Answer:
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
    said = functools.partial(Stability, stepper=method.stepper.label)
    return _judged(motion, method, along, said, arrays)


def _judged(
    motion: CertifiedMotion,
    method: Method,
    along: Spectrum,
    said: functools.partial[Stability],
    arrays: dict[str, np.ndarray],
) -> Answer:
    function = stability_function_of(motion.problem, method)
    if isinstance(function, NoStabilityFunction):
        none = {"real": None, "imaginary": None, "largest_stable_dt": None}
        return said(why_none=function.reason, words=function.reason, **none), arrays
    limit = spectral_limit(motion.problem, function, along)
    largest = None if limit is None or limit.steps.steps_per_frame is None else limit.steps.dt
    if largest is not None and not np.isfinite(largest):
        largest = None
    words = f"{region_words(function)}; {limit_words(limit)}"
    region = stability_region(function, stability_limits_of(function), _POINTS)
    if region is None:
        none = {"real": None, "imaginary": None}
        why = "it takes no damping, and has an interval of stability in place of a region"
        return said(why_none=why, largest_stable_dt=largest, words=words, **none), arrays
    # What is infinite is far outside of every level that is drawn.
    arrays["radius"] = np.minimum(region.radius, np.finfo(np.float32).max)
    real, imaginary = (
        (float(each[0]), float(each[-1])) for each in (region.real, region.imaginary)
    )
    message = said(
        real=real, imaginary=imaginary, why_none=None, largest_stable_dt=largest, words=words
    )
    return message, arrays


def _along(motion: CertifiedMotion) -> Spectrum:
    """At the frames, or at fewer of them where a matrix is large."""
    reference = motion.reference
    most = int(_MOST_WORK / (_OF_A_MATRIX * motion.problem.y0.size**3))
    count = min(reference.trusted, max(1, most))
    some = np.unique(np.linspace(0, reference.trusted - 1, count).astype(int))
    return spectrum_of(motion.problem, reference.times[some], reference.states[some])
