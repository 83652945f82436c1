"""The program that computed files, found by computing the same numbers.

A right program and one with a mistake are short loops of known formulas. Where such a loop, with
one number changed or two, gives the positions in the files to rounding, over frames that were not
used to find them, the mistake is that number: no limit for small steps is needed, and files of
coarse or unstable runs tell as much as others. Mistakes without a number, and slips in methods, are
computed as they are.
"""

from __future__ import annotations

import copy
import functools
import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ropeode.checking.diagnosis.fitted_terms import Change, Fitting, Guess, terms_of
from ropeode.checking.diagnosis.methods import (
    METHODS,
    MISTAKEN,
    VERLET_START,
    Method,
    as_given,
    at_rest,
    semi_implicit_euler,
)
from ropeode.checking.diagnosis.rope_forces import (
    Terms,
    forces_of,
    has_rigid_links,
    has_rope_forces,
    initial_states,
    is_autonomous,
    right_terms,
)
from ropeode.checking.written_precision import last_digit
from ropeode.precision import in_float64
from ropeode.problems import Problem
from ropeode.study import problem_class
from ropeode.theory.terms import TERMS, KnownMistake, known_mistakes

# The step size and the states ``(times, *state)`` of each run.
Runs = Sequence[tuple[float, np.ndarray]]

# A number is found in the first frame; the program must then give those up to here as well. Where
# steps are many, the second frame is enough.
_FRAMES = 3
# How many steps of a run are computed, and of all; those runs come first that have the fewest. A
# single run does not show which of several changes it is.
_MOST_STEPS, _MOST_IN_ALL, _FEWEST_RUNS, _FEWEST_FRAMES = 2048, 3000, 2, 2
# How closely positions must agree, as a part of the motion, or times the rounding of their digits.
_SAME, _OF_ROUNDING = 1e-9, 4.0
# A change must leave at most this part of how far the right program is from the positions.
_LEFT = 1e-3
# The rounding of a whole run, as a relative error of its start; and how much that may explain.
_LAST_BITS, _LARGEST = 2.0**-46, 1e-3
# What moves by less than this part of the motion may seem to stand still in few digits.
_STILL = 1e-3
# The most iterations of a fit to a first frame.
_ITERATIONS = 20
# A program that is so much farther from the positions in one file than in another one grows without
# bound there.
_GROWN = 2.0
# Where the right program of a method is within such a part of the motion, and so many times closer
# than that of another one, no change of the other one is what was made. Farther off that says
# nothing: Verlet that starts at rest is near every method that forgets the initial velocity.
_CLOSE, _CLOSER = 1e-4, 10.0
# Pairs of changes are many: they are sought in runs with at most so many steps in a frame, with all
# digits.
_MOST_STEPS_OF_PAIRS = 64
# A method that iterates takes the most time: it is tried without pairs of changes, and with more
# steps in a frame without any. Runs so fine have a limit that shows a change.
_MOST_STEPS_OF_ITERATIONS = 128
# Where a change is the same for all step sizes, or proportional to a power of them; and how closely
# counts of steps are whole.
_ALIKE = 1e-4
# What rounds lengths to single precision leaves differences of the same size as another rounding
# of them, to such a factor. Step sizes so many times apart tell rounding from a method's error.
_AS_SINGLE, _APART = 10.0, 1.9

KEPT = ("kept", "kept_first", "kept_last")
# The terms that a rope without springs does not have, and those that any problem has.
_OF_SPRINGS = {"spring", "rest", "first_ends", "second_ends", "dashpot", "forces"}
_OF_ANY = {*KEPT, "all", "old_forces", "old_gravity", "velocity"}
# The terms that one mistake changes alike.
CHANGES: tuple[Change, ...] = (
    ("velocity",),
    ("gravity",),
    ("spring",),
    ("rest",),
    ("first_ends",),
    ("second_ends",),
    ("damping",),
    ("further",),
    ("dashpot",),
    ("per_spring",),
    ("forces",),
    ("all",),
    *((name,) for name in KEPT),
    ("old_forces",),
    ("old_forces", "old_gravity"),
    # A velocity that is multiplied after the forces have changed it.
    ("kept", "all"),
)
# Of these any two may be changed at once.
_IN_PAIRS = (
    *("gravity", "spring", "rest", "first_ends", "second_ends", "damping", "further", "dashpot"),
    *("per_spring", "forces", "kept", "velocity"),
)


_RIGHT = Guess()


class Wrong(NamedTuple):
    """What is wrong with a program, in words.

    Fields:
        cause: of a diagnosis.
        words: a sentence.
        remedy: how to mend it.
    """

    cause: str
    words: str
    remedy: str


_FORGETS = Wrong(
    "start",
    "the initial velocity is forgotten: the first step begins with the last position at the first "
    "one",
    "last = x - dt * v + dt * dt / 2 * a",
)
_SINGLE = Wrong(
    "float32",
    "a part of the force, such as the length of a spring, is in single precision",
    "compute in double precision throughout",
)


class Changed(NamedTuple):
    """Terms that have another value than in a right program.

    Fields:
        terms: of `TERMS`.
        found: their value in each run, by step size.
    """

    terms: tuple[str, ...]
    found: dict[float, float]

    @property
    def power(self) -> float | None:
        """To which power of dt the terms are changed.

        0 for a change that is the same at all step sizes, 1 for a factor that is proportional to
        dt, and so on; None if it follows no power, or vanishes with dt as the error of a method
        does, which is no mistake.
        """
        dts, values = (np.array(each) for each in zip(*self.found.items(), strict=True))
        expected = TERMS[self.terms[0]].expected
        change = values - expected
        if self.terms[0] in KEPT:
            candidates = [(0.0, change), (1.0, change)]
        elif expected == 0.0:
            candidates = [(0.0, change), (-1.0, change)]
        else:
            candidates = [(0.0, change), *((exponent, values) for exponent in (1.0, -1.0, 2.0))]
        for exponent, numbers in candidates:
            scaled = numbers / dts**exponent
            if np.max(np.abs(scaled - scaled[0])) <= _ALIKE * np.abs(scaled[0]):
                return exponent
        return None


class Program(NamedTuple):
    """A program that computes the positions in the files.

    Fields:
        method: that it has.
        misfit: the largest difference of positions, as a part of the motion.
        frames: in which they agree.
        changes: of its terms; none if it is right.
        mistakes: known ones, in place of changes by a number.
        wrong: whatever else is wrong in it.
        alike: the methods that compute the same here, if they have different orders: then nothing
            is known of the method.
    """

    method: Method
    misfit: float
    frames: int
    changes: tuple[Changed, ...] = ()
    mistakes: tuple[KnownMistake, ...] = ()
    wrong: tuple[Wrong, ...] = ()
    alike: tuple[str, ...] = ()

    @property
    def is_right(self) -> bool:
        """Whether nothing in it is wrong."""
        return not (self.changes or self.mistakes or self.wrong)

    @property
    def power(self) -> float | None:
        """That of a change; 0 if there is none, or several, which are the same at all steps."""
        return self.changes[0].power if len(self.changes) == 1 else 0.0


class _Run:
    """The first frames of a run, and programs that should compute them.

    Arguments:
        problem: a rope.
        dt: step size.
        states: ``(times, 2, dim, nodes)``.
    """

    def __init__(self, problem: Problem, dt: float, states: np.ndarray):
        self._problem, self.dt = problem, dt
        frame = float(np.max(np.diff(problem.ts[: _FRAMES + 1])))
        frames = min(_FRAMES, problem.frames, max(2, int(_MOST_STEPS * dt / frame)))
        finite = np.all(np.isfinite(states[: frames + 1, 0]), axis=(1, 2))
        self.frames = max(0, int(np.argmin([*finite, False])) - 1)
        self._ts = problem.ts[: self.frames + 1]
        # How many steps make each frame.
        self.counts = np.rint(np.diff(self._ts) / dt).astype(int)
        self.positions = states[: self.frames + 1, 0]
        motion = float(np.max(np.abs(self.positions - self.positions[:1]), initial=0.0))
        self._motion = motion or math.nan
        rounding = last_digit(self.positions)
        self.same = max(_SAME, _OF_ROUNDING * rounding / self._motion)
        self._right: dict[Method, np.ndarray] = {}

    @property
    def usable(self) -> bool:
        """Whether whole steps end at the samples, not too many, and the numbers tell enough."""
        whole = np.all(np.abs(np.diff(self._ts) / self.dt - self.counts) < _ALIKE)
        few = np.sum(self.counts) <= _MOST_STEPS
        precise = self.same <= _LARGEST
        return bool(self.frames >= 1 and whole and few and precise and self._motion > 0.0)

    def while_before_the_end(self) -> _Run:
        """The run of a program that makes steps while ``t < end``, and adds them up to t."""
        counts, t = [], float(self._ts[0])
        for end in self._ts[1:]:
            counts.append(0)
            while t < end:
                t, counts[-1] = t + self.dt, counts[-1] + 1
        other = copy.copy(self)
        other.counts = np.array(counts)
        return other

    def misfits(self, motion: np.ndarray) -> np.ndarray:
        """Differences from the positions, as parts of how far these move, ``(copies, numbers)``.

        Arguments:
            motion: positions at the first samples, as `motion` has them.
        """
        apart = (motion - self.positions[1 : motion.shape[1] + 1]) / self._motion
        return np.nan_to_num(apart.reshape(len(motion), -1), nan=np.inf)

    def from_right(self, method: Method) -> np.ndarray:
        """The misfits of the right program of a method."""
        if method not in self._right:
            motion = self.motion(method, right_terms(1))
            self._right[method] = self.misfits(motion)
        return self._right[method]

    def motion(
        self,
        method: Method,
        terms: Terms,
        samples: int | None = None,
        *,
        single: bool = False,
        shaken: float = 0.0,
    ) -> np.ndarray:
        """The positions that copies of a program compute, ``(copies, samples, dim, nodes)``.

        Arguments:
            method: of the program.
            terms: of each copy.
            samples: how many of them, beside the first; None for all.
            single: whether lengths are rounded to single precision.
            shaken: by which part of their size the initial positions are off.
        """
        problem, dt = self._problem, self.dt
        x, v = initial_states(problem, terms)
        x = x * (1.0 + shaken)
        kept = (terms["kept"] * terms["kept_first"])[:, None, None]
        v = method.start(lambda x, v: forces_of(problem, terms)(x, kept * v), x, v, dt)
        kept_last = terms["kept_last"][:, None, None]
        forces, last, places = forces_of(problem, terms, single=single), x - dt * v, []
        for count in self.counts[:samples]:
            for _ in range(count):
                if method.restores == "before":
                    x = _restored(x, problem.args)
                if method.restores:
                    v = (x - last) / dt
                last = x
                x, v = method.step(forces, x, kept * v, dt)
                v = kept_last * v
                if method.restores == "after":
                    x = _restored(x, problem.args)
            places.append(x)
        return np.stack(places, axis=1)

    def fitting(self, method: Method) -> Fitting:
        """Changes terms so that a program computes the positions."""
        uncertainty = np.full(self.positions.shape, self.same * self._motion)
        return Fitting(
            functools.partial(self.motion, method),
            self.positions,
            uncertainty,
        )

    def fitted(self, method: Method, guesses: Sequence[Guess]) -> list[Guess]:
        """The guesses with the values that give the first frame, as far as any does."""
        starts = [guess for guess in guesses if guess.changes]
        fits = self.fitting(method).fits(starts, 1, _ITERATIONS)
        return [*(each for each in guesses if not each.changes), *(fit.guess for fit in fits)]

    def agreeing(self, method: Method, guesses: Sequence[Guess]) -> list[tuple[Guess, float]]:
        """Guesses that compute all frames, each with its misfit."""
        found = [(guess, 0.0) for guess in guesses]
        # The first frame excludes most.
        for frames in (1, None):
            if not found:
                break
            guesses = [guess for guess, _ in found]
            terms = terms_of([_RIGHT, *guesses])
            apart = self.misfits(self.motion(method, terms, frames))
            right, *misfits = np.max(np.abs(apart), axis=1).tolist()
            allowed = np.full(len(misfits), self.same)
            if any(self.same < each <= _LARGEST for each in (right, *misfits)):
                # An unstable program makes much of the last bit, in which right ones may differ.
                shaken = self.misfits(self.motion(method, terms, frames, shaken=_LAST_BITS))
                by_rounding = np.max(np.abs(shaken - apart), axis=1)[1:]
                allowed = np.maximum(self.same, np.minimum(by_rounding, _LARGEST))
            found = [
                (guess, misfit)
                for guess, misfit, most in zip(guesses, misfits, allowed, strict=True)
                if misfit <= (most if guess == _RIGHT else min(most, _LEFT * right))
            ]
        return found


def _restored(x: np.ndarray, args: Any) -> np.ndarray:
    """One sweep over rigid links: each is put back to its length, by the ends that are free."""
    nodes = list(np.moveaxis(x, 2, 0).copy())
    for link, rest in enumerate(args.rest_length):
        before, behind = args.free[link : link + 2]
        if before or behind:
            d = nodes[link + 1] - nodes[link]
            length = np.sqrt(np.einsum("ij,ij->i", d, d))
            excess = d * ((1.0 - rest / length) / (before + behind))[:, None]
            nodes[link] += before * excess
            nodes[link + 1] -= behind * excess
    return np.stack(nodes, axis=2)


@in_float64
def programs_of(
    problem: Problem, runs: Runs, unforced: tuple[list[int], list[int]], changes: int
) -> tuple[Program, ...]:
    """The programs that compute the positions of all runs in their first frames.

    Arguments:
        problem: whose forces depend on no time, such as a rope with springs or with rigid links.
        runs: step size and states of each; not-a-number from where it diverged.
        unforced: the nodes that no force moves, as `unforced_nodes` has them.
        changes: 2 to look for two changes at once, of which one may be a slip in the method, where
            no program with at most 1 computes them; this takes longer.

    Returns:
        Programs of one method, with the same number of changes, between which the runs cannot
        decide; none if no method of `METHODS`, with so many changes, and none of `MISTAKEN`
        computes them.
    """
    rope = has_rope_forces(problem)
    if not (rope or is_autonomous(problem)):
        return ()
    kind = "rigid links" if has_rigid_links(problem) else "springs"
    if rope and any(unforced):
        free, y0, (still, drifting) = problem.args.free.copy(), problem.y0.copy(), unforced
        free[still + drifting] = 0.0
        y0[1][:, still] = 0.0
        problem = problem.with_numbers(y0, problem.args._replace(free=free), problem.parameters)
    known = [_Run(problem, dt, states) for dt, states in runs]
    known = sorted((run for run in known if run.usable), key=lambda run: -run.dt)
    in_all = np.cumsum([np.sum(run.counts) for run in known])
    known = known[: max(int(np.sum(in_all <= _MOST_IN_ALL)), _FEWEST_RUNS)]
    precise = [run for run in known if run.same <= _SAME]
    of_pairs = precise if precise and precise[0].counts[0] <= _MOST_STEPS_OF_PAIRS else []
    if not (known if changes == 1 else of_pairs):
        return ()
    # A number is found in a frame, and another one shows that it is right.
    longer = [run for run in known if run.frames >= _FEWEST_FRAMES]
    longer = longer if len(longer) >= _FEWEST_RUNS else []
    by_time = [run.while_before_the_end() for run in longer]
    late = _steps_too_many(longer, by_time)
    right, changed = [_RIGHT], [_RIGHT]
    every = known_mistakes(problem.args) if rope else []
    single = [Guess(mistakes=(each,)) for each in every]
    mistakes = [each for each in single if each.mistakes[0].number is None]
    both = [Guess(mistakes=each) for each in itertools.combinations(every, 2)]
    own = {*TERMS} - (_OF_SPRINGS if kind == "rigid links" else set()) if rope else _OF_ANY
    if not np.any(problem.y0[1]):
        own = own - {"velocity"}
    for terms in CHANGES:
        # The forces of any problem are known as a whole.
        if own >= {*terms} and (rope or terms != ("old_forces",)):
            changed += [Guess((terms,), (start,)) for start in TERMS[terms[0]].starts]
    unlikely = "further" if rope and np.any(problem.args.damping) else "damping"
    in_pairs = [(name,) for name in _IN_PAIRS if name in own - {unlikely}]
    methods = METHODS[kind]
    fine = known[0].counts[0] > _MOST_STEPS_OF_ITERATIONS
    with np.errstate(all="ignore"):  # Programs that blow up.
        close = _close(methods, known[0])
    quick = tuple(each for each in close if not each.iterates)
    cheap = quick if fine else close
    mistaken = MISTAKEN if kind == "springs" else ()
    searches: dict[int, Sequence[tuple[tuple[Method, ...], Callable[[Method], list[Program]]]]] = {
        1: (
            (close, lambda method: _programs(method, right, longer)),
            (methods if late else (), lambda method: _programs(method, right, by_time, late)),
            (mistaken, lambda method: _programs(method, right, known)),
            (cheap, lambda method: _programs(method, mistakes, known)),
            (cheap, lambda method: _programs(method, changed, longer)),
            (close if rope else (), lambda method: _in_single(method, longer)),
        ),
        2: (
            (quick, lambda method: _programs(method, both, of_pairs)),
            (mistaken, lambda method: _programs(method, single, of_pairs)),
            (quick, lambda method: _with_two_changes(method, in_pairs, longer)),
        ),
    }
    with np.errstate(all="ignore"):  # Programs that blow up.
        for of, search in searches[changes]:
            found: list[Program] = []
            for method in of:
                found += search(method)
                if any(each.power == 0.0 for each in found if not each.is_right):
                    break
            powers = [each for each in found if each.power is not None]
            if powers:
                simple = [each for each in powers if each.power == 0.0] or powers[:1]
                if simple[0].is_right:
                    simple = [_of_methods(simple, damped=problem_class(problem).damped)]
                return tuple(_named(each, problem) for each in simple)
    return ()


def _close(methods: Sequence[Method], run: _Run) -> tuple[Method, ...]:
    """The methods that a run may have, where some are far closer to it than others."""
    apart = [np.max(np.abs(run.from_right(method))) for method in methods]
    if min(apart) > _CLOSE:
        return tuple(methods)
    most = _CLOSER * max(min(apart), run.same)
    return tuple(method for method, far in zip(methods, apart, strict=True) if far <= most)


def _of_methods(programs: Sequence[Program], *, damped: bool) -> Program:
    """The first of right programs that compute the same, with what is known of their methods."""
    methods = [each.method for each in programs]
    several = len({each.order_if(damped) for each in methods}) > 1
    return programs[0]._replace(alike=tuple(each.name for each in methods) if several else ())


def _named(program: Program, problem: Problem) -> Program:
    """A program with what is known beside the runs."""
    method, moves = program.method, bool(np.any(problem.y0[1]))
    if method.step is semi_implicit_euler and not method.restores:
        if not moves and method.start in (as_given, at_rest):
            name = "semi-implicit Euler (or Störmer-Verlet, which moves alike from rest)"
            method = method._replace(name=name)
        elif moves and method.start is as_given and program.is_right:
            name = "semi-implicit Euler (or Störmer-Verlet with x(-dt) = x(0) - dt * v(0))"
            method = method._replace(name=name, remedy=VERLET_START)
    forgets = (_FORGETS,) if method.start is at_rest and moves else ()
    return program._replace(method=method, wrong=forgets + program.wrong)


def unforced_nodes(problem: Problem, runs: Runs, truth: np.ndarray) -> tuple[list[int], list[int]]:
    """The nodes that forces move, and do so in no run.

    Arguments:
        problem: as for `programs_of`.
        runs: likewise.
        truth: the right states, ``(times, *state)``.

    Returns:
        Those that never move, and those that move on with their initial velocity.
    """
    if problem.mechanics is None:
        return [], []
    right, *places = (problem.positions(states) for states in (truth, *(each for _, each in runs)))
    way, found = np.max(np.abs(right - right[0])), []
    moving = problem.quantity(problem.quantities[1], problem.y0[None])[0]
    # The velocities that nodes keep in all runs, how close these stay to such a line, and how far
    # from it the solution comes.
    for velocities, same, off in (
        (np.zeros_like(moving), 0.0, _STILL * way),
        (moving, _SAME * way, _SAME * way),
    ):
        lines = right[0] + (problem.ts - problem.ts[0])[:, None, None] * velocities
        apart = [np.max(np.abs(each - lines[: len(each)]), axis=(0, 2)) for each in places]
        left = np.max(np.abs(right - lines[: len(right)]), axis=(0, 2)) > off
        found.append(np.flatnonzero(left & np.all(np.array(apart) <= same, axis=0)).tolist())
    still, drifting = found
    return still, [node for node in drifting if node not in still]


def _programs(
    method: Method,
    guesses: Sequence[Guess],
    runs: Sequence[_Run],
    wrong: tuple[Wrong, ...] = (),
) -> list[Program]:
    """The programs of a method that compute the runs.

    Arguments:
        method: of them.
        guesses: what may be wrong in them.
        runs: from coarse to fine.
        wrong: whatever else is wrong in them.
    """
    if not (guesses and runs):
        return []
    first = runs[0].agreeing(method, runs[0].fitted(method, guesses))
    # The first start from which a change is found is enough.
    different: dict[tuple, tuple[Guess, float]] = {}
    for guess, misfit in first:
        said = ((each.kind, each.words) for each in guess.mistakes)
        different.setdefault((guess.changes, *said), (guess, misfit))
    found = []
    for guess, misfit in different.values():
        changes = _followed(method, guess, runs)
        if changes is not None:
            frames = runs[0].frames
            found.append(Program(method, misfit, frames, changes, guess.mistakes, wrong))
    return found


def _steps_too_many(runs: Sequence[_Run], by_time: Sequence[_Run]) -> tuple[Wrong, ...]:
    """What is wrong in the first run that makes more steps while ``t < end``; nothing if none."""
    for run, other in zip(runs, by_time, strict=True):
        if np.any(more := other.counts != run.counts):
            words = (
                f"at dt = {run.dt:.4g} there is a step too many in frame {np.argmax(more) + 1}: "
                "rounded steps are added up to a time that is still below the end of the frame"
            )
            remedy = "count the steps: for (i = 0; i < steps_per_frame; i++)"
            return (Wrong("extra-step", words, remedy),)
    return ()


def _followed(method: Method, guess: Guess, runs: Sequence[_Run]) -> tuple[Changed, ...] | None:
    """The values of a guess at each step size; None if it does not compute all runs."""
    guesses = [guess]
    for run, before in zip(runs[1:], runs, strict=False):
        starts = [guesses[-1]]
        if len(guess.changes) == 1:
            (change,), (value,), ratio = guess.changes, guesses[-1].values, run.dt / before.dt
            expected = TERMS[change[0]].expected
            off = value - expected
            starts += [
                guess._replace(values=(start,))
                for start in (
                    *(expected + off * r for r in (ratio, 1.0 / ratio)),
                    *(value * ratio, value / ratio),
                )
            ]
        # With all digits a value need not be found anew.
        agreeing = run.agreeing(method, starts) if run.same <= _SAME else []
        if not agreeing and len(guess.changes) <= 1:
            agreeing = run.agreeing(method, run.fitted(method, starts))
        if not agreeing:
            return None
        guesses.append(agreeing[0][0])
    dts = [run.dt for run in runs]
    return tuple(
        Changed(change, dict(zip(dts, values, strict=True)))
        for change, *values in zip(guess.changes, *(each.values for each in guesses), strict=True)
    )


def _with_two_changes(
    method: Method, changes: Sequence[Change], runs: Sequence[_Run]
) -> list[Program]:
    """The programs of a method with two terms changed by the same numbers in all runs."""
    short = [run for run in runs if run.same <= _SAME and run.counts[0] <= _MOST_STEPS_OF_PAIRS]
    if not short:
        return []
    apart = [np.max(np.abs(run.from_right(method))) for run in short]
    # Where the right program grows without bound, no step leads from it to another one.
    base = next(run for run, far in zip(short, apart, strict=True) if far <= _GROWN * min(apart))
    runs = [base, *(run for run in runs if run is not base)]
    fitting = base.fitting(method)
    (pairs,) = fitting.explaining(changes, (2,), _ITERATIONS)
    return _programs(method, [fit.guess for fit in pairs], runs)


def _in_single(method: Method, runs: Sequence[_Run]) -> list[Program]:
    """A right program, if lengths in single precision explain what is left in each run.

    Rounding is as large at all step sizes. How far another right method is from this one is not.
    """
    if not runs:
        return []
    left = []
    for run in runs:
        double = run.from_right(method)
        single = run.misfits(run.motion(method, right_terms(1), single=True))
        left.append(float(np.max(np.abs(double))))
        rounding = float(np.max(np.abs(single - double)))
        # Without springs there are no lengths to round.
        if not 0.0 < rounding / _AS_SINGLE <= left[-1] <= _AS_SINGLE * rounding:
            return []
    # The error of a method of order 1 falls by as much as the step size.
    ratio = runs[0].dt / runs[-1].dt
    stays = ratio >= _APART and left[-1] >= left[0] / math.sqrt(ratio)
    if not stays or max(left) > _LARGEST:
        return []
    return [Program(method, max(left), runs[0].frames, wrong=(_SINGLE,))]
