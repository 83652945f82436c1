"""How often the checks reject a right stepper, on random ropes.

    python benchmarks/false_alarms.py --ropes 8 --seed 1 --out docs/data/false_alarms.jsonl
    python benchmarks/false_alarms.py --out docs/data/false_alarms.jsonl --show

The right steppers of tests/checking/right_steppers.py are checked with all claims that are true of
them, on random ropes instead of the check ropes: masses, springs, rest lengths, pins, velocities,
damping, drive, gravity, spans and frames are drawn. Steppers that run in Python get every fifth set
of ropes, because they take a hundred times as long.

The outcome of each set of ropes is written to the file at once, as a line; the same command resumes
if interrupted. `--show` checks nothing, and prints the outcomes in the file, for
docs/validation/testing-the-checks.md.
"""

from __future__ import annotations

import argparse
import json
import sys
import warnings
from collections import Counter
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import track
from scipy.stats import beta
from tabulate import tabulate

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.outcomes import lines_in
from ropeode.checking import CHECKS
from tests.checking.random_ropes import findings, ropes, tried_once
from tests.checking.right_steppers import RIGHT

CONFIDENCE = 0.95
INTERPRETED_EVERY = 5


def checked(seed: int, index: int) -> dict[str, Any]:
    """One set of ropes, as a line of the file."""
    drawn, refused = ropes(seed, index)
    counts: Counter[str] = Counter()
    rejected = []
    for name in RIGHT:
        if not tried_once(name)[0].trial.compiled and index % INTERPRETED_EVERY:
            continue
        for check, finding in findings(name, drawn).items():
            counts[f"{check} {finding.status}"] += 1
            if finding.status == "fail":
                rejected.append([name, check, finding.line])
    return {
        "seed": seed,
        "index": index,
        "refused": refused,
        "counts": dict(counts),
        "rejected": rejected,
    }


def outcomes(out: Path, seed: int) -> dict[int, dict[str, Any]]:
    """The outcomes in the file, by their index."""
    record = {}
    for line in lines_in(out):
        if line["seed"] != seed:
            raise SystemExit(f"{out} has ropes of seed {line['seed']}; give another --out")
        record[line["index"]] = line
    return record


def largest_rate(rejected: int, made: int) -> float:
    """The exact upper confidence limit (Clopper and Pearson) of a rate."""
    return 1.0 if rejected == made else float(beta.ppf(CONFIDENCE, rejected + 1, made - rejected))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--ropes", type=int, default=8, help="random sets (default 8)")
    parser.add_argument("--seed", type=int, default=1, help="of their drawing (default 1)")
    parser.add_argument("--out", type=Path, required=True, help="file of outcomes, *.jsonl")
    parser.add_argument("--show", action="store_true", help="the result; nothing is checked")
    options = parser.parse_args()
    # A warning is a bug of a check.
    warnings.simplefilter("error")
    record = outcomes(options.out, options.seed)
    missing = [index for index in range(options.ropes) if index not in record and not options.show]
    with options.out.open("a") as file:
        for index in track(missing, description="sets of ropes", console=Console(stderr=True)):
            record[index] = checked(options.seed, index)
            file.write(json.dumps(record[index]) + "\n")
            file.flush()
    print(shown(list(record.values())))


def shown(lines: list[dict[str, Any]]) -> str:
    """The result, in Markdown."""
    counts: Counter[str] = Counter()
    for line in lines:
        counts.update(line["counts"])
    rejected = [each for line in lines for each in line["rejected"]]
    of = {status: _by_check(counts, status) for status in ("pass", "fail")}
    rows = [
        [f"`{check}`", of["pass"][check] + of["fail"][check], of["fail"][check]] for check in CHECKS
    ]
    made = sum(row[1] for row in rows)
    rate = 100 * largest_rate(len(rejected), made)
    words = (
        f"{len(RIGHT)} steppers on {len(lines)} random sets of ropes: {made} checks, "
        f"{len(rejected)} rejected. With {100 * CONFIDENCE:.0f} % confidence, fewer than "
        f"{rate:.3f} % of such checks are false alarms."
    )
    listed = [f"- {name}, `{check}`: {line}" for name, check, line in rejected]
    head = ["check", "verdicts", "rejected"]
    return "\n".join([words, "", *listed, "", tabulate(rows, head, tablefmt="pipe")])


def _by_check(counts: Counter[str], status: str) -> dict[str, int]:
    return {check: counts[f"{check} {status}"] for check in CHECKS}


if __name__ == "__main__":
    main()
