"""Well-known explicit Runge-Kutta methods: a class for each tableau."""

from __future__ import annotations

from ropeode.steppers.runge_kutta import RungeKutta
from ropeode.tableaus import Tableau


def tableau_of(rows: str, b: str) -> Tableau:
    """From texts: rows have bars between them, and end before their zeros."""
    return Tableau.of([row.split() for row in rows.split("|")], b.split())


class RungeKutta4(RungeKutta):
    """The classical method of order 4: four slopes, weighted 1 : 2 : 2 : 1.

    Source: W. Kutta, Z. Math. Phys. 46 (1901); Hairer, Norsett, Wanner, Solving Ordinary
    Differential Equations I, table II.1.2 (left).
    """

    name = "rk4"
    source = "Hairer, Norsett, Wanner, Solving ODEs I, table II.1.2"
    tableau = tableau_of("| 1/2 | 0 1/2 | 0 0 1", "1/6 1/3 1/3 1/6")
    tableau_order = 4


class Heun(RungeKutta):
    """Euler's step, and then the mean of the slopes at both ends: ``y += dt/2 (k1 + k2)``.

    The explicit trapezoidal rule, also called improved Euler.

    Source: K. Heun, Z. Math. Phys. 45 (1900), algorithm II; as an optimal method that preserves
    strong stability: Shu, Osher, J. Comput. Phys. 77 (1988), eq. (2.16).
    """

    name = "heun"
    source = "Heun, Z. Math. Phys. 45 (1900)"
    tableau = tableau_of("| 1", "1/2 1/2")
    tableau_order = 2


class Midpoint(RungeKutta):
    """Half of Euler's step, and then the slope that is found there: ``y += dt k2``.

    Source: C. Runge, Math. Ann. 46 (1895); Hairer, Norsett, Wanner, Solving Ordinary Differential
    Equations I, eq. (II.1.4).
    """

    name = "midpoint"
    source = "Hairer, Norsett, Wanner, Solving ODEs I, (II.1.4)"
    tableau = tableau_of("| 1/2", "0 1")
    tableau_order = 2


class Ralston2(RungeKutta):
    """The method of order 2 with the smallest bound for its local error: ``y += dt/4 (k1 + 3 k2)``.

    Source: A. Ralston, Math. Comp. 16 (1962), eq. (3.5).
    """

    name = "ralston2"
    source = "Ralston, Math. Comp. 16 (1962)"
    tableau = tableau_of("| 2/3", "1/4 3/4")
    tableau_order = 2


class Ralston3(RungeKutta):
    """The method of order 3 with the smallest bound for its local error.

    ``y += dt/9 (2 k1 + 3 k2 + 4 k3)``, with slopes at 0, 1/2 and 3/4 of the step.

    Source: A. Ralston, Math. Comp. 16 (1962), eq. (4.10).
    """

    name = "ralston3"
    source = "Ralston, Math. Comp. 16 (1962)"
    tableau = tableau_of("| 1/2 | 0 3/4", "2/9 1/3 4/9")
    tableau_order = 3


class Kutta3(RungeKutta):
    """Simpson's rule as a Runge-Kutta method: ``y += dt/6 (k1 + 4 k2 + k3)``.

    The last slope is taken at ``y + dt (2 k2 - k1)``.

    Source: W. Kutta, Z. Math. Phys. 46 (1901), p. 440.
    """

    name = "kutta3"
    source = "Kutta, Z. Math. Phys. 46 (1901)"
    tableau = tableau_of("| 1/2 | -1 2", "1/6 2/3 1/6")
    tableau_order = 3


class StrongStabilityPreserving3(RungeKutta):
    """The three-stage method of order 3 that preserves strong stability, SSPRK(3,3).

    Each stage is a mean of Euler steps: what these do not increase for a dt, such as total
    variation, it does not increase either.

    Source: C.-W. Shu, S. Osher, J. Comput. Phys. 77 (1988), eq. (2.18).
    """

    name = "ssprk3"
    source = "Shu, Osher, J. Comput. Phys. 77 (1988), (2.18)"
    tableau = tableau_of("| 1 | 1/4 1/4", "1/6 1/6 2/3")
    tableau_order = 3


class ThreeEighths(RungeKutta):
    """The 3/8 rule of order 4: ``y += dt/8 (k1 + 3 k2 + 3 k3 + k4)``.

    Its error is most often smaller than that of `rk4`.

    Source: W. Kutta, Z. Math. Phys. 46 (1901); Hairer, Norsett, Wanner, Solving Ordinary
    Differential Equations I, table II.1.2 (right).
    """

    name = "three-eighths"
    source = "Hairer, Norsett, Wanner, Solving ODEs I, table II.1.2"
    tableau = tableau_of("| 1/3 | -1/3 1 | 1 -1 1", "1/8 3/8 3/8 1/8")
    tableau_order = 4
