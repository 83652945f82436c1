"""Ropes and states at which a step is expanded: nothing is symmetric, equal, zero or at rest."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ropeode.checking.check_context import Examination
from ropeode.checking.check_ropes import CROOKED, check_rope
from ropeode.problems import Problem
from ropeode.theory import EXPANSION_STEPS, Expansion, StepSamples, expanded

# States on each rope, and on the one that a `Probe` has; the longest step.
_STATES, _FEW, LONGEST = 12, 3, 0.5


@functools.cache
def probe_ropes() -> tuple[Problem, ...]:
    """Two ropes with different parameters, which tell a factor from a number of its own."""
    first = check_rope(
        "first",
        CROOKED,
        (0.0, 1.0),
        mass=(0.8, 1.25, 0.6, 1.45, 0.95),
        stiffness=(3.1, 4.4, 2.6, 5.3),
        rest_length=(0.75, 1.35, 0.6, 1.15),
        pinned=(1,),
        gravity=(0.37, -0.81, 0.23),
        damping=(0.21, 0.12, 0.43, 0.31, 0.26),
        drive=(0.92, 0.71, -1.13),
        frequency=2.3,
    )
    second = check_rope(
        "second",
        CROOKED,
        (0.0, 1.0),
        mass=(1.35, 0.7, 1.15, 0.55, 1.6),
        stiffness=(2.2, 3.7, 5.1, 2.9),
        rest_length=(1.65, 0.7, 0.95, 1.4),
        pinned=(1,),
        gravity=(-0.52, -0.67, 0.41),
        damping=(0.33, 0.41, 0.17, 0.22, 0.38),
        drive=(-0.64, 1.07, 0.83),
        frequency=3.1,
    )
    return first, second


class Region(NamedTuple):
    """Where the states are.

    Fields:
        words: that say it.
        lengths, speeds: by which factor springs are longer and nodes faster than in the middle.
        times: from and to.
        longest: step that is made.
    """

    words: str = ""
    lengths: float = 1.0
    speeds: float = 1.0
    times: tuple[float, float] = (0.2, 2.0)
    longest: float = LONGEST


USUAL = Region()
AT_REST = Region("at rest", speeds=0.0)
# Each far from the usual states in one respect. Where the motion is fast, steps are short, too: so
# short steps come first.
ELSEWHERE = (
    *(Region(f"in steps shorter than {dt:g}", longest=dt) for dt in (1e-3, 1e-5)),
    Region("at times from 5 to 50", times=(5.0, 50.0)),
    Region("at times from 500 to 5000", times=(500.0, 5000.0)),
    Region("at times from -5 to -1", times=(-5.0, -1.0)),
    Region("at speeds of about 1e-4", speeds=1e-4),
    Region("at speeds of about 300", speeds=300.0),
    Region("where springs are stretched to four times their length", lengths=4.0),
    Region("where springs are pressed to a third of their length", lengths=0.3),
)


class Probe:
    """A step from a few states of the first rope, of which many variants are tried.

    Attributes:
        problem: the rope.
        t, y: times ``(states,)`` and states ``(states, *state)``.
    """

    def __init__(self, examination: Examination):
        self.problem = examination.told(probe_ropes()[0])
        self._method = examination.method
        t, y = _drawn(self.problem, 0, USUAL)
        self.t, self.y = t[:_FEW], y[:_FEW]

    def after(
        self, t: np.ndarray, y: np.ndarray, dt: np.ndarray, problem: Problem | None = None
    ) -> np.ndarray:
        """The states after one step; of a stepper that may remember more than them, after several.

        Arguments:
            t: times, ``(cases,)``.
            y: states, ``(cases, *state)``.
            dt: step sizes, ``(cases,)``.
            problem: another rope.
        """
        samples = StepSamples(self.problem if problem is None else problem, self._method)
        steps = 1 if samples.carries_state else EXPANSION_STEPS
        return samples.after(t, y, dt[:, None], steps)[:, 0, -1]


def _drawn(problem: Problem, seed: int, region: Region) -> tuple[np.ndarray, np.ndarray]:
    """Random times and states of a rope."""
    draw = np.random.default_rng(seed)
    free = problem.args.free[:, None]
    x = CROOKED + 0.25 * draw.normal(size=(_STATES, *CROOKED.shape)) * free
    v = draw.normal(size=x.shape) * free
    t = draw.uniform(*region.times, _STATES)
    pin = CROOKED[problem.args.free == 0.0][0]
    return t, np.stack([pin + region.lengths * (x - pin), region.speeds * v], axis=1)


def expansions(
    examination: Examination, region: Region = USUAL, changed: Sequence[tuple[str, float]] = ()
) -> list[Expansion]:
    """The expansions of a step at random states of `probe_ropes`.

    Arguments:
        examination: of the stepper.
        region: where the states are.
        changed: fields of `CheckArgs`, with the number that all of their elements become.

    Raises:
        UserCodeError: the step raised.
    """
    found = []
    for seed, rope in enumerate(probe_ropes()):
        problem = examination.told(rope)
        t, y = _drawn(problem, seed, region)
        args = problem.args
        others = {name: np.full_like(getattr(args, name), value) for name, value in changed}
        samples = StepSamples(problem.changed(args=args._replace(**others)), examination.method)
        found.append(expanded(samples, t, y, region.longest))
    return found
