"""The leading term of the error, as theory predicts it and as runs show it."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ropeode.analysis import AGREE, UNSTABLE, ObservedOrder, least_clear_error
from ropeode.json_form import json_shows
from ropeode.norms import Norm, distance
from ropeode.problems import Problem
from ropeode.references import Reference

if TYPE_CHECKING:
    from ropeode.theory import PredictedError

# Theory and runs agree closely to this part.
AGREE_CLOSELY = 0.01
# A predicted size that is not so many times its uncertainty may be zero.
_CERTAIN = 10.0


@json_shows(
    *("order", "predicted", "why", "measured", "dt", "ratio"),
    *("agree_10_percent", "agree_1_percent"),
)
@dataclasses.dataclass(frozen=True, eq=False)
class ErrorConstant:
    """The constant C in ``max error = C dt**order``, predicted and measured in one norm.

    Arguments:
        order: the power of dt; None where there is no prediction, and no whole order was observed.
        predicted_at: the error over ``dt**order`` at each trusted sample but the first, from the
            local error and the variational equation; None where there is no prediction.
        why: the reason for that.
        measured_at: the largest error of a run over ``dt**order``, by step size from the finest to
            the coarsest, where it is stable and clear of round-off.
    """

    order: int | None
    predicted_at: np.ndarray | None
    why: str | None
    measured_at: Mapping[float, float]

    @property
    def predicted(self) -> float | None:
        """The constant by theory; None where there is none."""
        return None if self.predicted_at is None else float(np.max(self.predicted_at))

    @property
    def dt(self) -> float | None:
        """The finest step size whose run is stable, and clear of round-off and the bound."""
        return next(iter(self.measured_at), None)

    @property
    def measured(self) -> float | None:
        """The constant by the run with step size `dt`; None where no run can be used."""
        return next(iter(self.measured_at.values()), None)

    @property
    def ratio(self) -> float | None:
        """Measured over predicted."""
        return next(iter(self.ratios.values()), None)

    @property
    def ratios(self) -> dict[float, float]:
        """Measured over predicted, by step size from the finest on."""
        size = self.predicted
        return {} if size is None else {dt: c / size for dt, c in self.measured_at.items()}

    def agree_from(self, part: float) -> float | None:
        """The largest step size from which on, to the finest, the two agree to within this part."""
        found = None
        for dt, ratio in self.ratios.items():
            if abs(ratio - 1.0) > part:
                break
            found = dt
        return found

    @property
    def agree_10_percent(self) -> float | None:
        """The largest step size from which on, down to `dt`, the two agree to within 10%."""
        return self.agree_from(AGREE)

    @property
    def agree_1_percent(self) -> float | None:
        """The largest step size from which on, down to `dt`, the two agree to within 1%."""
        return self.agree_from(AGREE_CLOSELY)

    @property
    def approaches(self) -> bool:
        """Whether the ratio comes closer to 1 with each of the three finest step sizes."""
        apart = [abs(ratio - 1.0) for ratio in self.ratios.values()][:3]
        return len(apart) > 1 and all(a < b for a, b in itertools.pairwise(apart))


def error_constant(
    reference: Reference,
    norm: Norm,
    runs: Mapping[float, tuple[float | None, float | None]],
    order: ObservedOrder,
    prediction: PredictedError | str,
) -> ErrorConstant:
    """What theory predicts beside what runs with several step sizes show.

    Arguments:
        reference: of the problem that was solved.
        norm: in which the errors are measured.
        runs: the largest error of each and its round-off, by step size; None where not known.
        order: what was observed of them.
        prediction: from `ropeode.theory.global_error.predicted_error`.
    """
    power, predicted, why = _predicted(reference.problem, norm, order, prediction)
    unstable = {each.dt for each in order.left_out if each.reason == UNSTABLE}
    measured = {
        dt: error / dt**power
        for dt, (error, rounding) in sorted(runs.items())
        if power is not None
        and error is not None
        and dt not in unstable
        and error >= least_clear_error(reference, norm, dt, rounding)
    }
    return ErrorConstant(power, predicted, why, measured)


def _predicted(
    problem: Problem, norm: Norm, order: ObservedOrder, prediction: PredictedError | str
) -> tuple[int | None, np.ndarray | None, str | None]:
    """The power of dt and the error over it at each sample; or an observed power, and why."""
    if isinstance(prediction, str):
        return order.whole, None, prediction
    sizes = leading_term(problem, norm, prediction)
    if sizes is None:
        return order.whole, None, f"the term with dt^{prediction.order} vanishes"
    return prediction.order, sizes, None


def leading_term(problem: Problem, norm: Norm, prediction: PredictedError) -> np.ndarray | None:
    """The predicted error over ``dt**order`` at each trusted sample but the first, ``(times,)``.

    None where it may be zero in this norm.
    """
    states = prediction.states[1:]
    sizes = distance(problem, norm, states, np.zeros_like(states))
    largest = float(np.max(np.abs(states), initial=0.0))
    certain = np.max(sizes, initial=0.0) > _CERTAIN * prediction.uncertain * largest
    return sizes if certain else None
