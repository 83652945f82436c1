"""Adams methods: the slopes of earlier steps in place of slopes inside the step.

Explicit ones (Adams-Bashforth) go along the polynomial through the last slopes. With that for a
guess of the new state, implicit ones (Adams-Moulton) take the polynomial through the new slope too.

They need slopes from before the start. By default these are those of the solution that goes on
backwards: a run of `rk4` from the initial state to earlier times, with the same step size. All
steps are then equal, from the first one on. The right-hand side has to be defined and smooth for
three steps before the start; where it is not, as that of ``sqrt(t)`` at 0, samples are no numbers,
and `start=euler` is the way out. After one of the problem's `jump_times` the slopes are those of a
force that stands still at the jump: where the force after it depends on time, the order is 2 at
most. A start in forward steps, as programs have it that count their
steps, would need a step that differs from the others.
"""

from __future__ import annotations

import dataclasses
from typing import Any, ClassVar, Literal, NamedTuple

from ropeode.steppers.base import BuiltIn, ProblemClass, System
from ropeode.steppers.runge_kutta import advanced
from ropeode.steppers.runge_kutta_methods import RungeKutta4
from ropeode.tableaus.stages import Row, number


class Earlier(NamedTuple):
    """What an Adams method carries: a state, and the slopes before it, the latest first."""

    y: Any
    slopes: tuple[Any, ...]


def _row(text: str) -> Row:
    return tuple(map(number, text.split()))


@dataclasses.dataclass(frozen=True)
class Adams(BuiltIn):
    """What both kinds share: how they start, and what they carry.

    Arguments:
        start: where slopes from before the start come from. `runge-kutta`: from steps of `rk4`
            backwards, which keeps the order. `euler`: from nowhere, each is the slope at the
            start, so that the first step is Euler's; order 2 at most.
    """

    predictor: ClassVar[Row]

    family = "multistep"
    equal_frames = True

    start: Literal["runge-kutta", "euler"] = "runge-kutta"

    def order(self, problem_class: ProblemClass) -> int:
        """As many as there are slopes; at most 2 after a start by Euler's step."""
        slopes = len(self.predictor)
        return min(slopes, 2) if self.start == "euler" else slopes

    def init(self, system: System, t: Any, y: Any, dt: Any) -> Earlier:
        """The initial state and the slopes before it."""
        slopes: list[Any] = []
        if self.start == "euler":
            slopes = [system.rhs(t, y)] * (len(self.predictor) - 1)
            return Earlier(y, tuple(slopes))
        before = y
        for i in range(len(self.predictor) - 1):
            before = RungeKutta4().step(system, t - i * dt, before, -dt)
            slopes.append(system.rhs(t - (i + 1) * dt, before))
        return Earlier(y, tuple(slopes))

    def state(self, system: System, t: Any, carried: Earlier, dt: Any) -> Any:
        """The state without slopes."""
        return carried.y


class AdamsBashforth(Adams):
    """``y += dt Σ β_j f(t - j dt)``: one evaluation for a step, whatever the order."""

    def step(self, system: System, t: Any, carried: Earlier, dt: Any) -> Earlier:
        """One slope, and the sum of the last ones."""
        slopes = (system.once(system.rhs(t, carried.y)), *carried.slopes)
        return Earlier(advanced(carried.y, dt, self.predictor, slopes), slopes[:-1])


class AdamsBashforth2(AdamsBashforth):
    """``y += dt/2 (3 f(t) - f(t - dt))``.

    Order 2 whichever way it starts.

    Arguments:
        start: where slopes from before the start come from. `runge-kutta`: from steps of `rk4`
            backwards. `euler`: from nowhere, each is the slope at the start, so that the first
            step is Euler's.

    Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, eq. (III.1.5).
    """

    name = "adams-bashforth2"
    source = "Hairer, Norsett, Wanner, Solving ODEs I, (III.1.5)"
    predictor = _row("3/2 -1/2")


class AdamsBashforth3(AdamsBashforth):
    """``y += dt/12 (23 f(t) - 16 f(t - dt) + 5 f(t - 2 dt))``.

    Arguments:
        start: where slopes from before the start come from. `runge-kutta`: from steps of `rk4`
            backwards, which keeps order 3. `euler`: from nowhere, each is the slope at the start,
            so that the first step is Euler's; order 2.

    Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, eq. (III.1.5).
    """

    name = "adams-bashforth3"
    source = "Hairer, Norsett, Wanner, Solving ODEs I, (III.1.5)"
    predictor = _row("23/12 -16/12 5/12")


class AdamsBashforth4(AdamsBashforth):
    """``y += dt/24 (55 f(t) - 59 f(t - dt) + 37 f(t - 2 dt) - 9 f(t - 3 dt))``.

    Arguments:
        start: where slopes from before the start come from. `runge-kutta`: from steps of `rk4`
            backwards, which keeps order 4. `euler`: from nowhere, each is the slope at the start,
            so that the first step is Euler's; order 2.

    Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, eq. (III.1.5).
    """

    name = "adams-bashforth4"
    source = "Hairer, Norsett, Wanner, Solving ODEs I, (III.1.5)"
    predictor = _row("55/24 -59/24 37/24 -9/24")


class PredictorCorrector(Adams):
    """Adams-Bashforth predicts, Adams-Moulton corrects once, with the slope at the prediction.

    The next step evaluates the slope at the corrected state (PECE).
    """

    corrector: ClassVar[Row]

    def step(self, system: System, t: Any, carried: Earlier, dt: Any) -> Earlier:
        """Evaluate, predict, evaluate, correct."""
        slopes = (system.once(system.rhs(t, carried.y)), *carried.slopes)
        predicted = advanced(carried.y, dt, self.predictor, slopes)
        ahead = (system.rhs(t + dt, predicted), *slopes[:-1])
        return Earlier(advanced(carried.y, dt, self.corrector, ahead), slopes[:-1])


class PredictorCorrector2(PredictorCorrector):
    """``y* = y + dt/2 (3 f(t) - f(t - dt))``, then ``y += dt/2 (f*(t + dt) + f(t))``.

    Order 2 whichever way it starts.

    Arguments:
        start: as for `adams-bashforth2`.

    Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, eqs. (III.1.5) and
    (III.1.8).
    """

    name = "adams-pece2"
    source = "Hairer, Norsett, Wanner, Solving ODEs I, (III.1.5), (III.1.8)"
    predictor = AdamsBashforth2.predictor
    corrector = _row("1/2 1/2")


class PredictorCorrector3(PredictorCorrector):
    """`adams-bashforth3`, then ``y += dt/12 (5 f*(t + dt) + 8 f(t) - f(t - dt))``.

    Arguments:
        start: as for `adams-bashforth3`.

    Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, eqs. (III.1.5) and
    (III.1.8).
    """

    name = "adams-pece3"
    source = "Hairer, Norsett, Wanner, Solving ODEs I, (III.1.5), (III.1.8)"
    predictor = AdamsBashforth3.predictor
    corrector = _row("5/12 8/12 -1/12")


class PredictorCorrector4(PredictorCorrector):
    """`adams-bashforth4`, then ``y += dt/24 (9 f*(t + dt) + 19 f(t) - 5 f(t - dt) + f(t - 2 dt))``.

    Arguments:
        start: as for `adams-bashforth4`.

    Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, eqs. (III.1.5) and
    (III.1.8).
    """

    name = "adams-pece4"
    source = "Hairer, Norsett, Wanner, Solving ODEs I, (III.1.5), (III.1.8)"
    predictor = AdamsBashforth4.predictor
    corrector = _row("9/24 19/24 -5/24 1/24")
