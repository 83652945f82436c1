"""The leading term of the error, as theory predicts it and as runs show it."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ropeode.analysis import (
    NARROW_ORDER,
    UNSTABLE,
    ObservedOrder,
    error_sizes,
    least_clear_error,
    whole_orders,
)
from ropeode.json_form import json_shows
from ropeode.norms import Norm
from ropeode.problems import Problem
from ropeode.references import Reference

if TYPE_CHECKING:
    from ropeode.theory import PredictedError

# Theory and runs agree to this part, or closely.
AGREE, AGREE_CLOSELY = 0.1, 0.01
# Over more than the first factor in dt runs agree with theory by no accident; over more than the
# second they refute it, if finer ones are further from it.
_LASTING, _SPAN = 1.99, 7.99
# Up to this width an interval without a whole order decides against the declared one: on the way to
# the asymptotic range slopes are fractional, too.
_FRACTIONAL = 0.1
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
    def confirmed(self) -> bool:
        """Whether the finest step sizes agree with theory, over a factor of two in dt."""
        coarsest = self.agree_from(AGREE)
        return coarsest is not None and self.dt is not None and coarsest > _LASTING * self.dt

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


def believed(
    order: ObservedOrder, declared: int | None, constant: ErrorConstant | None, frame: float
) -> ObservedOrder:
    """The observed order; undetermined where another one is known and the runs may be too coarse.

    A higher term of the error may outweigh the leading one over many step sizes, and then errors
    lie on a line that has another slope. The predicted line tells whether they are asymptotic: then
    they are close to it. Runs that go away from it the finer they are refute the prediction. Where
    there is no line, a narrow interval decides against the declared order, and a wide one does not.

    Arguments:
        order: from the runs alone.
        declared: by the stepper; None or 0 where it declares none.
        constant: of the error; None where nobody asked for it.
        frame: the longest.
    """
    low, high = order.ci95 or (-np.inf, np.inf)
    dt = None if constant is None else constant.dt
    if constant is None or dt is None or constant.predicted is None:
        wide = order.verdict == "converges" and high - low > (
            NARROW_ORDER if whole_orders(low, high) else _FRACTIONAL
        )
        if not declared or low <= declared <= high or not wide:
            return order
        why = f"{order.slope_words}, too wide to refute the declared order {declared}"
        return order.withheld(why)
    apart = {dt: abs(ratio - 1.0) for dt, ratio in constant.ratios.items()}
    used = {dt: far for dt, far in apart.items() if dt in order.used}
    if constant.confirmed or _refuted(used):
        return order
    theory = f"theory says order {constant.order}"
    if not constant.approaches:
        # Of a single run nobody knows.
        theory += ", but finer steps come no closer to its error" if len(apart) > 1 else ""
    elif apart[dt] > AGREE:
        # The next term of the error has one more power of dt.
        steps = float(f"{frame / dt * apart[dt] / AGREE:.2g}")
        theory = f"not yet asymptotic: {theory} from about {steps:.0f} steps per frame on"
    else:
        theory = f"not yet asymptotic: {theory}"
    if order.ci95 is None:
        return dataclasses.replace(order, why=f"{order.why}; {theory}")
    if constant.order is None or low <= constant.order <= high:
        return order
    return order.withheld(f"{order.slope_words}; {theory}")


def _refuted(apart: Mapping[float, float]) -> bool:
    """Whether runs are the further from the predicted line the finer they are, over a long way."""
    away = all(fine > coarse for fine, coarse in itertools.pairwise(apart.values()))
    return away and len(apart) > 1 and max(apart) > _SPAN * min(apart)


def _predicted(
    problem: Problem, norm: Norm, order: ObservedOrder, prediction: PredictedError | str
) -> tuple[int | None, np.ndarray | None, str | None]:
    """The power of dt and the error over it at each sample; or an observed power, and why."""
    if isinstance(prediction, str):
        return _whole(order), None, prediction
    sizes = leading_term(problem, norm, prediction)
    if sizes is None:
        return _whole(order), None, f"the term with dt^{prediction.order} vanishes"
    return prediction.order, sizes, None


def leading_term(problem: Problem, norm: Norm, prediction: PredictedError) -> np.ndarray | None:
    """The predicted error over ``dt**order`` at each trusted sample but the first, ``(times,)``.

    None where it may be zero in this norm.
    """
    states = prediction.states[1:]
    sizes = error_sizes(problem, states, norm)
    largest = float(np.max(np.abs(states), initial=0.0))
    certain = np.max(sizes, initial=0.0) > _CERTAIN * prediction.uncertain * largest
    return sizes if certain else None


def _whole(order: ObservedOrder) -> int | None:
    """The one whole number that the observed order can be."""
    if order.ci95 is None or order.verdict != "converges":
        return None
    inside = [p for p in whole_orders(*order.ci95) if p]
    return inside[0] if len(inside) == 1 else None
