"""The round-off in a run, measured by repeating the run in other units."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ropeode.norms import Norm, distance
from ropeode.problems import FirstOrderForm, Problem
from ropeode.problems.links import LinearDamping, Links
from ropeode.references import Reference
from ropeode.simulation import InUnits, Method, Trajectory, method_of, simulate
from ropeode.steppers import BuiltIn

# The ratio of the units. Any number will do whose binary digits have no pattern. It is near 1, so
# that the last place of most numbers keeps about the same value.
_INVERSE = 0.8414709848078965
_RATIO = 1.0 / _INVERSE
# An error is a stepper's own, to well below 1%, if it is so many times what the reference and
# round-off leave open, and so many times what one rounding in each step makes that repeats.
# (Rounded coefficients are the same in all units; what they do grows with each step.)
_CLEAR, _DRIFT = 300.0, 30.0
# Steps per frame, of which few are unstable, and how closely a frame with them has to agree.
_FINE, _SAME = 256, 1e-6


def in_other_units(problem: Problem) -> Problem:
    """The same problem with its state measured in a unit that is not a power of two.

    In exact arithmetic every stepper gives the same trajectory, times the ratio; in floating
    point every rounding differs.
    """
    mechanics = problem.mechanics
    # For ropes whose members may be interleaved: arrays like those of all nodes.
    shape = (1, 1) if mechanics is not None and mechanics.in_turn else ()
    if mechanics is None:
        rhs: Any = _Scaled(problem.rhs)
    else:
        acceleration = _Scaled(mechanics.acceleration)
        rhs = FirstOrderForm(acceleration)
        mechanics = dataclasses.replace(
            mechanics,
            acceleration=acceleration,
            damping=_ScaledDamping(mechanics.damping) if mechanics.damping else None,
            links=_ScaledLinks(mechanics.links) if mechanics.links else None,
        )
    return problem.changed(
        rhs=rhs,
        y0=problem.y0 * _RATIO,
        args=InUnits(_Units(np.full(shape, _RATIO), np.full(shape, _INVERSE)), problem.args),
        mechanics=mechanics,
        # These are in the units of the problem itself.
        energy=None,
        exact=None,
        constraints=None,
        parameters={},
    )


def round_off(
    trajectory: Trajectory,
    rescaled: Problem,
    samples: int,
    norms: Sequence[Norm],
    method: Method | None = None,
) -> tuple[float | None, ...]:
    """The size of the round-off in a trajectory: its distance from the same run in other units.

    Both runs have round-off of the same size, but different round-off, so that their distance
    shows the size up to a small factor. It includes what no formula gives: how stepper and
    problem amplify round-off, and errors that repeat from step to step instead of averaging
    out. (Noise added to each step does not show those.)

    Arguments:
        trajectory: a run that did not diverge.
        rescaled: its problem `in_other_units`.
        samples: how many samples, from the first on, count.
        norms: the measures of the distance.
        method: the trajectory's stepper, ready to run, where the caller has it.

    Returns:
        The distance in each norm; infinity where the other run diverges; None where the stepper
        computes forces of its own, which do not know the other units.
    """
    method = method or method_of(trajectory.stepper, trajectory.problem)
    if not keeps_units(trajectory.problem, method, rescaled):
        return (None,) * len(norms)
    repeated = simulate(rescaled, method, trajectory.steps_per_frame)
    return tuple(distance_of_runs(trajectory, repeated, samples, norm) for norm in norms)


def distance_of_runs(
    trajectory: Trajectory, repeated: Trajectory, samples: int, norm: Norm
) -> float:
    """As `round_off`, from the run `in_other_units`; infinite if that diverged."""
    if repeated.status != "ok":
        return np.inf
    states = repeated.states[:samples] / _RATIO
    return largest_distance(trajectory.problem, norm, states, trajectory.states[:samples])


def largest_distance(problem: Problem, norm: Norm, a: np.ndarray, b: np.ndarray) -> float:
    """The largest distance of two runs ``(times, *state)``, neither of which is the truth."""
    return float(np.max(distance(problem, norm, a, b)))


def least_clear_error(reference: Reference, norm: Norm, dt: float, rounding: float | None) -> float:
    """The smallest error of a run that is the stepper's own, without a part of 1% of anything else.

    Arguments:
        reference: that the error is measured against.
        norm: in which it is measured.
        dt: step size of the run.
        rounding: its round-off in that norm; None where nobody knows.
    """
    problem, last = reference.problem, reference.trusted - 1
    steps = float(problem.ts[last] - problem.ts[0]) / dt
    drift = float(np.finfo(np.float64).eps) * problem.scale * steps
    return max(_CLEAR * (float(reference.bound(norm)[last]) + (rounding or 0.0)), _DRIFT * drift)


def keeps_units(problem: Problem, method: Method, rescaled: Problem) -> bool:
    """Whether a frame of fine steps is the same, but for rounding, `in_other_units`."""
    if isinstance(method.stepper, BuiltIn):
        return True
    first = {"ts": problem.ts[:2]}
    own = simulate(problem.changed(**first), method, _FINE).states
    other = simulate(rescaled.changed(**first), method, _FINE).states / _RATIO
    size = np.max(np.abs(own)) if len(own) == len(other) else np.nan
    return bool(np.max(np.abs(own - other)) <= _SAME * size)


class _Units(NamedTuple):
    """The ratio of two units, and its inverse.

    The inverse is there so that nothing is divided: XLA turns division by a single number into
    multiplication by its inverse, but divides by an array, and would round an ensemble in another
    way than its members alone.
    """

    ratio: Any
    inverse: Any


# Classes, not closures: equal instances hash equally, so that compiled programs are reused.


@dataclasses.dataclass(frozen=True)
class _Scaled:
    """A right-hand side ``(t, y, args)``, or an acceleration ``(t, x, v, args)``."""

    function: Callable

    def __call__(self, t: Any, *state_and_args: Any) -> Any:
        *state, (units, args) = state_and_args
        return units.ratio * self.function(t, *(units.inverse * each for each in state), args)


@dataclasses.dataclass(frozen=True)
class _ScaledDamping:
    damping: Callable

    def __call__(self, args: Any) -> LinearDamping:
        return self.damping(args[1])


@dataclasses.dataclass(frozen=True)
class _ScaledLinks:
    links: Callable

    def __call__(self, args: Any) -> Links:
        units, args = args
        links = self.links(args)
        # Of nodes in turn there are more than of links; it is the same for all of them.
        of_links = units.ratio.reshape(-1)[: links.length.shape[-1]]
        return links._replace(
            length=of_links * links.length, acceleration=units.ratio * links.acceleration
        )
