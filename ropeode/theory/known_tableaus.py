"""Well-known methods by their tableaus."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from ropeode.steppers import (
    Heun,
    Kutta3,
    Midpoint,
    Pefrl,
    Ralston2,
    Ralston3,
    RungeKutta4,
    Splitting,
    StrongStabilityPreserving3,
    ThreeEighths,
    Yoshida4,
    Yoshida6,
)
from ropeode.tableaus import NystromTableau, Tableau
from ropeode.tableaus.stages import Row, as_fraction, number


def _rows(text: str) -> list[list[str]]:
    """The rows of a matrix, with bars between them."""
    return [row.split() for row in text.split("|")]


def _method(rows: str, b: str) -> Tableau:
    return Tableau.of(_rows(rows), b.split())


# Of those that are no steppers: Hairer, Norsett, Wanner, Solving ODEs I, table II.1.1; Bogacki,
# Shampine, Appl. Math. Lett. 2 (1989); Gill, Proc. Camb. Phil. Soc. 47 (1951); Fehlberg, Computing
# 6 (1970); Cash, Karp, ACM Trans. Math. Softw. 16 (1990).
_ROOT2 = np.sqrt(2.0)
EXPLICIT: dict[str, Tableau] = {
    "explicit-euler": _method("0", "1"),
    "the explicit midpoint method": Midpoint.tableau,
    "Heun's method": Heun.tableau,
    "Ralston's method of order 2": Ralston2.tableau,
    "Kutta's method of order 3": Kutta3.tableau,
    "Heun's method of order 3": _method("0 | 1/3 | 0 2/3", "1/4 0 3/4"),
    "Ralston's method of order 3 (also Bogacki and Shampine's)": Ralston3.tableau,
    "SSPRK3": StrongStabilityPreserving3.tableau,
    "RK4": RungeKutta4.tableau,
    "the 3/8 rule": ThreeEighths.tableau,
    "Gill's method": Tableau.of(
        [[], ["1/2"], [_ROOT2 / 2 - 0.5, 1.0 - _ROOT2 / 2], [0, -_ROOT2 / 2, 1.0 + _ROOT2 / 2]],
        ["1/6", (2.0 - _ROOT2) / 6.0, (2.0 + _ROOT2) / 6.0, "1/6"],
        [0, "1/2", "1/2", 1],
    ),
    "Fehlberg's method of order 4": _method(
        "0 | 1/4 | 3/32 9/32 | 1932/2197 -7200/2197 7296/2197 | 439/216 -8 3680/513 -845/4104",
        "25/216 0 1408/2565 2197/4104 -1/5",
    ),
    "Fehlberg's method of order 5": _method(
        "0 | 1/4 | 3/32 9/32 | 1932/2197 -7200/2197 7296/2197 | 439/216 -8 3680/513 -845/4104 | "
        "-8/27 2 -3544/2565 1859/4104 -11/40",
        "16/135 0 6656/12825 28561/56430 -9/50 2/55",
    ),
    "Cash and Karp's method of order 5": _method(
        "0 | 1/5 | 3/40 9/40 | 3/10 -9/10 6/5 | -11/54 5/2 -70/27 35/27 | "
        "1631/55296 175/512 575/13824 44275/110592 253/4096",
        "37/378 0 250/621 125/594 0 512/1771",
    ),
}

# Hairer, Wanner, Solving ODEs II, sections IV.3 and IV.5; Alexander, SIAM J. Numer. Anal. 14
# (1977).
_ROOT3, _ROOT6 = np.sqrt(3.0), np.sqrt(6.0)
_GAMMA = 1.0 - np.sqrt(0.5)
IMPLICIT: dict[str, Tableau] = {
    "implicit Euler": _method("1", "1"),
    "the implicit midpoint rule": _method("1/2", "1"),
    "the implicit trapezoidal rule": _method("0 0 | 1/2 1/2", "1/2 1/2"),
    "Alexander's SDIRK2": Tableau.of([[_GAMMA], [1.0 - _GAMMA, _GAMMA]], [1.0 - _GAMMA, _GAMMA]),
    "the Gauss method of order 4": Tableau.of(
        [[Fraction(1, 4), 0.25 - _ROOT3 / 6.0], [0.25 + _ROOT3 / 6.0, Fraction(1, 4)]],
        ["1/2", "1/2"],
    ),
    "Radau IA of order 3": _method("1/4 -1/4 | 1/4 5/12", "1/4 3/4"),
    "Radau IIA of order 3": _method("5/12 -1/12 | 3/4 1/4", "3/4 1/4"),
    "Radau IIA of order 5": Tableau.of(
        [
            [(88 - 7 * _ROOT6) / 360, (296 - 169 * _ROOT6) / 1800, (-2 + 3 * _ROOT6) / 225],
            [(296 + 169 * _ROOT6) / 1800, (88 + 7 * _ROOT6) / 360, (-2 - 3 * _ROOT6) / 225],
            [(16 - _ROOT6) / 36, (16 + _ROOT6) / 36, Fraction(1, 9)],
        ],
        [(16 - _ROOT6) / 36, (16 + _ROOT6) / 36, Fraction(1, 9)],
    ),
    "Lobatto IIIA of order 4": _method("0 0 0 | 5/24 1/3 -1/24 | 1/6 2/3 1/6", "1/6 2/3 1/6"),
    "Lobatto IIIC of order 2": _method("1/2 -1/2 | 1/2 1/2", "1/2 1/2"),
}


def _of_positions(velocities: Tableau, q: Sequence[Any], c: Sequence[Any]) -> NystromTableau:
    """A method for forces of positions and time, which drifts until the time of each force.

    Arguments:
        velocities: p as its matrix, with the weights of the velocities.
        q: the weights of the positions.
        c: the times.
    """
    times = tuple(map(number, c))
    return NystromTableau(
        p=velocities.a, q=tuple(map(number, q)), a=None, b=velocities.b, c=times, d=times
    )


def _kicks_and_drifts(drifts: Sequence[Any], kicks: Sequence[Any]) -> NystromTableau:
    """Drifts ``x += d dt v`` and kicks ``v += k dt a(x)`` in turn, a drift first.

    The force is one of positions. Drifts may be 0.
    """
    x, v = tuple(map(number, drifts)), tuple(map(number, kicks))
    times = tuple(itertools.accumulate(x))[: len(v)]
    p = [[v[j] * (times[i] - times[j]) for j in range(i)] for i in range(len(v))]
    q = [k * (1 - time) for k, time in zip(v, times, strict=True)]
    return _of_positions(Tableau.of(p, v), q, times)


def _of_substeps(stepper: type[Splitting]) -> NystromTableau:
    drifts, kicks = zip(*stepper.substeps, strict=True)
    # After the last drift there is no kick.
    return _kicks_and_drifts(drifts, kicks[:-1])


# Hairer, Lubich, Wanner, Geometric Numerical Integration, (I.1.9), (I.1.17), section II.5; Ruth,
# IEEE Trans. Nucl. Sci. 30 (1983); Forest, Ruth, Physica D 43 (1990); Omelyan, Mryglod, Folk,
# Comput. Phys. Commun. 146 (2002); Yoshida, Phys. Lett. A 150 (1990); Hairer, Norsett, Wanner,
# Solving ODEs I, section II.14.
SECOND_ORDER: dict[str, NystromTableau] = {
    "semi-implicit-euler": _kicks_and_drifts([0, 1], [1]),
    "semi-implicit Euler with the positions first": _kicks_and_drifts([1], [1]),
    "the Taylor step x += dt v + dt^2/2 a, v += dt a": _of_positions(
        _method("0", "1"), ["1/2"], [0]
    ),
    "velocity-verlet": _kicks_and_drifts([0, 1], ["1/2", "1/2"]),
    "position Verlet (drift, kick, drift)": _kicks_and_drifts(["1/2", "1/2"], [1]),
    "Ruth's method of order 3": _kicks_and_drifts([0, "2/3", "-2/3", 1], ["7/24", "3/4", "-1/24"]),
    "Ruth's method of order 3 with the positions first": _kicks_and_drifts(
        [1, "-2/3", "2/3"], ["-1/24", "3/4", "7/24"]
    ),
    "Forest and Ruth's method of order 4": _of_substeps(Yoshida4),
    "PEFRL (order 4)": _of_substeps(Pefrl),
    "Yoshida's method of order 6 (solution A)": _of_substeps(Yoshida6),
    "Nystrom's method of order 4": _of_positions(
        _method("0 | 1/8 | 0 1/2", "1/6 2/3 1/6"), ["1/6", "1/3", 0], [0, "1/2", 1]
    ),
}


@functools.cache
def published() -> dict[str, Tableau]:
    """Explicit methods that libraries have, without stages of no effect."""
    # They take a second to import.
    import diffrax
    from scipy import integrate

    found = {
        "Dormand and Prince's method of order 5": integrate.RK45,
        "Dormand and Prince's method of order 8 (DOP853)": integrate.DOP853,
    }
    made = {name: _in_fractions(each.A, each.B, each.C) for name, each in found.items()}
    for name, solver in {
        "Tsitouras' method of order 5": diffrax.Tsit5,
        "Prince and Dormand's method of order 8 (Dopri8)": diffrax.Dopri8,
    }.items():
        own = solver.tableau
        made[name] = _in_fractions([[], *own.a_lower], own.b_sol, [0.0, *own.c])
    return made


def _in_fractions(a: Any, b: Any, c: Any) -> Tableau:
    """The method with these weights; SciPy has more stages for what it interpolates with."""

    def row(numbers: Any) -> Row:
        return tuple(as_fraction(float(number)) for number in numbers[: len(b)])

    return Tableau.of([row(each) for each in a[: len(b)]], row(b), row(c)).reduced
