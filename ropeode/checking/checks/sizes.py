"""Ropes of other lengths and in a plane: what is written for the check ropes alone shows there."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np

from ropeode.checking.check_context import Examination
from ropeode.checking.check_ropes import DIM, generic
from ropeode.checking.checks.local_errors import (
    LENGTHS,
    has_usual_errors,
    local_errors,
    too_large,
    usual_errors,
    why_unknown,
)
from ropeode.checking.report import Finding
from ropeode.checking.time_limit import within
from ropeode.errors import UserCodeError
from ropeode.problems.problem import Problem
from ropeode.simulation.method import Method

# Numbers of nodes and dimensions.
_SIZES = ((2, DIM), (4, DIM), (8, DIM), (45, 2), (66, DIM))
# The processor time of a rope; a step that does not come to an end on a long one says nothing.
_SECONDS = 10.0


def sizes(examination: Examination) -> Finding:
    """A step on ropes of 2 to 66 nodes, in a plane and in space, errs no more than on others."""
    if examination.stepper.compiled is not None:
        return Finding("sizes", "skip", "steppers of ropeode and of libraries take any state")
    own = examination.method
    # In Python: for another number of nodes a compiled step would be compiled again.
    trial = dataclasses.replace(own.trial, compiled=False)
    method = Method(("in Python", own.key), own.stepper, trial)
    usual = usual_errors(examination.told(generic()), own)
    if not has_usual_errors(usual):
        return Finding("sizes", "note", "not known: a usual step does not follow the solution")
    said, refusals = [], []
    for nodes, dim in _SIZES:
        what = f"{nodes} nodes in {dim} dimensions"
        rope, states = _drawn(nodes, dim)
        rope = examination.told(rope)
        work = functools.partial(local_errors, rope, method, states, LENGTHS[1:])
        try:
            found = within(_SECONDS, f"a rope of {what}:", work)
        except UserCodeError as error:
            refusals.append(f"for a rope of {what} {why_unknown(error)}")
            continue
        wrong = too_large(found, usual[1:])
        if np.any(wrong):
            state, size = np.argwhere(wrong)[0]
            error, node = found.errors[state, size], int(found.node[state, size])
            line = (
                f"on a rope of {what} a step errs by {error:.1e} of its way, most at node {node}, "
                f"where {usual[1 + size]:.1e} is usual; is a number of nodes or dimensions fixed?"
            )
            return Finding("sizes", "fail", line, {"error": float(error), "node": node})
        said.append(what)
    if len(refusals) > 1:
        # What is written for three dimensions says so itself, and may be right there. But it is
        # written for five nodes.
        return Finding("sizes", "fail", "; ".join(refusals))
    line = f"a step errs as on five nodes with {', '.join(said)}"
    return Finding("sizes", "pass", "; ".join([line, *refusals]))


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
    return generic().changed(y0=states[0], args=args, name=f"rope of {nodes} nodes"), states
