"""How a rope moves, in words: it swings, settles or flies apart."""

from __future__ import annotations

import dataclasses
import functools
from typing import Any, Literal, NamedTuple

import numpy as np

from ropeode.analysis.equilibrium import hanging_equilibrium
from ropeode.display import Tabular
from ropeode.errors import InputError
from ropeode.json_form import Unbounded
from ropeode.problems import Problem
from ropeode.simulation import Trajectory, step_size
from ropeode.validation import bad_value, check_all, check_kind, check_positive, complaint

Verdict = Literal["diverges", "settles", "settles_without_swinging", "never_settles"]

# The part of the run at its end over which the jitter is taken.
_LAST_PART = 0.1
# A rope whose centre of mass is this close to the vertical, in its lengths, is on no side.
_UPRIGHT = 1e-6


@dataclasses.dataclass(frozen=True)
class Thresholds:
    """Where one word ends and the next begins; docs/explanation/motion.md says why there.

    All are in units of the rope's own length L (the sum of the rest lengths), of
    ``V = sqrt(|g| L)`` and ``T = sqrt(L/|g|)``.

    Arguments:
        speed: the rope is at rest where its fastest node is slower than ``speed * V``.
        rest: it has settled where it stays at rest for ``rest * T``.
        stretch: it has diverged where a spring is longer than ``1 + stretch`` rest lengths.
        swing: a swing leads from beyond ``swing * L`` on one side of the vertical to beyond
            it on the other.

    Raises:
        InputError: one is not a finite number above zero.

    Examples:
        >>> from ropeode import Rope, Thresholds, classify_motion, simulate
        >>> run = simulate(Rope(num_nodes=4).problem(frames=3), "rk4", steps_per_frame=16)
        >>> classify_motion(run, Thresholds(stretch=1e-5)).diverged_at
        3
    """

    speed: float = 1e-3
    rest: float = 5.0
    stretch: float = 1.0
    swing: float = 0.05

    def __post_init__(self) -> None:
        check_all(*(functools.partial(self._check, field) for field in dataclasses.fields(self)))

    def _check(self, field: dataclasses.Field) -> None:
        number = check_positive(field.name, getattr(self, field.name), example=str(field.default))
        object.__setattr__(self, field.name, number)


DEFAULT_THRESHOLDS = Thresholds()


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Motion(Tabular):
    """What a rope did, in words and numbers. Frames are indices of samples.

    Everything but `diverged_at` comes from the samples before the run diverged.

    Arguments:
        verdict: `diverges`; or, where the run ends at rest, `settles` or
            `settles_without_swinging`; otherwise `never_settles`, as long as it ran.
        diverged_at: the first frame that is not finite or has a spring too long; or None.
        settled_at: the frame from which on it was at rest, the last time that it came to
            rest for long enough, even if it left that rest again; or None.
        unsettled_at: the frame at which it left that rest; None if it did not.
        swing_times: when it passed the vertical in each swing, interpolated linearly between
            samples; twice the mean distance is the period.
        reached_vertical_at: the first frame with the centre of mass less than a `swing`
            from the vertical, or past it; or None.
        frames: the last frame that was looked at.
        thresholds: that were used.
        largest_stretch: of any spring, in its rest lengths: 0 at rest length.
        largest_stretch_at: its frame.
        jitter: the rate at which springs change length, in rest lengths per frame: root mean
            square over all springs and the last tenth of the frames. Zero for a rope that
            swings like a rod.
        run: the run.

    Examples:
        >>> from ropeode import Rope, classify_motion, simulate
        >>> motion = classify_motion(simulate(Rope(num_nodes=4).problem(frames=3), "rk4", 16))
        >>> motion.verdict, motion.swings, f"{motion.largest_stretch:.1e}"
        ('never_settles', 0, '2.2e-05')
    """

    verdict: Verdict
    diverged_at: int | None
    settled_at: int | None
    unsettled_at: int | None
    swing_times: np.ndarray
    reached_vertical_at: int | None
    frames: int
    thresholds: Thresholds
    largest_stretch: Unbounded
    largest_stretch_at: int
    jitter: Unbounded
    run: Trajectory

    @property
    def swings(self) -> int:
        """How often it swung from one side of the vertical to the other."""
        return len(self.swing_times)

    @functools.cached_property
    def energy_at_rest(self) -> float | None:
        """The energy of hanging still; None if the rope has no stable equilibrium, or no energy."""
        problem = self.run.problem
        try:
            return float(problem.energies(hanging_equilibrium(problem)[None])[0])
        except InputError:
            return None

    @functools.cached_property
    def energy(self) -> np.ndarray | None:
        """Above that of hanging still, as far as that is known, ``(frames + 1,)``; or None."""
        if self.run.problem.energy is None:
            return None
        return self.run.problem.energies(self.run.states[: self.frames + 1]) - (
            self.energy_at_rest or 0.0
        )


class Sensitivity(NamedTuple):
    """The verdict with one threshold changed.

    Fields:
        threshold: which one.
        value: what it was changed to.
        words: the motion then.
        differs: whether its verdict is another one than with the thresholds unchanged.
    """

    threshold: str
    value: float
    words: Motion
    differs: bool

    @property
    def verdict(self) -> Verdict:
        """What the run is called then, in one word."""
        return self.words.verdict


def classify_motion(trajectory: Trajectory, thresholds: Thresholds = DEFAULT_THRESHOLDS) -> Motion:
    """Say how a rope moved.

    The centre of mass of the free nodes says on which side of the first pinned node the rope
    is: along its initial direction, as far as that is across gravity. For a rope that hangs
    along gravity initially, the sides lie in the direction in which it first leaves it.

    Arguments:
        trajectory: of a rope; it may have diverged.
        thresholds: where the words end.

    Raises:
        InputError: the trajectory is not that of a rope that can hang, or its first sample
            has diverged already.

    Examples:
        >>> from ropeode import Rope, classify_motion, simulate
        >>> rope = Rope(num_nodes=4).problem(frames=3)
        >>> classify_motion(simulate(rope, "rk4", steps_per_frame=16)).verdict
        'never_settles'
        >>> classify_motion(simulate(rope, "rk4", steps_per_frame=1)).verdict
        'diverges'
    """
    check_kind("trajectory", trajectory, Trajectory, "simulate")
    args, run = _rope_args(trajectory.problem), trajectory
    rest_length, gravity = np.asarray(args.rest_length), np.asarray(args.gravity)[:, 0]
    length, strength = np.sum(rest_length), np.linalg.norm(gravity)
    # In the units of `Thresholds`. A run that blows up may exceed what can be squared; it has
    # diverged by then anyway.
    with np.errstate(over="ignore", invalid="ignore"):
        times = (run.times - run.times[0]) * np.sqrt(strength / length)
        speed = np.max(_norm(run.velocities), axis=1) / np.sqrt(strength * length)
        stretches = _norm(np.diff(run.positions, axis=1)) / rest_length - 1.0
        aside = _aside(run.positions, args, gravity / strength) / length
    whole = np.isfinite(speed) & np.all(stretches <= thresholds.stretch, axis=1)
    broken = np.flatnonzero(~whole)
    diverged_at = int(broken[0]) if len(broken) else run.diverged_at
    kept = len(whole) if diverged_at is None else diverged_at
    if kept == 0:
        raise bad_value(
            "trajectory",
            "a first sample that has diverged",
            "a run that starts finite, with springs not longer than the threshold `stretch`",
            "start it in another state, or raise stretch",
        )
    at_rest = speed[:kept] < thresholds.speed
    settled_at, end = _last_rest(times[:kept], at_rest, thresholds.rest)
    left = settled_at is not None and (end < kept or diverged_at is not None)
    aside = aside[:kept]
    first_side = np.sign(aside[np.argmax(np.abs(aside) > thresholds.swing)])
    reached = np.flatnonzero(aside * first_side <= thresholds.swing)
    swing_times = _passed_vertical(run.times[:kept], aside, thresholds.swing)

    verdict: Verdict = "never_settles"
    if diverged_at is not None:
        verdict = "diverges"
    elif settled_at is not None and not left:
        verdict = "settles" if len(swing_times) else "settles_without_swinging"
    stretch = np.max(stretches[:kept], axis=1)
    last = slice(kept - max(1, round(_LAST_PART * kept)), kept)
    return Motion(
        verdict=verdict,
        diverged_at=diverged_at,
        settled_at=settled_at,
        unsettled_at=end if left else None,
        swing_times=swing_times,
        reached_vertical_at=int(reached[0]) if len(reached) else None,
        frames=kept - 1,
        thresholds=thresholds,
        largest_stretch=float(np.max(stretch)),
        largest_stretch_at=int(np.argmax(stretch)),
        jitter=float(np.sqrt(np.mean(_lengthening(run, last) ** 2))),
        run=run,
    )


def sensitivity(
    trajectory: Trajectory, thresholds: Thresholds = DEFAULT_THRESHOLDS
) -> tuple[Sensitivity, ...]:
    """How the verdict depends on the thresholds: each of them halved, and doubled.

    Arguments and exceptions are those of `classify_motion`.
    """
    usual = classify_motion(trajectory, thresholds).verdict
    changed = []
    for field in dataclasses.fields(thresholds):
        for factor in (0.5, 2.0):
            value = factor * getattr(thresholds, field.name)
            other = dataclasses.replace(thresholds, **{field.name: value})
            words = classify_motion(trajectory, other)
            changed.append(Sensitivity(field.name, value, words, words.verdict != usual))
    return tuple(changed)


def _rope_args(problem: Problem) -> Any:
    """The problem's args, if they are those of a rope that can hang.

    Raises:
        InputError: they are not.
    """
    problem.require_mechanics("trajectory")
    args = problem.args
    if not all(hasattr(args, name) for name in ("rest_length", "gravity", "free")):
        raise bad_value(
            "trajectory",
            problem.name,
            "a run of a rope (args with rest_length, gravity and free)",
            "build the problem with Rope(...).problem(frames)",
        )
    free, gravity = np.asarray(args.free) > 0, np.asarray(args.gravity)
    pins = np.flatnonzero(~free).tolist()
    needed = [
        (free.size > 1, "num_nodes", free.size, "a rope of 2 nodes or more", "add one"),
        (
            np.any(gravity),
            "gravity",
            gravity[:, 0].tolist(),
            "one that is not zero, since nothing hangs without it",
            "for example gravity = [0, -1]",
        ),
        (
            free.any() and not free.all(),
            "pinned",
            pins,
            "at least one node that is pinned and one that is not",
            "for example pinned = [0]",
        ),
    ]
    if faults := [complaint(*fault) for holds, *fault in needed if not holds]:
        raise InputError(faults)
    return args


def _norm(vectors: np.ndarray) -> np.ndarray:
    return np.sqrt(np.einsum("...i,...i->...", vectors, vectors))


def _aside(x: np.ndarray, args: Any, down: np.ndarray) -> np.ndarray:
    """The centre of mass of the free nodes, sideways from the vertical through the first pin."""
    free = np.asarray(args.free) > 0
    mass = np.asarray(getattr(args, "mass", np.ones(len(free))))[free]
    pin = x[:, np.flatnonzero(~free)[0]]
    across = np.einsum("tnd,n->td", x[:, free], mass / np.sum(mass)) - pin
    across = across - (across @ down)[:, None] * down
    size = _norm(across)
    off = np.flatnonzero((size > _UPRIGHT * np.sum(args.rest_length)) & np.isfinite(size))
    return across @ (across[off[0]] / size[off[0]]) if len(off) else np.zeros(len(x))


def _lengthening(trajectory: Trajectory, samples: slice) -> np.ndarray:
    """The rate of change of each spring's length, in rest lengths per frame.

    Arguments:
        trajectory: of a rope.
        samples: at which; finite ones.
    """
    along = np.diff(trajectory.positions[samples], axis=1)
    apart = np.diff(trajectory.velocities[samples], axis=1)
    length = _norm(along)
    # A spring of length zero has no direction; all of its motion counts.
    rate = np.where(
        length > 0,
        np.einsum("...i,...i->...", along, apart) / np.where(length > 0, length, 1.0),
        _norm(apart),
    )
    frame = step_size(trajectory.problem, 1)
    return frame * rate / np.asarray(trajectory.problem.args.rest_length)


def _last_rest(times: np.ndarray, at_rest: np.ndarray, least: float) -> tuple[int | None, int]:
    """Where the last rest that is long enough begins, and the frame after its end."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], at_rest, [False]]).astype(np.int8)))
    begins, ends = edges[::2], edges[1::2]
    long = np.flatnonzero(times[ends - 1] - times[begins] >= least)
    return (int(begins[long[-1]]), int(ends[long[-1]])) if len(long) else (None, len(times))


def _passed_vertical(times: np.ndarray, aside: np.ndarray, swing: float) -> np.ndarray:
    """When the vertical was passed on the way from beyond `swing` on one side to the other."""
    beyond = np.flatnonzero(np.abs(aside) > swing)
    turned = np.flatnonzero(np.diff(np.sign(aside[beyond])) != 0)
    passed = []
    for before, after in zip(beyond[turned], beyond[turned + 1], strict=True):
        way = aside[before : after + 1] * np.sign(aside[after])
        past = before + int(np.argmax(way > 0))
        there, here = aside[past - 1], aside[past]
        passed.append(times[past - 1] + (times[past] - times[past - 1]) * there / (there - here))
    return np.array(passed)
