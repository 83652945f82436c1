"""Which pulses of a right-hand side are found between the steps of the solvers, by their width.

    python benchmarks/needles.py --places 100 --whole 120

A pulse that nothing announces is put at random places of a problem, and looked for between the
steps of a run that has not seen it. Pulses are rectangles, and Gaussian curves of the same width at
half their height; each moves the solution by a millionth of its size in all. The problems are one
equation, y' = -y, and the default rope with a kick of one node.

With `--whole N`, so many references are computed of y' = -y with pulses of random width, place,
and strength, and held against the exact solution.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from scipy.special import erf
from tabulate import tabulate

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from ropeode import reference
from ropeode.errors import ReferenceRefused
from ropeode.problems import Problem
from ropeode.problems.rope import Rope
from ropeode.references import SCIPY_DOP853, solve
from ropeode.references.defect import look_between

WIDTHS = (1e-4, 1e-5, 3e-6, 1e-6, 1e-7, 1e-8)
EFFECT = 1e-6
# Half the width of a Gaussian curve exp(-x^2) at half its height.
HALF = float(np.sqrt(np.log(2.0)))


def pulse(t, centre, width, gauss):
    """A pulse of height 1 and a width at half its height."""
    x = (t - centre) / (width / 2.0)
    return jnp.where(gauss, jnp.exp(-((HALF * x) ** 2)), jnp.where(jnp.abs(x) < 1.0, 1.0, 0.0))


def area(width, gauss):
    return width / 2.0 * np.sqrt(np.pi) / HALF if gauss else width


BASE = Rope().problem(frames=20)


def number_rhs(t, y, args):
    centre, width, gauss, height = args
    return height * pulse(t, centre, width, gauss) - y


def rope_rhs(t, y, args):
    own, centre, width, gauss, height = args
    return BASE.rhs(t, y, own).at[1, 0, 7].add(height * pulse(t, centre, width, gauss))


def number(centre, width, gauss, strength=EFFECT):
    args = (centre, width, gauss, strength / area(width, gauss))
    return Problem(number_rhs, [1.0], np.arange(11.0), args=args)


def rope(centre, width, gauss, strength=EFFECT):
    args = (BASE.args, centre, width, gauss, strength * BASE.scale / area(width, gauss))
    return Problem(rope_rhs, BASE.y0, BASE.ts, args=args)


def found(build, places, random):
    """For each width and shape the part of pulses that was found, and the seconds of one look."""
    still = build(0.0, 1.0, False, 0.0)
    run = solve(still, SCIPY_DOP853, 1e-13, 1e-13 * still.scale, max_steps=10**6)
    bounds = {"state": np.full(len(still.ts), 1e-12 * np.max(np.abs(run.states)))}
    start, span = still.ts[0], still.ts[-1] - still.ts[0]
    looked = look_between(still, run.path, bounds).sampling
    began, rows = time.perf_counter(), []
    for width in WIDTHS:
        row = [f"{width:.0e}"]
        for gauss in (False, True):
            hits = 0
            for _ in range(places):
                centre = start + span * random.uniform(2 * width, 1.0 - 2 * width)
                problem = build(centre, width * span, gauss)
                hits += len(look_between(problem, run.path, bounds).times) > 0
            row.append(f"{hits / places:.0%}")
        rows.append(row)
    seconds = (time.perf_counter() - began) / (2 * places * len(WIDTHS))
    return looked, rows, seconds


def whole(trials, random):
    """How many references are wrong, refused, or end at the pulse."""
    outcomes = {"wrong": 0, "refused": 0, "ends": 0, "to the end": 0}
    for _ in range(trials):
        width, strength = 10 ** random.uniform(-4.9, -1), 10 ** random.uniform(-15, 0)
        gauss, centre = bool(random.integers(2)), random.uniform(0.0, 10.0)
        problem = number(centre, width, gauss, strength)
        try:
            known = reference(problem)
        except ReferenceRefused:
            outcomes["refused"] += 1
            continue
        ts = problem.ts
        if gauss:
            # The exact convolution with exp(-t), from the start on.
            s = width / 2.0 / HALF
            inner = [(x - centre) / s - s / 2 for x in (ts, 0.0 * ts)]
            after = strength * np.exp(centre - ts + s * s / 4) * (erf(inner[0]) - erf(inner[1])) / 2
        else:
            inside = np.clip([ts - centre, -centre + 0.0 * ts], -width / 2, width / 2)
            edges = [np.exp(centre - ts + each) for each in inside]
            after = strength / width * (edges[0] - edges[1])
        exact = np.exp(-ts) + after
        error = np.abs(known.states[: known.trusted, 0] - exact[: known.trusted])
        if np.any(error > known.bound() + 1e-16):
            outcomes["wrong"] += 1
            print("wrong:", centre, width, gauss, strength, error, known.bound())
        elif known.horizon is None:
            outcomes["to the end"] += 1
        else:
            outcomes["ends"] += 1
    return outcomes


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--places", type=int, default=100)
    parser.add_argument("--whole", type=int, default=0)
    options = parser.parse_args()
    random = np.random.default_rng(1)
    for name, build in (("y' = -y", number), ("rope", rope)):
        looked, rows, seconds = found(build, options.places, random)
        span = 10.0 if build is number else 20.0
        print(
            f"{name}: {looked.times} times, spacing {looked.spacing / span:.1e} of the span, "
            f"{seconds:.3f} s each"
        )
        print(tabulate(rows, ["width/span", "rectangle", "Gaussian"], tablefmt="pipe"), flush=True)
    if options.whole:
        print(whole(options.whole, random))


if __name__ == "__main__":
    main()
