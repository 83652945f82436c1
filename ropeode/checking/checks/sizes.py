"""Ropes of other lengths and in a plane: what is written for the check ropes alone shows there."""

from __future__ import annotations

import dataclasses
import functools
import time
from typing import Any

import numpy as np

from ropeode.checking.check_context import Examination
from ropeode.checking.check_ropes import DIM, acceleration, generic
from ropeode.checking.checks.local_errors import (
    LENGTHS,
    errs_by,
    has_usual_errors,
    local_errors,
    rates,
    too_large,
    usual_errors,
    why_unknown,
)
from ropeode.checking.report import Finding
from ropeode.checking.time_limit import OutOfTime, within
from ropeode.errors import UserCodeError
from ropeode.precision import in_float64
from ropeode.problems import Mechanics, Problem
from ropeode.simulation import Method
from ropeode.validation import is_traced

# Numbers of nodes, those first that people write; in a plane one rope is enough.
_OFTEN = (2, 3, 4, 6, 7, 8, 9, 10, 16, 20, 32, 33, 50, 51, 64, 65, 66, 100, 101, 128, 129, 200, 256)
_MOST, _IN_A_PLANE = 130, 45
_SIZES = dict.fromkeys([*_OFTEN, *range(2, _MOST + 1), 201, 255, 257, 300])
# The processor time of all ropes: a step that takes more is tried on the first of them alone, at
# least on so many.
_SECONDS, _FEWEST = 10.0, 8


def sizes(examination: Examination) -> Finding:
    """A step on ropes of 2 to 300 nodes, in a plane and in space, errs no more than on others."""
    if examination.stepper.compiled is not None:
        return Finding("sizes", "skip", "steppers of ropeode and of libraries take any state")
    own = examination.method
    # In Python: for another number of nodes a compiled step would be compiled again.
    trial = dataclasses.replace(own.trial, compiled=False)
    method = Method(("in Python", own.key), own.stepper, trial)
    usual = usual_errors(examination.told(generic()), own)
    if not has_usual_errors(usual):
        return Finding("sizes", "note", "not known: a usual step does not follow the solution")
    done, refusals, started = 0, [], time.process_time()
    for nodes in _SIZES:
        if done >= _FEWEST and time.process_time() - started > _SECONDS:
            break
        what = f"{nodes} nodes in {_dim(nodes)} dimensions"
        rope, states = _drawn(nodes, _dim(nodes))
        rope = examination.told(rope)
        work = functools.partial(local_errors, rope, method, states, LENGTHS[1:])
        try:
            found = within(_SECONDS, f"a rope of {what}:", in_float64(work))
        except OutOfTime as error:
            refusals.append(f"not known for {what}: {why_unknown(error)}")
            break
        except UserCodeError as error:
            refusals.append(f"for a rope of {what} {why_unknown(error)}")
            if len(refusals) == 2:
                # What is written for three dimensions says so itself, and may be right there. But
                # it is written for five nodes.
                return Finding("sizes", "fail", "; ".join(refusals))
            continue
        wrong = too_large(found, usual[1:])
        if np.any(wrong):
            state, size = np.argwhere(wrong)[0]
            error, node = float(found.errors[state, size]), int(found.node[state, size])
            line = (
                f"on a rope of {what} a step {errs_by(error)}, most at node {node}, "
                f"where {usual[1 + size]:.1e} is usual; is a number of nodes or dimensions fixed?"
            )
            return Finding("sizes", "fail", line, {"error": error, "node": node})
        done += 1
    line = f"on ropes of {done} numbers of nodes, from 2 to 300, a step errs as on five nodes"
    if done < len(_SIZES) - len(refusals):
        line = f"on ropes of {done} numbers of nodes a step errs as on five; others take too long"
    return Finding("sizes", "pass", "; ".join([line, *refusals]))


def _dim(nodes: int) -> int:
    return 2 if nodes == _IN_A_PLANE else DIM


class _InNumPy:
    """The acceleration of check ropes, which NumPy need not compile for each number of nodes."""

    def __call__(self, t: Any, x: Any, v: Any, args: Any) -> Any:
        return acceleration(t, x, v, args)

    def in_numpy(self, t: Any, x: Any, v: Any, args: Any) -> Any:
        if is_traced((t, x, v, args)):
            return self(t, x, v, args)
        drive = args.drive * np.cos(args.frequency * t)
        return rates(np.stack([x, v]), args)[1] + args.free[:, None] * drive


@functools.cache
def _mechanics() -> Mechanics:
    own = generic().require_mechanics("problem")
    return dataclasses.replace(own, acceleration=_InNumPy())


def _drawn(nodes: int, dim: int) -> tuple[Problem, np.ndarray]:
    """A random rope of so many nodes, of which every tenth is pinned or so, and a state of it."""
    random = np.random.default_rng(nodes)
    free = np.where(random.random(nodes) < 0.1, 0.0, 1.0)
    free[random.integers(nodes)] = 1.0
    rest_length = random.uniform(0.5, 1.2, nodes - 1)
    # It goes to and fro, so that no position is a large number.
    along = np.ones(dim) + 0.5 * random.normal(size=(1, nodes - 1, dim))
    along *= (-1.0) ** np.arange(nodes - 1)[:, None]
    lengths = rest_length * random.uniform(0.7, 1.5, along.shape[:2])
    along *= (lengths / np.linalg.norm(along, axis=2))[..., None]
    x = np.pad(np.cumsum(along, axis=1), ((0, 0), (1, 0), (0, 0)))
    v = random.normal(size=x.shape) * free[:, None]
    states = np.stack([x, v], axis=1)
    args = generic().args._replace(
        mass=random.uniform(0.5, 1.8, nodes),
        stiffness=random.uniform(2.0, 5.5, nodes - 1),
        rest_length=rest_length,
        free=free,
        gravity=random.normal(size=dim),
        damping=random.uniform(0.1, 0.5, nodes),
        drive=np.zeros(dim),
    )
    name = f"rope of {nodes} nodes"
    return generic().changed(y0=states[0], args=args, name=name, mechanics=_mechanics()), states
