"""Why the constraint rope comes to rest sooner with more steps per frame."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Literal

import numpy as np

from ropeode.analysis import classify_motion
from ropeode.problems import InextensibleRope
from ropeode.problems.rope import Rope
from ropeode.simulation import simulate
from ropeode.steppers import ConstraintVerlet, StormerVerlet

STEPS_PER_FRAME = (64, 128, 256, 512, 1024)
PER_STEP = 5e-5
# The damping per time that the factor per step amounts to at so many steps per frame.
_SAME_AT = 256
_FRAMES_PER_REST = 1.3

Rule = Literal["per-step", "lagged"]
RopeKind = Literal["constraint", "force"]


@dataclasses.dataclass(frozen=True)
class RestTime:
    """When a rope comes to rest.

    Arguments:
        rope: `constraint` for rigid links, `force` for springs; both by Verlet from rest.
        rule: `per-step`: the factor ``1 - k_d`` in each step; `lagged`: ``1 - rate dt``.
        steps_per_frame: steps in each frame.
        rate: damping per frame: ``k_d`` times the steps per frame, or the same for all.
        settled_at: frame from which on it is at rest; None if it did not come to rest.
    """

    rope: RopeKind
    rule: Rule
    steps_per_frame: int
    rate: float
    settled_at: int | None

    @property
    def product(self) -> float | None:
        """Frames to rest times the damping per frame."""
        return None if self.settled_at is None else self.settled_at * self.rate


def rest_times(
    rope: RopeKind,
    rule: Rule,
    steps_per_frame: Sequence[int] = STEPS_PER_FRAME,
    per_step: float = PER_STEP,
) -> list[RestTime]:
    """Frames to rest at several step sizes, with the damping as a factor per step or per time.

    The damping per time is the one that the factor amounts to at 256 steps per frame.

    Arguments:
        rope: as for `RestTime`.
        rule: as for `RestTime`.
        steps_per_frame: numbers of steps per frame.
        per_step: the factor per step is one less this.
    """
    times = []
    for steps in steps_per_frame:
        rate = per_step * (steps if rule == "per-step" else _SAME_AT)
        damping = per_step if rule == "per-step" else rate
        # An amplitude that decays like exp(-rate t/2) needs 2 ln(1000)/rate for a thousandth.
        frames = int(np.ceil(_FRAMES_PER_REST * 2 * np.log(1e3) / rate)) + 200
        stepper = ConstraintVerlet if rope == "constraint" else StormerVerlet
        problem = (InextensibleRope if rope == "constraint" else Rope)(damping=damping)
        run = simulate(problem.problem(frames), stepper(start="rest", damping=rule), steps)
        motion = classify_motion(run)
        settled = motion.settled_at if motion.unsettled_at is None else None
        times.append(RestTime(rope, rule, steps, rate, settled))
    return times
