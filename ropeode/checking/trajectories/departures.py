"""Runs that are those of a known method up to a frame, and then something else."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterator, Sequence

import numpy as np

from ropeode.analysis import distances, moved
from ropeode.checking.diagnosis.rope_forces import has_rigid_links
from ropeode.checking.report import Diagnosis
from ropeode.checking.simple_numbers import shortest
from ropeode.checking.trajectories.known_methods import (
    MOST_IN_PYTHON,
    beside,
    matching,
    of_the_motion,
    operations,
    steps_per_frame,
)
from ropeode.checking.trajectories.run_files import Run, finite
from ropeode.norms import NORMS, Norm
from ropeode.problems import Problem
from ropeode.references import Reference
from ropeode.theory import is_rope
from ropeode.validation import counted, listed, numbered

# Positions are the same if they differ by this part of the motion, or by so many times the rounding
# of their digits, if those tell enough.
_SAME, _OF_ROUNDING, _FEWEST_DIGITS = 1e-9, 4.0, 1e-5
# They depart if they differ by this part of the motion in the next frame, and by so many times what
# any difference before can have grown to.
_DEPARTS, _OF_GROWTH = 1e-4, 1e3
# So many runs must do so, with step sizes so far apart.
_FEWEST_RUNS, _APART = 2, 1.9
# A frame in which they are the same, and one in which they are not, after the initial state.
_FEWEST_FRAMES = 3
# The finest of them must then be farther from the solution than the method, so many times.
_WORSE = 3.0
# A method is known by its errors, of which so much may be something else.
_OF_ERRORS = 1e-3
# Of these a right-hand side without corners consists: two methods may take a corner differently.
_SMOOTH = {
    *("add", "add_any", "cos", "cosh", "cumsum", "div", "dot_general", "exp", "integer_pow", "log"),
    *("mul", "neg", "pow", "reduce_sum", "rsqrt", "sin", "sinh", "sqrt", "square", "sub", "tan"),
    *("tanh", "broadcast_in_dim", "concatenate", "convert_element_type", "copy", "dynamic_slice"),
    *("expand_dims", "jit", "pad", "pjit", "reshape", "rev", "slice", "split", "squeeze", "stack"),
    "transpose",
}
# No difference of float64 is smaller, as a part of the motion.
_LAST_BIT = 1e-16
_SEED = 1
_MOST_SAID = 3
# So many samples of nodes must be at a limit.
_FEWEST_TIMES = 2
_REMEDY = (
    "look for what acts only at times, such as `if (y < floor)`, a largest speed or length, or a "
    "threshold below which nodes rest; leave it out, or put it into the problem"
)


@dataclasses.dataclass(frozen=True)
class _Departure:
    """A run that departs from a method.

    Distances are parts of how far the solution moves, and those of each node in each sample
    ``(samples, nodes)``.

    Arguments:
        reference: of the problem.
        name: of the stepper.
        run: from a file.
        made: the same of the stepper.
    """

    reference: Reference
    name: str
    run: Run
    made: Run

    @functools.cached_property
    def way(self) -> float:
        """How far the solution moves."""
        return moved(self.reference, _norm(self.reference))

    @functools.cached_property
    def same(self) -> float:
        """How closely positions agree that are the same."""
        rounding = float(np.max(self.run.rounding[: self.run.layout.dim]))
        return max(_SAME, _OF_ROUNDING * rounding / self.way)

    def places(self, of: Run, start: int = 0) -> np.ndarray:
        """The positions of a run that count, from a sample on, ``(samples, nodes, dim)``."""
        return of.values[start : _counted(self.reference), :, : of.layout.dim]

    @functools.cached_property
    def parts(self) -> np.ndarray:
        """How far the two are apart."""
        return np.max(np.abs(self.places(self.run) - self.places(self.made)), axis=2) / self.way

    @functools.cached_property
    def errors(self) -> np.ndarray:
        """Of the run and of the method, ``(2, samples)``."""
        norm = _norm(self.reference)
        runs = (self.run, self.made)
        return np.array([distances(run.states, self.reference, norm) for run in runs]) / self.way

    @property
    def later(self) -> np.ndarray:
        """The largest difference in each sample."""
        return np.max(self.parts, axis=1)

    @property
    def frame(self) -> int:
        """The first one in which they differ; 0 if they never do."""
        return int(np.argmax(self.later > self.same))

    @property
    def apart(self) -> float:
        """By how much they do there."""
        return float(self.later[self.frame])

    @property
    def before(self) -> float:
        """The largest difference in earlier frames."""
        return float(np.max(self.later[: self.frame]))

    @property
    def is_sudden(self) -> bool:
        """Whether no rounding can have grown so far, as another run shows that begins near by."""
        problem, frame, same = self.run.problem, self.frame, self.same
        if same > _FEWEST_DIGITS or not frame or self.apart < max(_DEPARTS, _OF_GROWTH * same):
            return False
        change = same * self.way * np.random.default_rng(_SEED).standard_normal(problem.y0.shape)
        if problem.mechanics is not None:
            change[1] /= problem.ts[1] - problem.ts[0]
        near = problem.with_numbers(problem.y0 + change, problem.args, problem.parameters)
        ((_, shaken),) = beside(self.name, [dataclasses.replace(self.made, problem=near)])
        if shaken is None:
            return False
        off = np.abs(self.places(shaken) - self.places(self.made))
        grown = np.max(off, axis=(1, 2)) / self.way
        growth = grown[frame] / max(float(np.min(grown[:frame])), _LAST_BIT)
        return bool(self.apart > _OF_GROWTH * same * max(growth, 1.0))

    @property
    def is_known(self) -> bool:
        """Whether the method is known by its errors before the departure, or has none at all."""
        own, right = self.errors
        exact = np.max(right) <= self.same
        return bool(self.before <= _OF_ERRORS * np.max(own[: self.frame]) or exact)


def departure(reference: Reference, runs: Sequence[Run]) -> Diagnosis | None:
    """Something that acts only later in the motion.

    Arguments:
        reference: of the problem.
        runs: from coarse to fine.

    Returns:
        The cause `departure` if the runs are to rounding those of a method over the first frames
        and all at once far from them; None if they do so by growth of rounding, or with dt.
    """
    known, problem = finite(runs), reference.problem
    if not known or steps_per_frame(known)[0] > MOST_IN_PYTHON or not _is_smooth(problem):
        return None
    if _counted(reference) < _FEWEST_FRAMES or not moved(reference, _norm(reference)):
        return None
    found = matching(reference, known, functools.partial(_departures, reference), _OF_ERRORS)
    return _diagnosis(reference, [*found], next(iter(found.values()))) if found else None


def _departures(
    reference: Reference, name: str, pairs: Iterator[tuple[Run, Run | None]]
) -> list[_Departure]:
    """The runs that depart from a stepper; none where that is not certain."""
    found: list[_Departure] = []
    for run, made in pairs:
        if made is None:
            found = []
            continue
        each = _Departure(reference, name, run, made)
        if each.later[1] > each.same:
            return []
        found = [*found, each] if each.is_sudden else []
    return found if _is_certain(found) else []


def _norm(reference: Reference) -> Norm:
    return NORMS[f"{reference.problem.quantities[0]}-max"]


def _counted(reference: Reference) -> int:
    """How many samples count.

    Those up to the trust horizon and before the right-hand side jumps, where a right program may
    take the step to either side.
    """
    problem, end = reference.problem, reference.trusted
    if len(problem.jump_times):
        end = min(end, int(np.searchsorted(problem.ts, np.min(problem.jump_times))))
    return end


def _is_certain(found: Sequence[_Departure]) -> bool:
    """Whether the departures do not vanish with dt, as those of another right program would.

    It is no matter of steps that are short only now and then, or of a branch taken a step later.
    """
    if len(found) < _FEWEST_RUNS or found[0].run.dt < _APART * found[-1].run.dt:
        return False
    first, last = found[0], found[-1]
    blown_up = first.errors[1] > 1.0
    end = int(np.argmax(blown_up)) if blown_up.any() else len(last.later)
    frames = slice(max(each.frame for each in found), min(end, len(last.later)))
    if frames.stop <= frames.start:
        return False
    far, near = (float(np.max(each.later[frames])) for each in (first, last))
    worse = last.errors[0] > _WORSE * np.maximum.accumulate(last.errors[1])
    return (
        near >= far * np.sqrt(last.run.dt / first.run.dt)
        and bool(np.any(worse[frames]))
        and all(each.is_known for each in found)
    )


def _is_smooth(problem: Problem) -> bool:
    """Whether the right-hand side has no corner, which two methods may take differently."""
    # Rigid links pull from the first step on; that they ask which ends are free is no corner.
    return has_rigid_links(problem) or (not problem.in_python and operations(problem) <= _SMOOTH)


def _diagnosis(
    reference: Reference, names: Sequence[str], found: Sequence[_Departure]
) -> Diagnosis:
    """The departures in words."""
    ts = reference.problem.ts
    before, frame = (pick(each.frame for each in found) for pick in (min, max))
    misfit, apart = (max(getattr(each, name) for each in found) for name in ("before", "apart"))
    # The nodes that have departed farthest.
    nodes = list(dict.fromkeys(int(np.argmax(each.parts[each.frame])) for each in found))
    limits, resting = [*_limits(found)], _resting(found)
    who = f"{numbered('node', nodes)} {'departs' if len(nodes) == 1 else 'depart'}"
    who = who if found[0].run.layout.nodes > 1 else "they depart"
    when = (
        f"at t = {ts[frame]:g}" if frame == before else f"from t = {ts[before]:g} to {ts[frame]:g}"
    )
    dts = [each.run.dt for each in found]
    of = f"with dt from {dts[0]:.4g} to {dts[-1]:.4g}"
    line = (
        f"the positions are those of {listed(names)}, {of_the_motion(misfit)}, up to "
        f"t = {ts[before - 1]:g}; {when}, {who} from them by up to {apart:.2g} of the motion, "
        f"{of}, and not by the growth of rounding: "
    )
    line += _acting(limits, resting)
    evidence = {
        "methods": [*names],
        "misfit": misfit,
        "until": float(ts[before - 1]),
        "departs": {f"{each.run.dt:g}": float(ts[each.frame]) for each in found},
        "apart": apart,
        "nodes": nodes,
        "resting": resting,
        "limits": [{"quantity": a, "never": b, "value": c} for a, b, c in limits],
    }
    return Diagnosis("departure", line, evidence, _REMEDY)


def _acting(limits: Sequence[tuple[str, str, float]], resting: Sequence[int]) -> str:
    """What acts from the departure on, as far as limits and nodes at rest show it."""
    words = [f"{name} is never {side} {value:g}" for name, side, value in limits[:_MOST_SAID]]
    if resting:
        few = len(resting) <= _MOST_SAID
        nodes = numbered("node", resting) if few else counted(len(resting), "node")
        words.append(f"{nodes} {'is' if len(resting) == 1 else 'are'} at rest")
    if words:
        return f"in these files {listed(words)}, as nothing in the problem demands"
    return (
        "something acts there that is not in the problem, such as a floor, a largest speed or "
        "a threshold; or a part of it ceases to act, or samples are written wrongly from there on"
    )


def _resting(found: Sequence[_Departure]) -> list[int]:
    """The nodes that are at rest once all runs have departed, and are not with the method."""
    frame = max(each.frame for each in found)

    def rests(run: Run) -> np.ndarray:
        places = found[0].places(run, frame)
        return np.all(places == places[0], axis=(0, 2))

    quiet = [rests(each.run) & ~rests(each.made) for each in found]
    return np.flatnonzero(np.all(quiet, axis=0)).tolist()


def _limits(found: Sequence[_Departure]) -> Iterator[tuple[str, str, float]]:
    """What goes as far in all runs, to rounding, once they have departed; the method goes farther.

    Runs with small errors are alike, and so is the farthest that they go. What is limited stays
    there, or comes there again.

    Returns:
        The quantity, on which side it never is, and of which value.
    """
    for name in _measured(found[0].run):
        for side, sign in (("above", 1.0), ("below", -1.0)):
            runs = [[sign * _measured(r)[name] for r in (each.run, each.made)] for each in found]
            reached = np.array([np.max(own) for own, _ in runs])
            allowed = max(each.same for each in found) * float(np.max(np.abs(reached)))
            limited = all(
                np.max(own[: each.frame]) < most < np.max(method)
                and np.sum(own >= most - allowed) >= _FEWEST_TIMES
                for each, (own, method), most in zip(found, runs, reached, strict=True)
            )
            if limited and np.ptp(reached) <= allowed:
                spread = max(float(np.ptp(reached)), _SAME * abs(reached[-1]))
                yield name, side, sign * shortest(float(reached[-1]), spread)


def _measured(run: Run) -> dict[str, np.ndarray]:
    """Quantities that a program may limit, each ``(samples, nodes or springs)``."""
    dim, values = run.layout.dim, run.values
    columns = run.layout.columns(values.shape[2] > dim)
    found = {name: values[:, :, i] for i, name in enumerate(columns)}
    if values.shape[2] > dim:
        found["the speed"] = np.linalg.norm(values[:, :, dim:], axis=2)
    if is_rope(run.problem):
        found["the length of a spring"] = np.linalg.norm(np.diff(values[..., :dim], axis=1), axis=2)
    return found
