"""Methods that courses teach, as programs have them, with the mistakes that people make in them.

Each is a step from positions and velocities to the next ones, and a start.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

import numpy as np


class Acceleration(Protocol):
    """Of positions and velocities, all ``(copies, dim, nodes)``."""

    last: np.ndarray | None
    """What it gave when it was last asked in this run; None at first."""

    def __call__(self, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Arguments and result are ``(copies, dim, nodes)``."""
        ...


Law = Callable[[np.ndarray, np.ndarray], np.ndarray]
State = tuple[np.ndarray, np.ndarray]
# The next positions and velocities.
Step = Callable[[Acceleration, np.ndarray, np.ndarray, float], State]
# The velocities with which a program begins.
Start = Callable[[Law, np.ndarray, np.ndarray, float], np.ndarray]

VERLET_START = "for Verlet, start with x(-dt) = x(0) - dt * v(0) + dt**2 / 2 * a(0)"
# Of a velocity on which its own damping depends.
_ITERATIONS, _ROUNDING = 8, 1e-15


def runge_kutta(
    rows: Sequence[Sequence[float]] | np.ndarray,
    weights: Sequence[float] | np.ndarray,
    weights_of_positions: Sequence[float] | None = None,
) -> Step:
    """The step of a Butcher tableau, explicit; positions may have weights of their own."""

    def combined(row: Sequence[float] | np.ndarray, slopes: list[np.ndarray]) -> np.ndarray:
        return sum(w * slope for w, slope in zip(row, slopes, strict=False) if w)  # type: ignore[return-value]

    def step(a: Acceleration, x: np.ndarray, v: np.ndarray, dt: float) -> State:
        velocities, accelerations = [v], [a(x, v)]
        for row in rows:
            at = x + dt * combined(row, velocities)
            velocities.append(v + dt * combined(row, accelerations))
            accelerations.append(a(at, velocities[-1]))
        of_positions = weights if weights_of_positions is None else weights_of_positions
        return x + dt * combined(of_positions, velocities), v + dt * combined(
            weights, accelerations
        )

    return step


def semi_implicit_euler(a: Acceleration, x: np.ndarray, v: np.ndarray, dt: float) -> State:
    """The step in which Störmer-Verlet moves as well: its velocity is the way of a step."""
    v = v + dt * a(x, v)
    return x + dt * v, v


def _positions_first(a: Acceleration, x: np.ndarray, v: np.ndarray, dt: float) -> State:
    x = x + dt * v
    return x, v + dt * a(x, v)


def _kick_drift_kick(a: Acceleration, x: np.ndarray, v: np.ndarray, dt: float) -> State:
    v = v + 0.5 * dt * a(x, v)
    x = x + dt * v
    return x, v + 0.5 * dt * a(x, v)


def _drift_kick_drift(a: Acceleration, x: np.ndarray, v: np.ndarray, dt: float) -> State:
    x = x + 0.5 * dt * v
    v = v + dt * a(x, v)
    return x + 0.5 * dt * v, v


def _velocity_verlet(
    foreseen: float = 1.0,
    old: float = 0.5,
    new: float = 0.5,
    squared: float = 0.5,
    keeps: bool = False,
) -> Step:
    """Velocity Verlet.

    Arguments:
        foreseen: part of dt over which the velocity is foreseen that the second force sees.
        old: weight of the acceleration at the start in the velocity.
        new: weight of the one at the end.
        squared: factor of ``dt * dt`` in the position.
        keeps: whether the first acceleration is the second one of the step before.
    """

    def step(a: Acceleration, x: np.ndarray, v: np.ndarray, dt: float) -> State:
        first = a(x, v) if a.last is None or not keeps else a.last
        x = x + dt * v + squared * dt * dt * first
        return x, v + dt * (old * first + new * a(x, v + foreseen * dt * first))

    return step


def _implicit_velocity(a: Law, x: np.ndarray, start: np.ndarray, weight: float) -> np.ndarray:
    """The velocity ``u = start + weight a(x, u)``, found by iteration."""
    u = start
    for _ in range(_ITERATIONS):
        last, u = u, start + weight * a(x, u)
        # The last bit may change for ever, and so may copies that blow up.
        if not np.any(np.abs(u - last) > _ROUNDING * np.abs(u)):
            break
    return u


def _verlet_central(a: Acceleration, x: np.ndarray, v: np.ndarray, dt: float) -> State:
    v = _implicit_velocity(a, x, v + 0.5 * dt * a(x, v), 0.5 * dt)
    return x + dt * v, v


def _velocity_verlet_central(a: Acceleration, x: np.ndarray, v: np.ndarray, dt: float) -> State:
    v = v + 0.5 * dt * a(x, v)
    x = x + dt * v
    return x, _implicit_velocity(a, x, v, 0.5 * dt)


def as_given(a: Law, x: np.ndarray, v: np.ndarray, dt: float) -> np.ndarray:
    """The initial velocity."""
    return v


def at_rest(a: Law, x: np.ndarray, v: np.ndarray, dt: float) -> np.ndarray:
    """No velocity, as where the last position is the first one."""
    return np.zeros_like(v)


def _by_taylor(a: Law, x: np.ndarray, v: np.ndarray, dt: float) -> np.ndarray:
    """The way of a step that leads to the initial position."""
    return v - 0.5 * dt * a(x, v)


def _without_acceleration(a: Law, x: np.ndarray, v: np.ndarray, dt: float) -> np.ndarray:
    """The way of a step that leads to the initial position, from which dt * v(0) leads on."""
    return v - dt * a(x, v)


def _half_kick(a: Law, x: np.ndarray, v: np.ndarray, dt: float) -> np.ndarray:
    """The velocity half a step before, from which a whole kick gives that half a step later."""
    return _implicit_velocity(a, x, v + 0.5 * dt * a(x, v), -dt)


class Method(NamedTuple):
    """A method that courses teach, or one that is meant to be.

    Fields:
        name: in words.
        order: of its positions; a pair has the order without damping, and with it.
        step: from positions and velocities to the next ones.
        start: the velocities with which it begins.
        restores: whether rigid links are put back to their length before each step, or after it.
        symplectic: whether its step is, without damping.
        remedy: how the line is written that makes it the method it may be taken for.
        iterates: whether each step solves an equation, which takes the most time.
    """

    name: str
    order: int | tuple[int, int]
    step: Step
    start: Start = as_given
    restores: str = ""
    symplectic: bool = True
    remedy: str = ""
    iterates: bool = False

    def order_if(self, damped: bool) -> int:
        """The order of its positions on a problem with damping, or without."""
        return self.order if isinstance(self.order, int) else self.order[damped]


_RK4_ROWS, _RK4_WEIGHTS = ((0.5,), (0.0, 0.5), (0.0, 0.0, 1.0)), (1 / 6, 1 / 3, 1 / 3, 1 / 6)
_RESTORED = "Verlet with links restored"
METHODS = {
    "springs": (
        Method("semi-implicit Euler", 1, semi_implicit_euler),
        Method(
            "explicit Euler",
            1,
            runge_kutta((), (1.0,)),
            symplectic=False,
            remedy="for semi-implicit Euler: v_new = v + dt * a; x_new = x + dt * v_new",
        ),
        Method("Störmer-Verlet that starts at rest", 1, semi_implicit_euler, at_rest),
        Method("Störmer-Verlet", (2, 1), semi_implicit_euler, _by_taylor),
        Method(
            "Störmer-Verlet whose first step is x(dt) = x(0) + dt * v(0)",
            1,
            semi_implicit_euler,
            _without_acceleration,
            remedy=VERLET_START,
        ),
        Method("leapfrog", (2, 1), semi_implicit_euler, _half_kick),
        Method("semi-implicit Euler, positions first", 1, _positions_first),
        Method("velocity Verlet", 2, _velocity_verlet()),
        Method("velocity Verlet that keeps its acceleration", 2, _velocity_verlet(keeps=True)),
        Method(
            "velocity Verlet in the form kick-drift-kick",
            (2, 1),
            _kick_drift_kick,
            remedy="damping force: -damping * (v + v_new) / 2",
        ),
        Method("Störmer-Verlet in the form drift-kick-drift", (2, 1), _drift_kick_drift),
        Method("RK4", 4, runge_kutta(_RK4_ROWS, _RK4_WEIGHTS), symplectic=False),
        Method("the midpoint method", 2, runge_kutta(((0.5,),), (0.0, 1.0)), symplectic=False),
        Method("Heun's method", 2, runge_kutta(((1.0,),), (0.5, 0.5)), symplectic=False),
        *(
            Method(f"{name} with central damping{rest}", order, step, start, iterates=True)
            for name, rest, order, step, start in (
                ("Störmer-Verlet", "", 2, _verlet_central, _by_taylor),
                ("Störmer-Verlet", " that starts at rest", 1, _verlet_central, at_rest),
                ("velocity Verlet", "", 2, _velocity_verlet_central, as_given),
            )
        ),
    ),
    "rigid links": tuple(
        Method(f"{_RESTORED} {when} each step{words}", 1, semi_implicit_euler, start, when)
        for start, words in ((at_rest, " that starts at rest"), (_by_taylor, ""))
        for when in ("before", "after")
    ),
}
# What people write in their place by mistake.
MISTAKEN = tuple(
    Method(f"{name} {mistake}", order, step, symplectic=False, remedy=remedy)
    for name, remedy, variants in (
        (
            "velocity Verlet",
            "x_new = x + dt * v + dt * dt / 2 * a; v_new = v + dt / 2 * (a + a_new)",
            {
                "whose second force sees the velocity of the start": (
                    (2, 1),
                    _velocity_verlet(foreseen=0.0),
                ),
                "that keeps an acceleration which saw the velocity of the start": (
                    (2, 1),
                    _velocity_verlet(foreseen=0.0, keeps=True),
                ),
                "that takes the acceleration of the start for both": (
                    1,
                    _velocity_verlet(old=1.0, new=0.0),
                ),
                "whose velocity takes the new acceleration alone": (
                    1,
                    _velocity_verlet(old=0.0, new=1.0),
                ),
                "without the 1/2 before dt * dt": (1, _velocity_verlet(squared=1.0)),
                "without the 1/2 before the two accelerations": (
                    0,
                    _velocity_verlet(old=1.0, new=1.0),
                ),
            },
        ),
        (
            "the midpoint method",
            "x_new = x + dt * v_half; v_new = v + dt * a_half",
            {
                "whose positions move with the velocity of the start": (
                    1,
                    runge_kutta(((0.5,),), (0.0, 1.0), (1.0, 0.0)),
                ),
                "whose first stage goes a whole step": (1, runge_kutta(((1.0,),), (0.0, 1.0))),
            },
        ),
        (
            "Heun's method",
            "v_new = v + dt / 2 * (a + a_end), with a_end after a whole step of Euler",
            {
                "whose first stage goes half a step": (1, runge_kutta(((0.5,),), (0.5, 0.5))),
                "whose positions move with the velocity of the start": (
                    1,
                    runge_kutta(((1.0,),), (0.5, 0.5), (1.0, 0.0)),
                ),
            },
        ),
        (
            "RK4",
            "k2 = f(y + dt/2 * k1); k3 = f(y + dt/2 * k2); k4 = f(y + dt * k3); "
            "y_new = y + dt/6 * (k1 + 2*k2 + 2*k3 + k4)",
            {
                "whose third stage starts from the first slope": (
                    2,
                    runge_kutta((_RK4_ROWS[0], (0.5,), _RK4_ROWS[2]), _RK4_WEIGHTS),
                ),
                "whose last stage goes half a step": (
                    1,
                    runge_kutta((*_RK4_ROWS[:2], (0.0, 0.0, 0.5)), _RK4_WEIGHTS),
                ),
                "whose second and third stages go a whole step": (
                    1,
                    runge_kutta(((1.0,), (0.0, 1.0), _RK4_ROWS[2]), _RK4_WEIGHTS),
                ),
                "with four equal weights": (2, runge_kutta(_RK4_ROWS, (0.25,) * 4)),
            },
        ),
    )
    for mistake, (order, step) in variants.items()
)
