"""Whether a figure's claim holds for a motion; and motions and theory in words."""

from __future__ import annotations

import math

from ropeode.analysis import Motion
from ropeode.case_studies.figures import Claim
from ropeode.theory import Growth
from ropeode.validation import bad_value

HOLDS, FAILS, TOO_SHORT = "holds", "does not hold", "not watched long enough"
# Ropes are watched for so much longer than linear theory needs to show them at rest, or apart, and
# for so many frames to see them swing, which is three times.
MARGIN, _SWINGING = 1.25, 400


def holds_until(frame: int) -> str:
    """The verdict on a claim that holds up to a frame and not beyond it."""
    return f"holds until frame {frame}"


def verdict(claim: Claim, motion: Motion, growth: Growth) -> str:
    """Whether a claim holds: `HOLDS`, `FAILS`, `holds_until` a frame, or `TOO_SHORT`.

    A claim about what lasts holds until the frame at which it ends. Where linear theory has
    the rope come to rest later on, that it never settles holds as long as it was watched. What
    did not happen fails, unless theory has it happen later than the rope was watched.

    Arguments:
        claim: of a figure in which something moves.
        motion: of its rope.
        growth: of disturbances of hanging still, by linear theory.
    """
    found = _verdict(claim, motion, growth)
    late = found == FAILS and motion.frames < MARGIN * _expected(claim, motion, growth)
    return TOO_SHORT if late else found


def _expected(claim: Claim, motion: Motion, growth: Growth) -> float:
    """The frame by which a claim should have come true; 0 where it never will."""
    if motion.settled_at is not None or motion.diverged_at is not None:
        return 0.0
    if claim == "diverges":
        return growth.predicted_blow_up or 0.0
    if claim == "swings":
        return _SWINGING / MARGIN
    if claim == "settles_without_swinging" and motion.swings:
        return 0.0
    return rest_expected(motion, growth) or 0.0


def _verdict(claim: Claim, motion: Motion, growth: Growth) -> str:
    if claim == "diverges":
        return HOLDS if motion.diverged_at is not None else FAILS
    if claim == "swings":
        return _lasting(motion.swings > 0, motion.diverged_at)
    if claim == "never_settles":
        if motion.settled_at is not None and motion.unsettled_at is None:
            return FAILS
        if motion.diverged_at is not None:
            return holds_until(motion.diverged_at)
        return holds_until(motion.frames) if rest_expected(motion, growth) else HOLDS
    settled = motion.settled_at is not None
    if claim == "settles_without_swinging":
        settled = settled and not motion.swings
    elif claim != "settles":
        raise bad_value("claim", claim, "the claim of a figure that moves", "choose one")
    return _lasting(settled, motion.unsettled_at)


def _lasting(so_far: bool, ended_at: int | None) -> str:
    if not so_far:
        return FAILS
    return HOLDS if ended_at is None else holds_until(ended_at)


def rest_expected(motion: Motion, growth: Growth) -> int | None:
    """The frame by which the slowest mode should have decayed to what counts as rest.

    By linear theory; None where it does not decay.
    """
    if growth.rate >= -growth.tolerance:
        return None
    return math.ceil(-math.log(motion.thresholds.speed) / -growth.rate)


def measured(motion: Motion, growth: Growth) -> str:
    """What a rope did, in a sentence without its end."""
    swings = f"{motion.swings} swing{'s' if motion.swings != 1 else ''}"
    words = [swings if motion.swings else "no swing"]
    if motion.settled_at is not None:
        left = f" to {motion.unsettled_at}" if motion.unsettled_at is not None else ""
        words.append(f"at rest from frame {motion.settled_at}{left}")
    if motion.diverged_at is not None:
        words.append(f"flies apart at frame {motion.diverged_at}")
    elif motion.settled_at is None or motion.unsettled_at is not None:
        words.append(f"moving at frame {motion.frames}")
        if expected := rest_expected(motion, growth):
            words[-1] += f" (rest expected near {expected})"
    if motion.diverged_at is None:
        words.append(f"stretch {100 * motion.largest_stretch:.2g}%")
    return ", ".join(words)


def predicted(growth: Growth) -> str:
    """What linear theory predicts for a rope that hangs still, in a few words."""
    if not growth.stable:
        return (
            f"unstable: grows by e in {_frames(1 / growth.rate)}, out of rounding by frame "
            f"{growth.predicted_blow_up}"
        )
    if growth.rate < -growth.tolerance:
        return f"stable: slowest mode decays by e in {_frames(-1 / growth.rate)}"
    return "neither grows nor decays"


def _frames(number: float) -> str:
    return f"{number:.0f} frames" if number >= 100 else f"{number:.3g} frames"
