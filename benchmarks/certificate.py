"""How often, and how tightly, the estimated bound of a reference covers its true error.

    python benchmarks/certificate.py --trials 3200 --seed 1 --jobs 2 --out coverage.jsonl

Random problems get a reference of level `consensus`, half of them at default settings and half
at a tolerance drawn from 1e-6 to 1e-12. The truth is the solution by another method (Taylor
series) with 24 digits; in every tenth trial, and in every miss, it is computed with 31 digits
again, and what the two are apart is the truth's doubt. At every sample inside the trust horizon
the true error of each quantity, at its worst node, is held against the certificate's bound. A
trial in which it exceeds the bound at any sample is a miss.

Each outcome is a line of the file, written when it is known; the same command goes on where it
was interrupted, and only prints the tables when all is done.

    python benchmarks/certificate.py --trials 20000 --kind robertson --out robertson.jsonl
    python benchmarks/certificate.py --trials 400 --warp 4 --out unequal.jsonl

`--kind` leaves out all other trials. With `--warp P` the sample times are the P-th powers of equal
ones, so that the first frames are much shorter than the last.

    python benchmarks/certificate.py --family adversarial --trials 5200 --out adversarial.jsonl

These problems are made to deceive a reference (`benchmarks/adversaries.py`). Their truth is a
formula. Of the smooth kinds less than one in twenty should be refused.
"""

from __future__ import annotations

import argparse
import dataclasses
import functools
import itertools
import json
import multiprocessing
import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import track
from scipy.stats import beta
from tabulate import tabulate

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.adversaries import ADVERSARIES
from benchmarks.outcomes import lines_in
from ropeode import reference
from ropeode.cache import set_up_jax
from ropeode.errors import ReferenceRefused
from ropeode.norms import NORMS, distance
from ropeode.problems import PROBLEMS, Problem
from ropeode.references import Level, Reference
from ropeode.references.extended.taylor import solve

# Ropes are what the package is for. Adding a problem changes which one a seed and an index draw.
SHARES = {
    "rope": 0.34,
    "stiff rope": 0.05,
    "inextensible-rope": 0.14,
    "oscillator": 0.05,
    "linear-chain": 0.05,
    "kepler": 0.06,
    "forced": 0.06,
    "pendulum": 0.05,
    "double-pendulum": 0.04,
    "henon-heiles": 0.04,
    "lorenz": 0.04,
    "van-der-pol": 0.03,
    "arenstorf": 0.02,
    "pleiades": 0.01,
    "robertson": 0.01,
    "hires": 0.005,
    "oregonator": 0.005,
}
CONFIDENCE = 0.95
# Of the truth, in bits and seconds. Inside the horizon of a reference, errors have grown by 1e8
# or less, which leaves 16 of 24 digits.
PRECISION, CHECKED_PRECISION, CHECKED_EVERY = 80, 104, 10
TIME_LIMIT = 120.0
# Few different numbers of samples and nodes, and trials of one shape after the other, so that
# what is compiled for one serves the next.
FRAMES = (5, 16)
NODES = (2, 3, 4, 6, 9, 13, 18, 24)
TRIALS_AT_ONCE = {"library": 8, "adversarial": 32}

Random = np.random.Generator


@dataclasses.dataclass(frozen=True)
class Trial:
    """A problem and a tolerance; None is the default.

    Arguments:
        index: in the row of trials of a seed.
        kind: one of `SHARES`, or of `ADVERSARIES`.
        parameters: of the problem.
        rtol: of the reference.
        level: of the reference.
    """

    index: int
    kind: str
    parameters: dict[str, Any]
    rtol: float | None
    level: Level = "consensus"

    @property
    def problem_name(self) -> str:
        """Of the library."""
        return "rope" if self.kind == "stiff rope" else self.kind

    def problem(self) -> Problem:
        """What is solved."""
        if self.kind in ADVERSARIES:
            return ADVERSARIES[self.kind].problem(**self.parameters)
        return PROBLEMS[self.problem_name](**self.parameters)

    def truth(self, problem: Problem, precision: int) -> np.ndarray:
        """The solution at the samples that were reached, as `heyoka.real`."""
        if self.kind in ADVERSARIES:
            # Formulas are cheap, and some of them cancel.
            return ADVERSARIES[self.kind].solution(problem, 5 * precision)
        return solve(problem, precision=precision, time_limit=TIME_LIMIT).states

    @property
    def code(self) -> str:
        """What makes the problem, as Python."""
        if self.kind in ADVERSARIES:
            return f"ADVERSARIES[{self.kind!r}].problem(**{json.dumps(self.parameters)})"
        return f"PROBLEMS[{self.problem_name!r}](**{json.dumps(self.parameters)})"

    def shape(self) -> tuple:
        """What decides on what is compiled."""
        given = self.parameters
        if self.kind in ADVERSARIES:
            field = ADVERSARIES[self.kind].field.__name__
            jumps = len(given.get("jump_times", ()))
            return field, jumps, self.level, given["frames"]
        dim, nodes = len(given.get("start", ())), given.get("num_nodes", given.get("num_masses"))
        return self.problem_name, dim, nodes or 0, given["frames"]


@dataclasses.dataclass(frozen=True)
class Outcome:
    """What was found, as plain numbers and words.

    Arguments:
        seed: of the trials.
        index: of the trial.
        refused: why there is no reference; None if there is one.
        broken: the exception that should not have been; None if there was none.
        samples: inside the trust horizon and known, the start left out.
        beyond: samples that are not trusted.
        horizon: why they are not; None if there are none.
        unknown: samples inside the trust horizon that the truth did not reach.
        misses: samples where the error of any quantity exceeds its bound.
        tightness: bound over true error at the last sample, first quantity; None without error.
        worst: the largest true error over bound of any sample and quantity.
        where: quantity, sample, error and bound there.
        doubt: how far two truths are apart, over the bound, at most; None if there is one only.
        seconds: for the reference, and for the truth.
    """

    seed: int
    index: int
    refused: str | None = None
    broken: str | None = None
    samples: int = 0
    beyond: int = 0
    horizon: str | None = None
    unknown: int = 0
    misses: int = 0
    tightness: float | None = None
    worst: float = 0.0
    where: str = ""
    doubt: float | None = None
    seconds: tuple[float, float] = (0.0, 0.0)


def draw(family: str, seed: int, index: int) -> Trial:
    """The same trial for the same numbers, whatever the others are."""
    random = np.random.default_rng([seed, index])
    if family == "adversarial":
        return draw_adversary(random, index)
    kind = str(random.choice(list(SHARES), p=list(SHARES.values())))
    rtol = None if random.random() < 0.5 else float(10 ** random.uniform(-12, -6))
    frames = int(random.choice(FRAMES))
    return Trial(index, kind, {"frames": frames, **DRAWS[kind](random)}, rtol)


def draw_adversary(random: Random, index: int) -> Trial:
    shares = np.array([adversary.share for adversary in ADVERSARIES.values()])
    kind = str(random.choice(list(ADVERSARIES), p=shares / np.sum(shares)))
    level, parameters = ADVERSARIES[kind].drawn(random)
    rtol = None if random.random() < 0.5 else float(10 ** random.uniform(-12, -6))
    return Trial(index, kind, parameters, None if level == "extended" else rtol, level)


def _between(random: Random, low: float, high: float, size: int | None = None) -> Any:
    """Numbers between two others, each order of magnitude as likely as the next."""
    return np.exp(random.uniform(np.log(low), np.log(high), size)).tolist()


def draw_rope(random: Random) -> dict[str, Any]:
    nodes, dim = int(random.choice(NODES)), int(random.integers(2, 4))
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
    nodes, dim = int(random.choice(NODES[:6])), int(random.integers(2, 4))
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
        "mass": mass,
        "stiffness": stiffness,
        "damping": float(ratio * 2 * np.sqrt(mass * stiffness)),
    }


def draw_oscillator(random: Random) -> dict[str, Any]:
    x0, v0 = random.normal(size=2)
    return {**draw_damped(random), "x0": float(x0), "v0": float(v0)}


def draw_chain(random: Random) -> dict[str, Any]:
    masses = int(random.choice(NODES[:6]))
    return {
        **draw_damped(random),
        "num_masses": masses,
        "displacement": random.normal(size=random.integers(1, masses + 1)).tolist(),
        "velocity": random.normal(size=random.integers(0, masses + 1)).tolist(),
    }


def draw_kepler(random: Random) -> dict[str, Any]:
    return {
        "eccentricity": float(random.uniform(0, 0.95)),
        "periods": _between(random, 0.2, 5),
    }


def draw_forced(random: Random) -> dict[str, Any]:
    return {
        "rate": _between(random, 0.05, 300),
        "frequency": float(random.uniform(0, 5)),
        "y0": float(random.normal()),
    }


def draw_stiff_rope(random: Random) -> dict[str, Any]:
    stiffness = _between(random, 1e4, 1e6)
    return {**draw_rope(random), "stiffness": stiffness, "damping": _between(random, 1e-3, 100)}


def draw_pendulum(random: Random) -> dict[str, Any]:
    return {
        "length": _between(random, 0.1, 10),
        "gravity": _between(random, 0.1, 10),
        "angle": float(random.uniform(-np.pi, np.pi)),
        "velocity": float(random.normal() * random.choice([0, 1, 3])),
    }


def draw_double_pendulum(random: Random) -> dict[str, Any]:
    return {
        "masses": _between(random, 0.2, 5, 2),
        "lengths": _between(random, 0.2, 5, 2),
        "gravity": _between(random, 0.2, 3),
        "angles": random.uniform(-np.pi, np.pi, 2).tolist(),
        "velocities": (random.normal(size=2) * random.choice([0, 1])).tolist(),
    }


def draw_henon_heiles(random: Random) -> dict[str, Any]:
    # Small enough that the energy stays below 1/6, where it would fly away.
    return {
        "duration": _between(random, 5, 100),
        "position": random.uniform(-0.2, 0.2, 2).tolist(),
        "velocity": random.uniform(-0.33, 0.33, 2).tolist(),
    }


def draw_lorenz(random: Random) -> dict[str, Any]:
    return {
        "duration": _between(random, 1, 20),
        "rho": float(random.uniform(5, 40)),
        "y0": (10 * random.normal(size=3)).tolist(),
    }


def draw_van_der_pol(random: Random) -> dict[str, Any]:
    return {
        "duration": _between(random, 0.5, 5),
        "epsilon": _between(random, 3e-4, 10),
        "x0": float(random.normal() * 2),
        "v0": float(random.normal()),
    }


def draw_arenstorf(random: Random) -> dict[str, Any]:
    return {"periods": _between(random, 0.1, 1.5)}


def draw_pleiades(random: Random) -> dict[str, Any]:
    return {"duration": _between(random, 0.3, 3)}


def draw_robertson(random: Random) -> dict[str, Any]:
    return {"duration": _between(random, 0.1, 40)}


def draw_hires(random: Random) -> dict[str, Any]:
    return {"duration": _between(random, 1, 321.8122)}


def draw_oregonator(random: Random) -> dict[str, Any]:
    return {"duration": _between(random, 0.1, 3)}


DRAWS = {
    "rope": draw_rope,
    "stiff rope": draw_stiff_rope,
    "inextensible-rope": draw_inextensible_rope,
    "oscillator": draw_oscillator,
    "linear-chain": draw_chain,
    "kepler": draw_kepler,
    "forced": draw_forced,
    "pendulum": draw_pendulum,
    "double-pendulum": draw_double_pendulum,
    "henon-heiles": draw_henon_heiles,
    "lorenz": draw_lorenz,
    "van-der-pol": draw_van_der_pol,
    "arenstorf": draw_arenstorf,
    "pleiades": draw_pleiades,
    "robertson": draw_robertson,
    "hires": draw_hires,
    "oregonator": draw_oregonator,
}


def run(family: str, seed: int, warp: float, indices: list[int]) -> list[Outcome]:
    """The outcomes of some trials, whatever happens in them: the others are not to be lost."""
    return [outcome_of(seed, warp, draw(family, seed, index)) for index in indices]


def outcome_of(seed: int, warp: float, trial: Trial) -> Outcome:
    try:
        return compare(seed, warp, trial)
    except Exception as error:
        return Outcome(seed, trial.index, broken=f"{type(error).__name__}: {error}")


def compare(seed: int, warp: float, trial: Trial) -> Outcome:
    """Make the reference of a trial, and hold its bounds against its errors."""
    problem = trial.problem()
    if warp != 1.0:
        start, span = problem.ts[0], problem.ts[-1] - problem.ts[0]
        ts = start + span * ((problem.ts - start) / span) ** warp
        problem = dataclasses.replace(problem, ts=ts)
    began = time.perf_counter()
    try:
        found = reference(problem, rtol=trial.rtol, level=trial.level)
    except ReferenceRefused as refusal:
        seconds = round(time.perf_counter() - began, 3), 0.0
        return Outcome(seed, trial.index, refused=str(refusal), seconds=seconds)
    middle = time.perf_counter()
    # What comes after the horizon is of no concern, and costs digits.
    inside = problem.changed(ts=problem.ts[: found.trusted])
    truth = trial.truth(inside, PRECISION)
    with np.errstate(invalid="ignore"):
        outcome = _held_against(seed, trial, inside, found, truth)
    if outcome.misses or trial.index % CHECKED_EVERY == 0:
        doubt = _doubt(inside, found, truth, trial.truth(inside, CHECKED_PRECISION))
        outcome = dataclasses.replace(outcome, doubt=doubt)
    seconds = round(middle - began, 3), round(time.perf_counter() - middle, 3)
    beyond = len(problem.ts) - found.trusted
    why = found.certificate.horizon_reason
    return dataclasses.replace(outcome, beyond=beyond, horizon=why, seconds=seconds)


def _held_against(
    seed: int, trial: Trial, problem: Problem, found: Reference, truth: np.ndarray
) -> Outcome:
    known = len(truth)
    missed = np.zeros(known, dtype=bool)
    outcome = Outcome(seed, trial.index, samples=known - 1, unknown=found.trusted - known)
    # Two float64 arrays whose difference is the error, to more digits than float64 has.
    rounded = truth.astype(np.float64)
    off, lost = found.states[:known] - rounded, (truth - rounded).astype(np.float64)
    for quantity in problem.quantities:
        bound = found.certificate.bounds[quantity][:known]
        error = distance(problem, NORMS[f"{quantity}-max"], off, lost)
        # Not-a-number where there is no solution.
        error = np.where(np.isnan(error), np.inf, error)
        missed |= error > bound
        ratio = _over(error, bound)
        at = int(np.argmax(ratio))
        if ratio[at] > outcome.worst:
            outcome = dataclasses.replace(
                outcome,
                worst=float(ratio[at]),
                where=f"{quantity} at sample {at} of {known - 1}: "
                f"error {float(error[at]):.3e}, bound {bound[at]:.3e}",
            )
        if quantity == problem.quantities[0] and error[-1]:
            outcome = dataclasses.replace(outcome, tightness=float(bound[-1] / error[-1]))
    return dataclasses.replace(outcome, misses=int(np.sum(missed)))


def _doubt(problem: Problem, found: Reference, truth: np.ndarray, again: np.ndarray) -> float:
    """How far two truths are apart, over the bound, at most."""
    known = min(len(truth), len(again))
    apart = np.nan_to_num((truth[:known] - again[:known]).astype(np.float64))
    return max(
        float(
            np.max(
                _over(
                    distance(problem, NORMS[f"{quantity}-max"], apart, np.zeros_like(apart)),
                    found.certificate.bounds[quantity][:known],
                )
            )
        )
        for quantity in problem.quantities
    )


def _over(error: np.ndarray, bound: np.ndarray) -> np.ndarray:
    # Zero over zero is a component that stays at rest, in truth and in the reference.
    return np.where(error == 0, 0, error / np.where(bound == 0, 1, bound))


def outcomes(
    family: str, seed: int, warp: float, trials: list[Trial], jobs: int
) -> Iterator[Outcome]:
    """Run trials in new processes, those of one shape one after the other."""
    groups: list[list[int]] = []
    most = TRIALS_AT_ONCE[family]
    for _, of_shape in itertools.groupby(sorted(trials, key=Trial.shape), key=Trial.shape):
        indices = [trial.index for trial in of_shape]
        groups += (indices[i : i + most] for i in range(0, len(indices), most))
    # What JAX compiles stays in memory, some megabytes for each trial. (The executors of
    # concurrent.futures would hang here: on Python 3.11 they do not replace workers reliably.)
    work = functools.partial(run, family, seed, warp)
    spawned = multiprocessing.get_context("spawn")
    with spawned.Pool(jobs, initializer=set_up_jax, maxtasksperchild=30) as pool:
        for batch in pool.imap_unordered(work, groups):
            yield from batch


def already_known(out: Path, seed: int, trials: list[Trial]) -> dict[int, Outcome]:
    """The outcomes in the file of trials, by their index."""
    known = {}
    for outcome in (Outcome(**line) for line in lines_in(out)):
        if outcome.seed != seed:
            raise SystemExit(f"{out} has trials of seed {outcome.seed}; give another --out")
        known[outcome.index] = outcome
    return {trial.index: known[trial.index] for trial in trials if trial.index in known}


def largest_miss_rate(missed: int, trials: int) -> float:
    """The exact upper confidence limit (Clopper and Pearson) of a rate."""
    return 1.0 if missed == trials else float(beta.ppf(CONFIDENCE, missed + 1, trials - missed))


def row(family: str, name: str, of: list[Outcome]) -> list[str]:
    given = [outcome for outcome in of if outcome.refused is None and outcome.broken is None]
    refused = sum(outcome.refused is not None for outcome in of)
    missed = sum(outcome.misses > 0 for outcome in given)
    cells = [
        name,
        str(len(of)),
        str(refused),
        *([str(sum(outcome.beyond > 0 for outcome in given))] if family == "adversarial" else []),
        str(sum(outcome.samples for outcome in given)),
        str(missed),
    ]
    if not given:
        return [*cells, *[""] * 5]
    # Those with an error of zero are infinitely loose.
    tightness = [np.inf if o.tightness is None else o.tightness for o in given]
    # The quantile that a trial has.
    quantile = functools.partial(np.quantile, tightness, method="inverted_cdf")
    return [
        *cells,
        f"{quantile(0.5):.3g}",
        f"{quantile(0.9):.3g}",
        f"{max(outcome.worst for outcome in given):.3g}",
        f"{100 * largest_miss_rate(missed, len(given)):.2f} %",
        f"{max((o.doubt for o in given if o.doubt is not None), default=np.nan):.1e}",
    ]


def head(family: str) -> list[str]:
    return [
        "problem",
        "trials",
        "refused",
        *(["with a horizon"] if family == "adversarial" else []),
        "samples",
        "missed",
        "bound/error, median",
        "90 % quantile",
        "largest error/bound",
        f"miss rate below ({100 * CONFIDENCE:.0f} %)",
        "truth's doubt/bound",
    ]


def table(family: str, trials: list[Trial], of: dict[int, Outcome]) -> str:
    def chosen(keep: Any) -> list[Outcome]:
        return [of[trial.index] for trial in trials if keep(trial)]

    kinds = {
        kind + (", smooth" if kind in ADVERSARIES and ADVERSARIES[kind].smooth else ""): chosen(
            lambda trial, kind=kind: trial.kind == kind
        )
        for kind in kinds_of(family)
    }
    groups = {
        **kinds,
        "all, extended": chosen(lambda trial: trial.level == "extended"),
        "all, default": chosen(lambda trial: trial.rtol is None and trial.level == "consensus"),
        "all, given rtol": chosen(lambda trial: trial.rtol is not None),
        **(
            {"all, smooth": chosen(lambda trial: ADVERSARIES[trial.kind].smooth)}
            if family == "adversarial"
            else {}
        ),
        "all": chosen(lambda trial: True),
    }
    rows = [row(family, name, group) for name, group in groups.items() if group]
    return tabulate(rows, head(family), tablefmt="github", disable_numparse=True)


def kinds_of(family: str) -> list[str]:
    return list(ADVERSARIES if family == "adversarial" else SHARES)


def described(trial: Trial, outcome: Outcome) -> str:
    found = f"{outcome.misses} samples; worst is {outcome.where}; unknown {outcome.unknown}"
    if outcome.beyond:
        found += f"; {outcome.beyond} samples beyond the horizon: {outcome.horizon}"
    return (
        f"{trial.index}: {trial.code}, rtol={trial.rtol!r}, level={trial.level!r}\n"
        f"    {outcome.refused or outcome.broken or found}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--trials", type=int, default=3200, help="random problems (default 3200)")
    parser.add_argument("--seed", type=int, default=1, help="of their drawing (default 1)")
    parser.add_argument(
        "--jobs", type=int, default=os.cpu_count() or 1, help="processes (default: all cores)"
    )
    parser.add_argument("--family", choices=list(TRIALS_AT_ONCE), default="library")
    parser.add_argument("--kind", metavar="KIND", help="of problem (default: all)")
    parser.add_argument("--warp", type=float, default=1.0, help="of the sample times (default 1)")
    parser.add_argument("--out", type=Path, required=True, help="file of outcomes, *.jsonl")
    options = parser.parse_args()
    family = options.family
    if options.kind not in (None, *kinds_of(family)):
        parser.error(f"--kind {options.kind!r}; allowed: {', '.join(kinds_of(family))}")
    drawn = (draw(family, options.seed, index) for index in range(options.trials))
    trials = [trial for trial in drawn if options.kind in (None, trial.kind)]
    known = already_known(options.out, options.seed, trials)
    left = [trial for trial in trials if trial.index not in known]
    console = Console(stderr=True)
    with options.out.open("a") as file:
        for outcome in track(
            outcomes(family, options.seed, options.warp, left, options.jobs),
            description="references",
            total=len(left),
            console=console,
        ):
            known[outcome.index] = outcome
            file.write(json.dumps(dataclasses.asdict(outcome)) + "\n")
            file.flush()
    print(f"trials {len(trials)}, seed {options.seed}, warp {options.warp:g}\n")
    print(table(family, trials, known))
    seconds = [sum(known[trial.index].seconds) for trial in trials]
    print(f"\nseconds for a trial: mean {np.mean(seconds):.3f}, largest {max(seconds):.1f}")
    for title, interesting in (
        ("Misses", lambda outcome: outcome.misses),
        ("Refused", lambda outcome: outcome.refused),
        ("Broken", lambda outcome: outcome.broken),
        ("Truth not known to the end", lambda outcome: outcome.unknown),
        ("With a horizon", lambda outcome: outcome.beyond and not outcome.misses),
    ):
        chosen = [trial for trial in trials if interesting(known[trial.index])]
        print(f"\n{title}: {len(chosen)}")
        for trial in chosen:
            print(described(trial, known[trial.index]))


if __name__ == "__main__":
    main()
