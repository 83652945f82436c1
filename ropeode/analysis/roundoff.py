"""How much of a run is round-off, found by making it again in other units."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

from ropeode.norms import Norm, distance
from ropeode.problems.links import LinearDamping, Links
from ropeode.problems.problem import FirstOrderForm, Mechanics, Problem
from ropeode.simulation import Trajectory, simulate

# The ratio of the units. Any number does whose binary digits have no pattern; near 1, so that
# the last place of most numbers stays worth about the same.
_RATIO = 1.0 / 0.8414709848078965


def in_other_units(problem: Problem) -> Problem:
    """The same problem with its state measured in a unit that is not a power of two.

    In exact arithmetic every stepper makes the same trajectory of it, times the ratio; in
    floating point every single rounding differs.
    """
    mechanics = problem.mechanics
    if mechanics is None:
        rhs: Any = _ScaledRhs(problem.rhs)
    else:
        acceleration = _ScaledAcceleration(mechanics.acceleration)
        rhs = FirstOrderForm(acceleration)
        mechanics = Mechanics(
            acceleration,
            damping=_ScaledDamping(mechanics.damping) if mechanics.damping else None,
            node_axis=mechanics.node_axis,
            links=_ScaledLinks(mechanics.links) if mechanics.links else None,
        )
    return problem.changed(
        rhs=rhs,
        y0=problem.y0 * _RATIO,
        args=(np.asarray(_RATIO), problem.args),
        mechanics=mechanics,
        # What is said of the problem in its own units.
        energy=None,
        exact=None,
        constraints=None,
        parameters={},
    )


def round_off(trajectory: Trajectory, rescaled: Problem, samples: int, norm: Norm) -> float:
    """The size of the round-off in a trajectory: its largest distance from its double.

    The double is the same run in other units. Both hold round-off of the same size, but not
    the same one, so that their distance shows how large it is, up to a small factor. This
    sees what no formula does: how stepper and problem let round-off grow, and errors that
    repeat from step to step instead of averaging out (noise added to each step does not see
    those).

    Arguments:
        trajectory: a run that did not diverge.
        rescaled: its problem `in_other_units`.
        samples: look at so many leading samples.
        norm: how distances are measured.
    """
    double = simulate(rescaled, trajectory.stepper, trajectory.steps_per_frame)
    return from_double(trajectory, double, samples, norm)


def from_double(trajectory: Trajectory, double: Trajectory, samples: int, norm: Norm) -> float:
    """The same, with the double run already.

    Arguments:
        trajectory: as for `round_off`.
        double: the run of the problem `in_other_units`.
        samples: as for `round_off`.
        norm: as for `round_off`.
    """
    if double.status != "ok":
        return np.inf
    states = double.states[:samples] / _RATIO
    apart = distance(trajectory.problem, norm, states, trajectory.states[:samples])
    return float(np.max(apart))


# Classes and not closures: equal ones hash equally, so that compiled programs are found again.


@dataclasses.dataclass(frozen=True)
class _ScaledRhs:
    rhs: Callable

    def __call__(self, t: Any, y: Any, args: Any) -> Any:
        ratio, args = args
        return ratio * self.rhs(t, y / ratio, args)


@dataclasses.dataclass(frozen=True)
class _ScaledAcceleration:
    acceleration: Callable

    def __call__(self, t: Any, x: Any, v: Any, args: Any) -> Any:
        ratio, args = args
        return ratio * self.acceleration(t, x / ratio, v / ratio, args)


@dataclasses.dataclass(frozen=True)
class _ScaledDamping:
    damping: Callable

    def __call__(self, args: Any) -> LinearDamping:
        return self.damping(args[1])


@dataclasses.dataclass(frozen=True)
class _ScaledLinks:
    links: Callable

    def __call__(self, args: Any) -> Links:
        ratio, args = args
        links = self.links(args)
        return links._replace(length=ratio * links.length, acceleration=ratio * links.acceleration)
