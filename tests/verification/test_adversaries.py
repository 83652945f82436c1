"""The formulas of the problems that are made to deceive solve these problems."""

from __future__ import annotations

import json

import jax
import numpy as np
import pytest

heyoka = pytest.importorskip("heyoka")

from benchmarks.adversaries import ADVERSARIES  # noqa: E402
from ropeode.references.extended.translate import translate  # noqa: E402

BITS = 700
# Of the span: a difference over so short a time is the derivative to more digits than are compared.
SHORT, AGREE = 2.0**-120, 1e-50


def real(number):
    return heyoka.real(float(number), BITS)


def floats(reals):
    # Where there is no solution.
    with np.errstate(invalid="ignore"):
        return reals.astype(np.float64)


def drawn(kind):
    """A problem of a kind, with few samples, and a time inside a frame."""
    random = np.random.default_rng([5, 0])
    _, parameters = ADVERSARIES[kind].drawn(random)
    # As the benchmark prints them.
    parameters = json.loads(json.dumps(parameters)) | {"frames": 4}
    problem = ADVERSARIES[kind].problem(**parameters)
    frame = int(random.integers(problem.frames))
    begin, end = problem.ts[frame : frame + 2]
    return problem, float(begin + random.uniform(0.1, 0.9) * (end - begin))


# Nothing but benchmarks/certificate.py uses the formulas, and it prints each miss. Of first order,
# of second order, and one that has no number at some times.
FAST = ("stiff", "column", "pole, passed")


@pytest.mark.parametrize(
    "kind",
    [kind if kind in FAST else pytest.param(kind, marks=pytest.mark.slow) for kind in ADVERSARIES],
)
def test_the_formula_solves_the_equation(kind):
    """Its differences are what the right-hand side is in exact arithmetic."""
    problem, t = drawn(kind)
    assert ADVERSARIES[kind].solution(problem, 400).shape == (len(problem.ts), *problem.y0.shape)
    args = jax.tree.map(real, problem.args)
    start = [real(number) for number in problem.y0.ravel()]
    short = real((problem.ts[-1] - problem.ts[0]) * SHORT)
    ts = np.array([real(problem.ts[0]), real(t) - short, real(t), real(t) + short])
    with np.errstate(all="ignore"):
        states = np.stack([0 * ts + each for each in ADVERSARIES[kind].truth(ts, start, args)], 1)
    assert np.all(np.abs((states[0] - start).astype(float)) <= AGREE * problem.scale)
    if not np.all(np.isfinite(floats(states))):
        assert kind in ("pole, passed", "falling into a singularity")
        return
    differences = (states[3] - states[1]) / (2 * short)
    there = states[2].astype(np.float64).reshape(problem.y0.shape)
    translation = translate(problem, BITS, t=t, y=there)
    slope = heyoka.cfunc(
        translation.derivatives, translation.variables, fp_type=heyoka.real, prec=BITS
    )(states[2], time=real(t))
    off = np.abs((differences - slope).astype(float))
    # Far from a pulse, where the error function is 1 to more than 200 digits.
    nothing = 1e-100 * problem.scale / float(problem.ts[-1] - problem.ts[0])
    assert np.max(off) <= AGREE * max(np.max(np.abs(slope.astype(float))), nothing)
