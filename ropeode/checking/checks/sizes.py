"""Ropes of other lengths and in a plane: what is written for the check ropes alone shows there.

A pinned node passes on no force, so that what lies between two pins moves as if nothing else were
there. A long rope with many pins is thus a row of short ones, whose motion is known from runs of
their own: no truth is needed.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np

from ropeode.checking.check_context import Examination
from ropeode.checking.check_ropes import DIM, NODES, check_rope, held
from ropeode.checking.report import Finding
from ropeode.checking.time_limit import within
from ropeode.errors import UserCodeError
from ropeode.precision import in_float64
from ropeode.problems.problem import Problem
from ropeode.progress import silent
from ropeode.simulation.python_driver import run_in_python

_PARTS, _STEPS = 10, 1
# Short steps, so that equations that a step solves by iteration converge; and few, for many nodes
# in Python take their time.
_TS = (0.0, 0.0625, 0.125)
# As a part of the rope's size: a solver that iterates may stop at another iteration.
_TOLERANCE = 1e-5
# The processor time of a rope; a step that does not come to an end on a long one says nothing.
_SECONDS = 10.0
# In two long ropes different nodes are pinned, and in the second one the ends are free. Of each
# part the nodes that are pinned, and how many belong to the rope.
_BETWEEN_PINS = ((0, NODES - 1), NODES)
_LONG = (
    (_PARTS + 1) * (_BETWEEN_PINS,),
    (((2,), 3), *(_PARTS - 1) * (_BETWEEN_PINS,), ((0,), NODES)),
)
_TWO_NODES = (((1,), 2),)


def sizes(examination: Examination) -> Finding:
    """Ropes of 2 and of more than 40 nodes, in a plane and in space, move as their parts do."""
    if examination.stepper.compiled is not None:
        return Finding("sizes", "skip", "steppers of ropeode and of libraries take any state")
    worst, said, refusals = 0.0, [], []
    for parts, dim in ((_LONG[0], 2), (_LONG[1], DIM), (_TWO_NODES, DIM)):
        rope = _joined(parts, dim)
        what = f"a rope of {rope.y0.shape[1]} nodes in {dim} dimensions"
        work = in_float64(functools.partial(_differences, examination, parts, rope))
        try:
            off = within(_SECONDS, f"{what}:", work)
        except UserCodeError as error:
            why = error.problems[0].removeprefix("step: ").split("; allowed")[0]
            refusals.append(f"for {what} {why}")
            continue
        largest = float(np.max(off))
        if not largest <= _TOLERANCE:
            node = int(np.argmax(~(off <= _TOLERANCE)))
            line = (
                f"{what} moves differently from the ropes that it consists of, by {largest:.1e} of "
                f"their size, first at node {node}; is a number of nodes or dimensions fixed?"
            )
            return Finding("sizes", "fail", line, {"difference": largest, "node": node})
        worst, said = max(worst, largest), [*said, what]
    if len(refusals) > 1:
        # What is written for three dimensions says so itself, and may be right there. But it is
        # written for five nodes.
        return Finding("sizes", "fail", "; ".join(refusals))
    line = f"{' and '.join(said)}: each moves as its parts do, to {worst:.1e} of their size"
    return Finding("sizes", "pass", "; ".join([line, *refusals]), {"difference": worst})


def _differences(examination: Examination, parts: Sequence[tuple], rope: Problem) -> np.ndarray:
    """How far each node of a rope comes from where it does in its part, ``(nodes,)``."""
    # In Python: for another number of nodes a compiled step would be compiled again.
    states = run_in_python(rope, examination.stepper, _STEPS, silent)[0]
    moved, first = states - rope.y0, 0
    off = np.zeros(states.shape[2])
    for (pinned, count), whole in zip(parts, _wholes(), strict=False):
        own = held(whole, *pinned)
        there = moved[:, :, first : first + count]
        apart = (examination.run(own, _STEPS) - own.y0)[:, :, :count, : moved.shape[-1]]
        off[first : first + count] = np.max(np.abs(there - apart), axis=(0, 1, 3)) / own.scale
        first += count - 1
    return off


@functools.cache
def _wholes() -> tuple[Problem, ...]:
    """Ropes of the family, which lie and move in the plane of the first two coordinates."""
    random, flat = np.random.default_rng(5), np.array([1.0, 1.0, 0.0])
    return tuple(
        check_rope(
            "part of a long rope",
            flat * np.cumsum(random.uniform(-0.2, 1.1, (NODES, DIM)), axis=0),
            _TS,
            v0=flat * random.normal(size=(NODES, DIM)),
            mass=random.uniform(0.5, 1.8, NODES),
            stiffness=random.uniform(2.0, 5.5, NODES - 1),
            rest_length=random.uniform(0.5, 1.2, NODES - 1),
            damping=random.uniform(0.1, 0.5, NODES),
            gravity=(0.3, -0.8, 0.0),
            pinned=(),
        )
        for _ in range(_PARTS + 1)
    )


def _joined(parts: Sequence[tuple], dim: int) -> Problem:
    """The parts in a row, each pinned where the one before it ends, in so many dimensions."""
    ropes = [held(whole, *pinned) for (pinned, _), whole in zip(parts, _wholes(), strict=False)]
    counts = [count for _, count in parts]

    def nodes(values: Sequence[np.ndarray]) -> np.ndarray:
        """Of each node; the last one of a part is the first one of the next."""
        pairs = zip(values, counts, strict=True)
        return np.concatenate([values[0][:1], *(each[1:count] for each, count in pairs)])

    def springs(values: Sequence[np.ndarray]) -> np.ndarray:
        pairs = zip(values, counts, strict=True)
        return np.concatenate([each[: count - 1] for each, count in pairs])

    x0 = [ropes[0].y0[0]]
    for rope, count in zip(ropes[1:], counts[:-1], strict=True):
        x0.append(rope.y0[0] - rope.y0[0][0] + x0[-1][count - 1])
    args = [rope.args for rope in ropes]
    first = args[0]
    return ropes[0].changed(
        y0=np.stack([nodes(x0), nodes([rope.y0[1] for rope in ropes])])[..., :dim],
        args=first._replace(
            mass=nodes([each.mass for each in args]),
            damping=nodes([each.damping for each in args]),
            free=nodes([each.free for each in args]),
            stiffness=springs([each.stiffness for each in args]),
            rest_length=springs([each.rest_length for each in args]),
            gravity=first.gravity[:dim],
            drive=first.drive[:dim],
        ),
        name="rope of parts",
    )
