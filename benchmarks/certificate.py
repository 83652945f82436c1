"""How often, and how tightly, the estimated bound of a reference covers its true error.

    python benchmarks/certificate.py --trials 400 --seed 1 --jobs 2

Random problems get a reference, half of them at default settings and half at a tolerance
drawn from 1e-6 to 1e-12. The truth does not come from the package's solvers: it is the exact
solution, or for ropes an extrapolation method (for the inextensible one, of its links'
directions and not of its nodes), both in extended precision, and errors are taken in extended
precision too. At every sample inside the trust horizon the true error of each quantity, at its
worst node, is held against the certificate's bound. A trial in which it exceeds the bound at
any sample is a miss.
"""

from __future__ import annotations

import argparse
import dataclasses
import functools
import json
import multiprocessing
import os
import sys
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import track
from scipy.stats import beta
from tabulate import tabulate

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from ropeode.errors import ReferenceRefused
from ropeode.norms import NORMS, distance
from ropeode.problems import forced, kepler, linear_chain, oscillator
from ropeode.problems.library import PROBLEMS
from ropeode.problems.problem import Problem
from ropeode.references.reference import reference
from tests.verification.extrapolation import inextensible_rope_solution, rope_solution

# Ropes are what the package is for, and the only ones without an exact solution. Adding a
# problem changes which one a seed and an index draw.
SHARES = {
    "rope": 0.4,
    "inextensible-rope": 0.2,
    "oscillator": 0.1,
    "linear-chain": 0.1,
    "kepler": 0.1,
    "forced": 0.1,
}
CONFIDENCE = 0.95

Random = np.random.Generator


@dataclasses.dataclass(frozen=True)
class Trial:
    """A problem and a tolerance; None is the default."""

    kind: str
    parameters: dict[str, Any]
    rtol: float | None


@dataclasses.dataclass(frozen=True)
class Outcome:
    """What was found.

    Arguments:
        trial: of what.
        refused: why there is no reference; None if there is one.
        broken: the exception that should not have been; None if there was none.
        samples: inside the trust horizon, the start left out.
        misses: samples where the error of any quantity exceeds its bound.
        tightness: bound over true error at the last sample, first quantity.
        worst: the largest true error over bound of any sample and quantity.
        where: quantity, sample, error and bound there.
        doubt: how far the truth itself is known, over the bound; the largest.
    """

    trial: Trial
    refused: str | None = None
    broken: str | None = None
    samples: int = 0
    misses: int = 0
    tightness: float = np.nan
    worst: float = 0.0
    where: str = ""
    doubt: float = 0.0


def draw(seed: int, index: int) -> Trial:
    """The same trial for the same numbers, whatever the others are."""
    random = np.random.default_rng([seed, index])
    kind = str(random.choice(list(SHARES), p=list(SHARES.values())))
    rtol = None if random.random() < 0.5 else float(10 ** random.uniform(-12, -6))
    return Trial(kind, DRAWS[kind](random), rtol)


def _between(random: Random, low: float, high: float, size: int | None = None) -> Any:
    """Numbers between two others, each order of magnitude as likely as the next."""
    return np.exp(random.uniform(np.log(low), np.log(high), size)).tolist()


def draw_rope(random: Random) -> dict[str, Any]:
    nodes, dim = int(random.integers(2, 25)), int(random.integers(2, 4))
    length = _between(random, 1, 500)
    start = random.normal(size=dim) * length * random.choice([0, 1])
    along = random.normal(size=dim)
    end = start + length * along / np.linalg.norm(along)
    pins = [
        [],
        [0],
        [0],
        [0, nodes - 1],
        random.choice(nodes, int(random.integers(1, max(2, nodes // 2))), replace=False).tolist(),
    ]
    return {
        "frames": int(random.integers(5, 31)),
        "start": start.tolist(),
        "end": end.tolist(),
        "num_nodes": nodes,
        "node_mass": random.choice([1.0, None]) or _between(random, 0.2, 5, nodes),
        "stiffness": (
            _between(random, 1, 1e4)
            if random.random() < 0.5
            else np.clip(
                _between(random, 1, 1e4) * np.exp(random.normal(size=nodes - 1)), 1, 1e4
            ).tolist()
        ),
        "pinned": pins[random.integers(len(pins))],
        "gravity": (random.normal(size=dim) * random.choice([0.3, 1, 3])).tolist(),
        "damping": random.choice([0.0, _between(random, 1e-3, 3)]),
        "initial_velocity": (
            random.normal(size=dim) * random.choice([0, 0.01, 0.1]) * length
        ).tolist(),
    }


def draw_inextensible_rope(random: Random) -> dict[str, Any]:
    nodes, dim = int(random.integers(2, 13)), int(random.integers(2, 4))
    length = _between(random, 1, 500)
    start = random.normal(size=dim) * length * random.choice([0, 1])
    along = random.normal(size=dim)
    along /= np.linalg.norm(along)
    first = int(random.integers(0, nodes - 1))
    pinned = [[], [0], [0], [first], [first, first + 1] if nodes > 2 else [0]]
    pins = pinned[random.integers(len(pinned))]
    # Links may be neither shorter nor longer at first; without pins they may all go along.
    velocity = random.normal(size=(nodes, dim))
    velocity -= np.outer(velocity @ along, along)
    if not pins:
        velocity += random.normal() * along
    velocity[pins] = 0.0
    velocity *= random.choice([0, 0.01, 0.1]) * length
    return {
        "frames": int(random.integers(5, 31)),
        "start": start.tolist(),
        "end": (start + length * along).tolist(),
        "num_nodes": nodes,
        "node_mass": random.choice([1.0, None]) or _between(random, 0.2, 5, nodes),
        "pinned": pins,
        "gravity": (random.normal(size=dim) * random.choice([0.3, 1, 3])).tolist(),
        "damping": random.choice([0.0, _between(random, 1e-3, 3)]),
        "initial_velocity": velocity.tolist(),
    }


def draw_damped(random: Random) -> dict[str, Any]:
    mass, stiffness = _between(random, 0.1, 10), _between(random, 0.1, 100)
    ratio = random.choice([0.0, _between(random, 1e-3, 5)])
    return {
        "frames": int(random.integers(5, 31)),
        "mass": mass,
        "stiffness": stiffness,
        "damping": float(ratio * 2 * np.sqrt(mass * stiffness)),
    }


def draw_oscillator(random: Random) -> dict[str, Any]:
    x0, v0 = random.normal(size=2)
    return {**draw_damped(random), "x0": float(x0), "v0": float(v0)}


def draw_chain(random: Random) -> dict[str, Any]:
    masses = int(random.integers(1, 17))
    return {
        **draw_damped(random),
        "num_masses": masses,
        "displacement": random.normal(size=random.integers(1, masses + 1)).tolist(),
        "velocity": random.normal(size=random.integers(0, masses + 1)).tolist(),
    }


def draw_kepler(random: Random) -> dict[str, Any]:
    return {
        "frames": int(random.integers(5, 31)),
        "eccentricity": float(random.uniform(0, 0.95)),
        "periods": _between(random, 0.2, 5),
    }


def draw_forced(random: Random) -> dict[str, Any]:
    return {
        "frames": int(random.integers(5, 31)),
        "rate": _between(random, 0.05, 300),
        "frequency": float(random.uniform(0, 5)),
        "y0": float(random.normal()),
    }


DRAWS = {
    "rope": draw_rope,
    "inextensible-rope": draw_inextensible_rope,
    "oscillator": draw_oscillator,
    "linear-chain": draw_chain,
    "kepler": draw_kepler,
    "forced": draw_forced,
}


def truth(kind: str, problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """The states in extended precision, and once more from another computation.

    How far these are apart says how well the truth is known. Exact solutions are evaluated
    once only, since nothing but rounding in extended precision is wrong with them.
    """
    if kind == "rope":
        return rope_solution(problem), rope_solution(problem, rtol=3e-20)
    if kind == "inextensible-rope":
        return (
            inextensible_rope_solution(problem),
            inextensible_rope_solution(problem, rtol=3e-20),
        )
    ts, args, y0 = problem.ts, problem.args, problem.y0
    if kind == "oscillator":
        states = np.stack(oscillator.solution(ts, *args, *y0.ravel()), axis=1)
    elif kind == "linear-chain":
        states = np.stack(linear_chain.solution(ts, *args, *y0), axis=1)
    elif kind == "kepler":
        states = np.stack(kepler.solution(ts, float(y0[0, 0, 0]), float(y0[1, 0, 1])), axis=1)
    else:
        states = forced.solution(ts, *args, y0[0])
    states = states.reshape(len(ts), *y0.shape)
    return states, states


def run(trial: Trial) -> Outcome:
    """The outcome of a trial, whatever happens in it: the others are not to be lost."""
    try:
        return compare(trial)
    except Exception as error:
        return Outcome(trial, broken=f"{type(error).__name__}: {error}")


def compare(trial: Trial) -> Outcome:
    """Make the reference of a trial, and hold its bounds against its errors."""
    problem = PROBLEMS[trial.kind](**trial.parameters)
    try:
        found = reference(problem, rtol=trial.rtol)
    except ReferenceRefused as refusal:
        return Outcome(trial, refused=str(refusal))
    trusted = found.trusted
    states, again = (every[:trusted] for every in truth(trial.kind, problem))
    missed = np.zeros(trusted, dtype=bool)
    outcome = Outcome(trial, samples=trusted - 1)
    for quantity in problem.quantities:
        norm, bound = NORMS[f"{quantity}-max"], found.certificate.bounds[quantity][:trusted]
        error = distance(problem, norm, found.states[:trusted].astype(np.longdouble), states)
        doubt = distance(problem, norm, again, states)
        missed |= error > bound
        # Zero over zero is a component that stays at rest, in truth and in the reference.
        ratio, doubts = (
            np.where(e == 0, 0, e / np.where(e == 0, 1, bound)) for e in (error, doubt)
        )
        at = int(np.argmax(ratio))
        outcome = dataclasses.replace(outcome, doubt=max(outcome.doubt, float(np.max(doubts))))
        if ratio[at] > outcome.worst:
            outcome = dataclasses.replace(
                outcome,
                worst=float(ratio[at]),
                where=f"{quantity} at sample {at} of {trusted - 1}: "
                f"error {float(error[at]):.3e}, bound {bound[at]:.3e}",
            )
        if quantity == problem.quantities[0]:
            last = float(bound[-1] / error[-1]) if error[-1] else np.inf
            outcome = dataclasses.replace(outcome, tightness=last)
    return dataclasses.replace(outcome, misses=int(np.sum(missed)))


def outcomes(trials: list[Trial], jobs: int) -> Iterator[Outcome]:
    """Run trials, in this process or in several new ones."""
    if jobs == 1:
        yield from map(run, trials)
        return
    context = multiprocessing.get_context("spawn")
    # What JAX compiles stays in memory, some megabytes for each trial.
    with ProcessPoolExecutor(jobs, mp_context=context, max_tasks_per_child=50) as pool:
        yield from pool.map(run, trials)


def largest_miss_rate(missed: int, trials: int) -> float:
    """The exact upper confidence limit (Clopper and Pearson) of a rate."""
    return 1.0 if missed == trials else float(beta.ppf(CONFIDENCE, missed + 1, trials - missed))


def row(name: str, of: list[Outcome]) -> list[str]:
    given = [outcome for outcome in of if outcome.refused is None and outcome.broken is None]
    refused = sum(outcome.refused is not None for outcome in of)
    missed = sum(outcome.misses > 0 for outcome in given)
    cells = [
        name,
        str(len(of)),
        str(refused),
        str(sum(outcome.samples for outcome in given)),
        str(missed),
        str(sum(outcome.misses for outcome in given)),
    ]
    if not given:
        return [*cells, *[""] * 5]
    tightness = [outcome.tightness for outcome in given]
    # The quantile that a trial has, since those with an error of zero are infinitely loose.
    quantile = functools.partial(np.quantile, tightness, method="inverted_cdf")
    return [
        *cells,
        f"{quantile(0.5):.3g}",
        f"{quantile(0.9):.3g}",
        f"{max(outcome.worst for outcome in given):.3g}",
        f"{100 * largest_miss_rate(missed, len(given)):.2f} %",
        f"{max(outcome.doubt for outcome in given):.1e}",
    ]


HEAD = [
    "problem and tolerance",
    "trials",
    "refused",
    "samples",
    "trials missed",
    "samples missed",
    "bound/error, median",
    "90 % quantile",
    "largest error/bound",
    f"miss rate below ({100 * CONFIDENCE:.0f} %)",
    "truth's doubt/bound",
]


def table(of: Iterable[Outcome]) -> str:
    of = list(of)
    rows = []
    for kind in SHARES:
        for mode, default in (("default", True), ("given rtol", False)):
            group = [o for o in of if o.trial.kind == kind and (o.trial.rtol is None) == default]
            if group:
                rows.append(row(f"{kind}, {mode}", group))
    rows.append(row("all", of))
    return tabulate(rows, HEAD, tablefmt="github", disable_numparse=True)


def described(outcome: Outcome) -> str:
    trial, found = outcome.trial, f"{outcome.misses} samples; worst is {outcome.where}"
    return (
        f"PROBLEMS[{trial.kind!r}](**{json.dumps(trial.parameters)}), rtol={trial.rtol!r}\n"
        f"    {outcome.refused or outcome.broken or found}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--trials", type=int, default=400, help="random problems (default 400)")
    parser.add_argument("--seed", type=int, default=1, help="of their drawing (default 1)")
    parser.add_argument(
        "--jobs", type=int, default=os.cpu_count() or 1, help="processes (default: all cores)"
    )
    options = parser.parse_args()
    trials = [draw(options.seed, index) for index in range(options.trials)]
    found = list(
        track(
            outcomes(trials, options.jobs),
            description="references",
            total=len(trials),
            console=Console(stderr=True),
        )
    )
    print(f"trials {options.trials}, seed {options.seed}\n")
    print(table(found))
    for title, chosen in (
        ("Misses", [outcome for outcome in found if outcome.misses]),
        ("Refused", [outcome for outcome in found if outcome.refused]),
        ("Broken", [outcome for outcome in found if outcome.broken]),
    ):
        print(f"\n{title}: {len(chosen)}")
        for outcome in chosen:
            print(described(outcome))


if __name__ == "__main__":
    main()
