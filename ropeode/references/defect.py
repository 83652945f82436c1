"""What a right-hand side does between the places where the solvers evaluated it.

All solvers can step over the same narrow pulse. So the right-hand side is evaluated along the
solution at many more times (`references.residuals`). Where it is not smooth inside a step, this
says at which times a run should look, and does not judge: whether the solution misses something is
for a run whose steps end there to say.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from ropeode.precision import in_float64
from ropeode.problems import Problem
from ropeode.progress import Progress, silent
from ropeode.references.certificate import Sampling, distances
from ropeode.references.residuals import Block, Sampler
from ropeode.references.solvers.solution import Path

# Around a single time, a run looks at distances that halve so often.
_HALVINGS = 20
_ISOLATED, _MOST_STOPS = 4, 6
# A right-hand side that is so far from straight within rounding errors, in units of its largest
# values, is not well known between two floating-point numbers, or not at all.
_BENT, _UNKNOWN = 1e-3, 0.1


@dataclasses.dataclass(frozen=True, eq=False)
class Findings:
    """What was found between the steps.

    Arguments:
        sampling: where it was looked.
        times: for each step in which something was found, the time at which it is largest, in
            order.
        widths: about how long it lasts there.
        shares: what it may add to a number of the state, in units of what is negligible.
        needles: whether it was seen there at a few neighbouring times only.
        stops: times at which a run should end its steps, to see it.
        unresolved: by how much a quantity may differ up to each sample because the right-hand side
            changes within a unit in the last place of its arguments; only where it does.
    """

    sampling: Sampling
    times: np.ndarray
    widths: np.ndarray
    shares: np.ndarray
    needles: np.ndarray
    stops: np.ndarray
    unresolved: Mapping[str, np.ndarray]

    def trusted(
        self,
        ts: np.ndarray,
        apart: Mapping[str, np.ndarray],
        before: Mapping[str, np.ndarray],
        bound: np.ndarray,
        accuracy: float,
    ) -> int:
        """How many samples can still be trusted after a run has looked at what was found.

        The bound covers what that run has seen. But where needles were hit by luck, and the
        solvers did miss them, there may be others that were not hit. They were missed if the runs
        differ at the end of their frame, and they are large enough: what others may add is
        expected to be what those add that were hit, each as long as the times are apart.

        Arguments:
            ts: sample times.
            apart: how far that run is from the reference, for each quantity.
            before: the bounds without that run.
            bound: that of the first quantity, with it.
            accuracy: the largest bound that is trusted.
        """
        count = len(ts)
        within = bound[:count] <= accuracy
        missed = np.any([apart[q][:count] > before[q][:count] for q in before], axis=0)
        frame = np.searchsorted(ts, self.times)
        needles = np.bincount(frame, np.where(self.needles, self.shares, 0.0), count)
        within &= ~missed | (needles <= 1.0)
        return int(np.argmin(np.append(within, False)))

    def reason(self, start: float, end: float) -> str:
        """Why a horizon ends, where a run that looks there contradicts the others.

        Arguments:
            start: the last sample that is trusted.
            end: the first one that is not.
        """
        before = self.times < end
        # What was found earlier may have grown.
        recent = before & (self.times > start)
        which = np.flatnonzero(recent if np.any(recent) else before)
        worst = which[np.argmax(self.shares[which])]
        return (
            f"near t = {self.times[worst]:.9g} the right-hand side does something that lasts "
            f"about {self.widths[worst]:.1e}, and solvers step over it; declare jump_times "
            "on both sides of it, or sample it more densely"
        )


@dataclasses.dataclass(frozen=True, eq=False)
class Look:
    """What was seen at times inside some steps.

    Arguments:
        share: what it may add to a number of the state, in units of what is negligible,
            ``(steps,)``.
        step: the index of the step of each time, in order.
        t: that time.
        size: how large it is there.
        low: the start of each step.
        high: its end.
        spacing: how far its times are apart.
        nodes: the times at which a step, by its index, has nodes.
    """

    share: np.ndarray
    step: np.ndarray
    t: np.ndarray
    size: np.ndarray
    low: np.ndarray
    high: np.ndarray
    spacing: np.ndarray
    nodes: Callable[[int], np.ndarray] = lambda step: np.empty(0)


@in_float64
def look_between(
    problem: Problem,
    path: Path,
    bounds: Mapping[str, np.ndarray],
    others: Sequence[Look] = (),
    progress: Progress = silent,
) -> Findings:
    """Look for what a right-hand side does between the ends of a run's steps.

    Arguments:
        problem: of `Sampler`, as are the next two.
        path: see there.
        bounds: see there.
        others: what was seen in another way.
        progress: called with the part of the steps that was looked into.
    """
    sampler = Sampler(problem, path, bounds)
    found, done = [], 0
    with np.errstate(all="ignore"):
        for block in sampler.blocks():
            found.append(block)
            done += len(block.share)
            progress("reference: looking between the steps", done / len(sampler.spacing))
    look = Look(
        *(
            np.concatenate([getattr(block, name) for block in found])
            for name in ("share", "step", "t", "size")
        ),
        low=sampler.low,
        high=sampler.high,
        spacing=sampler.spacing,
        nodes=sampler.nodes,
    )
    places = [place for each in (look, *others) for place in _places(each)]
    places.sort(key=lambda place: place.t)
    return Findings(
        sampling=Sampling(times=sampler.times, spacing=float(np.max(sampler.spacing))),
        times=np.array([place.t for place in places]),
        widths=np.array([place.width for place in places]),
        shares=np.array([place.share for place in places]),
        needles=np.array([place.isolated for place in places]),
        stops=np.unique(np.concatenate([[], *(place.stops for place in places)])),
        unresolved=_unresolved(problem, path, found),
    )


@dataclasses.dataclass(frozen=True, eq=False)
class _Place:
    """A step in which something was seen: see `Findings`."""

    t: float
    width: float
    share: float
    isolated: bool
    stops: np.ndarray


def _places(look: Look) -> Iterator[_Place]:
    for index in _suspects(look.share):
        inside = slice(*np.searchsorted(look.step, [index, index + 1]))
        at, sizes = look.t[inside], look.size[inside]
        spacing = float(look.spacing[index])
        run = _around_the_largest(at, sizes, spacing)
        yield _Place(
            t=at[np.argmax(sizes)],
            width=run[-1] - run[0] + spacing,
            share=float(look.share[index]),
            isolated=len(run) <= _ISOLATED,
            stops=_stops(look, index, at, run),
        )


def _unresolved(problem: Problem, path: Path, found: Sequence[Block]) -> dict[str, np.ndarray]:
    """See `Findings`; a right-hand side that is straight, up to small noise, adds nothing."""
    bend = np.concatenate([block.bend for block in found])
    largest = np.max(np.concatenate([block.largest for block in found]), axis=0, initial=0.0)
    bend = np.where(bend > _BENT * largest, bend, 0.0)
    bend = np.where(bend > _UNKNOWN * largest, np.maximum(bend, 2.0 * largest), bend)
    lengths = np.diff(path.times)[:, None]
    added = np.concatenate([np.zeros((1, len(largest))), np.cumsum(bend * lengths, axis=0)])
    last = np.searchsorted(path.times, problem.ts, side="right") - 1
    states = added[last].reshape(-1, *problem.y0.shape)
    every = distances(problem, states, np.zeros_like(states))
    return {quantity: series for quantity, series in every.items() if np.any(series)}


def _around_the_largest(t: np.ndarray, size: np.ndarray, spacing: float) -> np.ndarray:
    """The times in a row, the largest among them, at which it is at least a tenth of that."""
    large = size >= np.max(size) / 10
    row = np.cumsum(np.diff(t[large], prepend=t[0]) > 1.5 * spacing)
    return t[large][row == row[np.argmax(size[large])]]


def _suspects(share: np.ndarray) -> np.ndarray:
    """The indices of the steps whose findings are not negligible, even together."""
    order = np.argsort(share)
    kept = np.cumsum(share[order]) > 1.0
    return np.sort(order[kept])


def _stops(look: Look, step: int, t: np.ndarray, run: np.ndarray) -> np.ndarray:
    """Where a run should end its steps, to see what was found in a step.

    Arguments:
        look: what was seen.
        step: its index.
        t: the times at which something was found in it.
        run: those in a row at which it is large.
    """
    some = t[np.linspace(0, len(t) - 1, min(len(t), _MOST_STOPS)).astype(int)]
    width = run[-1] - run[0] + look.spacing[step]
    middle = (run[-1] + run[0]) / 2
    # If a node is what was hit, it spoils the polynomial, and the rest is found off it.
    nodes = look.nodes(step)
    stops = [some, nodes, middle + width * np.linspace(-1.5, 1.5, 2 * _MOST_STOPS + 1)]
    if len(run) <= _ISOLATED:
        away = width * 2.0 ** -np.arange(_HALVINGS)
        stops += [run, *(at + sign * away for at in run[[0, -1]] for sign in (-1, 1))]
    every = np.concatenate(stops)
    return every[(every > look.low[step]) & (every < look.high[step])]
