"""Right steppers with what may rightly be claimed of them; none of them may be rejected."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from ropeode.steppers import as_stepper
from tests.checking.mutants.originals import ORIGINALS, trajectory


def explicit(stages: list[list[float]], weights: list[float]) -> Callable:
    """An explicit Runge-Kutta method from its tableau, row by row."""

    def step(rhs, t, y, dt, args):
        slopes = []
        for row in stages:
            there = y + dt * sum((a * k for a, k in zip(row, slopes, strict=True) if a), 0 * y)
            slopes.append(rhs(t + sum(row) * dt, there, args))
        return y + dt * sum(b * k for b, k in zip(weights, slopes, strict=True) if b)

    return step


def _numbers(row: str) -> list[float]:
    return [float(Fraction(number)) for number in row.split(", ") if number]


TABLEAUS: dict[str, tuple[int, list[list[float]], list[float]]] = {
    name: (it["order"], [_numbers(row) for row in it["stages"]], _numbers(it["weights"]))
    for name, it in tomllib.loads((Path(__file__).parent / "tableaus.toml").read_text()).items()
}


def _rate(args):
    return (args.free * args.damping / args.mass)[:, None]


def _symmetric(acceleration, t, x, v, dt, args):
    """Kick, drift, kick, with the damping in the middle of each pair of kicks."""
    half = _rate(args) * dt / 2
    v_half = (1 - half) * v + dt / 2 * acceleration(t, x, 0 * v, args)
    x = x + dt * v_half
    v = (v_half + dt / 2 * acceleration(t + dt, x, 0 * v, args)) / (1 + half)
    return x, v


def composed(fractions: list[float]) -> Callable:
    """Symmetric steps of fractions of dt (Hairer, Lubich, Wanner, section V.3)."""

    def step(acceleration, t, x, v, dt, args):
        for fraction in fractions:
            x, v = _symmetric(acceleration, t, x, v, fraction * dt, args)
            t = t + fraction * dt
        return x, v

    return step


def heun_in_numpy(rhs, t, y, dt, args):
    """As one writes it who saves memory: in place, but in its own arrays."""
    y = np.array(y)
    slope = rhs(t, y, args)
    there = y + dt * slope
    slope += rhs(t + dt, there, args)
    y += 0.5 * dt * slope
    return y


def rk4_with_lists(rhs, t, y, dt, args):
    """Number by number, without arrays, and back again."""
    numbers, shape = np.ravel(y).tolist(), np.shape(y)

    def slopes(c, before):
        there = [number + c * dt * slope for number, slope in zip(numbers, before, strict=True)]
        return np.ravel(rhs(t + c * dt, np.reshape(there, shape), args)).tolist()

    k1 = slopes(0.0, [0.0 for _ in numbers])
    k2 = slopes(0.5, k1)
    k3 = slopes(0.5, k2)
    k4 = slopes(1.0, k3)
    new = [
        number + dt / 6 * (a + 2 * b + 2 * c + d)
        for number, a, b, c, d in zip(numbers, k1, k2, k3, k4, strict=True)
    ]
    return np.reshape(new, shape)


_STRUCTURE = {"symplectic": True, "reversible": True}
# ropeode's own, with the options that change their order.
_OWN = (
    *("explicit-euler", "semi-implicit-euler", "velocity-verlet", "stormer-verlet", "rk4"),
    "stormer-verlet:damping=lagged",
)


_CUBE = 1 / (2 - 2 ** (1 / 3))
_SUZUKI = 1 / (4 - 4 ** (1 / 3))
_YOSHIDA = [_CUBE, 1 - 2 * _CUBE, _CUBE]
_SUZUKI4 = [_SUZUKI, _SUZUKI, 1 - 4 * _SUZUKI, _SUZUKI, _SUZUKI]

RIGHT: dict[str, tuple[Any, dict[str, Any]]] = {
    **{
        original.__name__: (original, claims)
        for original, (_, claims) in ORIGINALS.items()
        if original is not trajectory
    },
    **{
        name: (explicit(stages, weights), {"expected_order": order})
        for name, (order, stages, weights) in TABLEAUS.items()
    },
    # H. Yoshida, Phys. Lett. A 150 (1990); M. Suzuki, Phys. Lett. A 146 (1990).
    "yoshida4": (composed(_YOSHIDA), {"expected_order": 4, **_STRUCTURE}),
    "suzuki4": (composed(_SUZUKI4), {"expected_order": 4, **_STRUCTURE}),
    # These solve equations, and the damping exactly.
    "ruth3": (as_stepper("ruth3"), {"expected_order": 3, "symplectic": True}),
    "implicit-midpoint": (as_stepper("implicit-midpoint"), {"expected_order": 2, **_STRUCTURE}),
    "trapezium": (as_stepper("trapezium"), {"expected_order": 2, "reversible": True}),
    "gauss4": (as_stepper("gauss4"), {"expected_order": 4, **_STRUCTURE}),
    "implicit-euler": (as_stepper("implicit-euler"), {"expected_order": 1}),
    "heun in NumPy": (heun_in_numpy, {"expected_order": 2}),
    "rk4 with lists": (rk4_with_lists, {"expected_order": 4}),
    "adams-bashforth-2": (as_stepper("adams-bashforth2"), {}),
    "beeman": (as_stepper("beeman"), {}),
    **{f"ropeode {name}": (as_stepper(name), {"method": name}) for name in _OWN},
}
