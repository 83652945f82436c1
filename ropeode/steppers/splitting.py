"""Leapfrog and its compositions: drifts ``x' = v`` and kicks ``v' = a(t, x) - r v`` in turn."""

from __future__ import annotations

import dataclasses
import itertools
from typing import Any, ClassVar, Literal, NamedTuple

import jax.numpy as jnp

from ropeode.steppers.base import BuiltIn, ProblemClass, System
from ropeode.steppers.phase import Phase
from ropeode.steppers.verlet import Kicked

KickDamping = Literal["exact", "explicit"]


def growth(z: Any) -> Any:
    """``(exp(z) - 1)/z`` without loss of digits near z = 0, where it is 1."""
    zero = z == 0
    return jnp.where(zero, 1.0, jnp.expm1(z) / jnp.where(zero, 1.0, z))


def kicked(damping: KickDamping, v: Any, a: Any, rate: Any, h: Any) -> Any:
    """The velocities after a kick ``v' = a - r v`` of duration h with positions and time frozen.

    It is ``v + h phi(-r h) (a - r v)``, exactly with ``phi(z) = (exp(z) - 1)/z``.

    Arguments:
        damping: `exact`, or `explicit`, which is ``phi = 1``: a step of explicit Euler.
        v: velocities.
        a: the acceleration without damping.
        rate: r.
        h: may be negative.
    """
    lasting = h * growth(-rate * h) if damping == "exact" else h
    return v + lasting * (a - rate * v)


@dataclasses.dataclass(frozen=True)
class Splitting(BuiltIn):
    """Drifts and kicks in turn, each the exact flow of a part of the equation.

    A drift ``x += c dt v`` moves time as well, by ``c dt``, so that forces may depend on it; a
    kick of ``d dt`` changes the velocities, with positions and time frozen. The order
    conditions of a composition hold for the flows of any two parts: that the kick contains the
    damping, exactly, costs nothing, and neither do kicks that go back in time. These
    strengthen the damped velocity, by ``exp(-r d dt)`` with ``d < 0``, and the next kicks
    weaken it again.

    Class attributes:
        substeps: pairs (c, d) of a drift and the kick after it; 0 stands for none.
        undamped_order: of convergence, and with exact damping that of damped problems too.
    """

    family = "symplectic"
    needs = "second order, linear damping"
    symplectic = True
    substeps: ClassVar[tuple[tuple[float, float], ...]]
    undamped_order: ClassVar[int]

    damping: KickDamping = "exact"

    def order(self, problem_class: ProblemClass) -> int:
        """Its order; 1 with damping that is explicit in each kick."""
        explicit = self.damping == "explicit" and problem_class.damped
        return 1 if explicit else self.undamped_order

    def step(self, system: System, t: Any, y: Phase, dt: Any) -> Phase:
        """The substeps one after the other."""
        assert system.damping is not None
        x, v, gone = y.x, y.v, 0.0
        for drift, kick in self.substeps:
            if drift:
                x = x + drift * dt * v
                gone += drift
            if kick:
                a = system.undamped_acceleration(t + gone * dt, x)
                v = kicked(self.damping, v, a, system.damping.rate, kick * dt)
        return Phase(x, v)


class Staggered(NamedTuple):
    """What staggered leapfrog carries: ``x(t)`` and ``v(t - dt/2)``."""

    x: Any
    v: Any


@dataclasses.dataclass(frozen=True)
class Leapfrog(BuiltIn):
    """Half a kick, a drift, half a kick, or its other forms; one evaluation of the acceleration.

    Arguments:
        form: `kick-drift-kick`: ``v += dt/2 a(t, x)``, ``x += dt v``,
            ``v += dt/2 a(t + dt, x)``; `drift-kick-drift`: ``x += dt/2 v``,
            ``v += dt a(t + dt/2, x)``, ``x += dt/2 v``; `staggered`: ``v(t + dt/2) = v(t - dt/2)
            + dt a(t, x)``, ``x(t + dt) = x(t) + dt v(t + dt/2)``, begun with half a kick back
            to ``v(-dt/2)``, and shown at whole times after half a kick; for frames of equal
            length.
        damping: how ``-r v`` enters a kick, with r = damping/mass. `exact`: the kick solves
            ``v' = a - r v``; order 2. `explicit`: ``v += h (a - r v)`` with the velocity before
            it; order 1.

    Velocities at half steps that are taken for those of whole times are the ones of
    semi-implicit Euler, of order 1. With exact damping, `staggered` and `kick-drift-kick` are
    the same up to rounding: two half kicks are a whole one. Without damping, both are
    `velocity-verlet`, which treats damping in another way.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, eq. (I.1.17) and section
    I.1.4; staggered: Birdsall, Langdon, Plasma Physics via Computer Simulation (1985), section
    2-4.
    """

    name = "leapfrog"
    family = "symplectic"
    needs = "second order, linear damping"
    symplectic = True
    source = "Hairer, Lubich, Wanner, Geometric Numerical Integration, (I.1.17)"

    form: Literal["kick-drift-kick", "drift-kick-drift", "staggered"] = "kick-drift-kick"
    damping: KickDamping = "exact"

    @property
    def equal_frames(self) -> bool:  # type: ignore[override]
        """Staggered velocities are half a step away, and cannot be so at two step sizes."""
        return self.form == "staggered"

    def order(self, problem_class: ProblemClass) -> int:
        """Order 2; 1 with damping that is explicit in each kick."""
        return 1 if self.damping == "explicit" and problem_class.damped else 2

    def _kicked(self, system: System, v: Any, a: Any, h: Any) -> Any:
        assert system.damping is not None
        return kicked(self.damping, v, a, system.damping.rate, h)

    def init(self, system: System, t: Any, y: Phase, dt: Any) -> Phase | Kicked | Staggered:
        """What the form carries: a state, with its acceleration, or with an earlier velocity."""
        if self.form == "drift-kick-drift":
            return y
        a = system.undamped_acceleration(t, y.x)
        if self.form == "kick-drift-kick":
            return Kicked(y.x, y.v, a)
        return Staggered(y.x, self._kicked(system, y.v, a, -dt / 2))

    def step(self, system: System, t: Any, y: Any, dt: Any) -> Phase | Kicked | Staggered:
        """One step of the form."""
        if self.form == "drift-kick-drift":
            x = y.x + dt / 2 * y.v
            v = self._kicked(system, y.v, system.undamped_acceleration(t + dt / 2, x), dt)
            return Phase(x + dt / 2 * v, v)
        if self.form == "kick-drift-kick":
            v = self._kicked(system, y.v, y.a, dt / 2)
            x = y.x + dt * v
            a = system.undamped_acceleration(t + dt, x)
            return Kicked(x, self._kicked(system, v, a, dt / 2), a)
        v = self._kicked(system, y.v, system.undamped_acceleration(t, y.x), dt)
        return Staggered(y.x + dt * v, v)

    def state(self, system: System, t: Any, y: Any, dt: Any) -> Phase:
        """Positions, and velocities at the same time."""
        if self.form != "staggered":
            return Phase(y.x, y.v)
        a = system.undamped_acceleration(t, y.x)
        return Phase(y.x, self._kicked(system, y.v, a, dt / 2))


@dataclasses.dataclass(frozen=True)
class Ruth3(Splitting):
    """Three kicks, 7/24, 3/4, -1/24, each before a drift, 2/3, -2/3, 1; order 3.

    It is not symmetric: energies stay near their start, but a step back is not its inverse.

    Arguments:
        damping: as for `leapfrog`: `exact`, with which the order holds, or `explicit`, order 1.

    Source: R. D. Ruth, IEEE Trans. Nucl. Sci. 30 (1983); Hairer, Lubich, Wanner, Geometric
    Numerical Integration, section II.5.
    """

    name = "ruth3"
    source = "Ruth, IEEE Trans. Nucl. Sci. 30 (1983)"
    undamped_order = 3
    substeps = ((0, 7 / 24), (2 / 3, 3 / 4), (-2 / 3, -1 / 24), (1, 0))


def _composed(*weights: float) -> tuple[tuple[float, float], ...]:
    """Steps of drift-kick-drift leapfrog in a row; the drifts that meet are one."""
    ends = (0.0, *weights, 0.0)
    drifts = [(a + b) / 2 for a, b in itertools.pairwise(ends)]
    return tuple(zip(drifts, (*weights, 0.0), strict=True))


_THETA = 1 / (2 - 2 ** (1 / 3))


@dataclasses.dataclass(frozen=True)
class Yoshida4(Splitting):
    """Forest and Ruth's method: three leapfrogs (drift-kick-drift) of w dt, (1 - 2 w) dt, w dt.

    Order 4 with ``w = 1/(2 - 2^(1/3))``, about 1.35: the middle one goes back in time by 1.70 dt.
    Strong damping makes it unstable early: an oscillation of frequency omega is stable up to
    ``omega dt = 1.57`` without damping, to 0.78 where the rate r of its damping is 5/dt, and to
    0.13 where it is 10/dt.

    Arguments:
        damping: as for `leapfrog`: `exact`, with which the order holds, or `explicit`, order 1.

    Source: E. Forest, R. D. Ruth, Physica D 43 (1990); H. Yoshida, Phys. Lett. A 150 (1990);
    Hairer, Lubich, Wanner, Geometric Numerical Integration, eq. (II.4.4).
    """

    name = "yoshida4"
    source = "Hairer, Lubich, Wanner, Geometric Numerical Integration, (II.4.4)"
    undamped_order = 4
    substeps = _composed(_THETA, 1 - 2 * _THETA, _THETA)


# Of PEFRL. The paper's 16 digits of lambda and chi miss the conditions of order 3 by 7e-16: they
# solve them to all digits here, with the paper's xi.
_XI, _LAMBDA, _CHI = 0.1786178958448091, -0.2123418310626061, -0.06626458266981823


@dataclasses.dataclass(frozen=True)
class Pefrl(Splitting):
    """The position-extended Forest-Ruth-like method: four kicks, and a smaller error; order 4.

    Drifts ``xi, chi, 1 - 2 (chi + xi), chi, xi`` and between them kicks ``1/2 - lambda, lambda,
    lambda, 1/2 - lambda``, with xi = 0.1786178958448091, lambda = -0.2123418310626061, chi =
    -0.06626458266981823. No substep is longer than 0.78 dt. An
    oscillation of frequency omega is stable up to ``omega dt = 2.99`` without damping, and beyond
    that up to a damping rate of 10/dt.

    Arguments:
        damping: as for `leapfrog`: `exact`, with which the order holds, or `explicit`, order 1.

    Source: I. P. Omelyan, I. M. Mryglod, R. Folk, Comput. Phys. Commun. 146 (2002), the
    position form of the extended Forest-Ruth-like algorithm.
    """

    name = "pefrl"
    source = "Omelyan, Mryglod, Folk, Comput. Phys. Commun. 146 (2002)"
    undamped_order = 4
    substeps = (
        (_XI, 1 / 2 - _LAMBDA),
        (_CHI, _LAMBDA),
        (1 - 2 * (_CHI + _XI), _LAMBDA),
        (_CHI, 1 / 2 - _LAMBDA),
        (_XI, 0.0),
    )


# Solution A, solved anew from the conditions of order 6.
_W3, _W2, _W1, _W0 = (
    0.7845136104775573,
    0.23557321335935813,
    -1.177679984178871,
    1.3151863206839112,
)


@dataclasses.dataclass(frozen=True)
class Yoshida6(Splitting):
    """Seven leapfrogs (drift-kick-drift) of w3, w2, w1, w0, w1, w2, w3 times dt; order 6.

    With solution A: w3 = 0.7845136104775573, w2 = 0.23557321335935813, w1 = -1.177679984178871,
    w0 = 1.3151863206839112. An oscillation of frequency omega is stable up to ``omega dt = 2.27``
    without damping, to 1.29 where the rate r of its damping is 5/dt, and to 0.08 where it is 10/dt.

    Arguments:
        damping: as for `leapfrog`: `exact`, with which the order holds, or `explicit`, order 1.

    Source: H. Yoshida, Phys. Lett. A 150 (1990), table 1, solution A; Hairer, Lubich, Wanner,
    Geometric Numerical Integration, eq. (V.3.11).
    """

    name = "yoshida6"
    source = "Hairer, Lubich, Wanner, Geometric Numerical Integration, (V.3.11)"
    undamped_order = 6
    substeps = _composed(_W3, _W2, _W1, _W0, _W1, _W2, _W3)
