"""What linear theory says of step sizes, in words."""

from __future__ import annotations

import numpy as np

from ropeode.theory import SpectralLimit, StabilityFunction

# Of an eigenvalue, as a share of its size.
_ROUNDING = 1e-12


def region_words(function: StabilityFunction) -> str:
    """What does not happen inside of the region of stability."""
    if function.equation == "y' = lambda y":
        return "nothing grows: |R(z)| ≤ 1"
    return "an oscillation with the modes z and z* does not grow"


def limit_words(predicted: SpectralLimit | None) -> str:
    """How short steps have to be, and which mode decides."""
    if predicted is None:
        return "no limit from the eigenvalues along the solution"
    steps = predicted.steps.steps_per_frame
    value = _number(predicted.eigenvalue)
    if steps is None:
        return f"unstable at every step size tried, by λ = {value} at t = {predicted.time:g}"
    if not np.isfinite(predicted.steps.dt):
        return "stable at every step size tried"
    words = f"stable for dt < {predicted.steps.dt:.4g}, {steps} per frame or more"
    return f"{words}; λ = {value} at t = {predicted.time:g} decides"


def _number(value: complex) -> str:
    """A complex number, without a part that is nothing but rounding."""
    nothing = _ROUNDING * abs(value)
    if abs(value.imag) < nothing:
        return f"{value.real:.3g}"
    return (
        f"{value.imag:.3g}i" if abs(value.real) < nothing else f"{value.real:.3g}{value.imag:+.3g}i"
    )
