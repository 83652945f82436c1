"""Which wrong steppers the judge rejects, and by which checks.

    python benchmarks/mutants.py --out docs/mutants.jsonl
    python benchmarks/mutants.py --out docs/mutants.jsonl --show families

Each mutant of tests/checking/mutants is judged by all checks, and with the claims of the right
stepper that it was made from. Each outcome is a line of the file, written when it is known; the
same command goes on where it was interrupted. `--show` judges nothing, and prints a table of what
the file holds, for docs/judge.md.
"""

from __future__ import annotations

import argparse
import json
import sys
import warnings
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import track
from tabulate import tabulate

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from ropeode.checking.checks import CHECKS, SLOW
from tests.checking.mutants.all import MUTANTS, REFUSED, rejected_by
from tests.checking.mutants.loops import LOOPS
from tests.checking.mutants.survivors import SURVIVORS


def known(out: Path) -> dict[str, dict[str, Any]]:
    """The outcomes in the file; a line that was cut off does not count."""
    found = {}
    for text in out.read_text().splitlines() if out.exists() else ():
        try:
            line = json.loads(text)
        except json.JSONDecodeError:
            continue
        found[line["name"]] = line
    return found


Record = dict[str, dict[str, Any]]


def families(record: Record) -> str:
    """Mutants by family, and what became of them."""
    rows = []
    for family in dict.fromkeys(line["family"] for line in record.values()):
        of = [line for line in record.values() if line["family"] == family]
        rows.append([family, len(of), *_counts(of)])
    rows.append(["all", len(record), *_counts(list(record.values()))])
    head = ["made from", "mutants", "rejected", "refused", "survive"]
    return tabulate(rows, head, tablefmt="pipe")


def _counts(lines: list[dict[str, Any]]) -> list[int]:
    refused = sum(line["rejected_by"] == [REFUSED] for line in lines)
    survive = sum(not line["rejected_by"] for line in lines)
    return [len(lines) - refused - survive, refused, survive]


def checks(record: Record) -> str:
    """How many mutants each check rejects, and how many no other one does."""
    steppers = [line["rejected_by"] for name, line in record.items() if MUTANTS[name] not in LOOPS]
    rows = []
    for check in CHECKS:
        by = [found for found in steppers if check in found]
        quick = "" if check in SLOW else "yes"
        rows.append([f"`{check}`", quick, len(by), sum(len(found) == 1 for found in by)])
    head = ["check", "in quick mode", "rejects", "alone"]
    return tabulate(rows, head, tablefmt="pipe", colalign=("left", "left", "right", "right"))


def alone(record: Record) -> str:
    """The mutants that one check alone rejects."""
    rows = [
        [f"`{line['rejected_by'][0]}`", name]
        for name, line in record.items()
        if len(line["rejected_by"]) == 1
        and line["rejected_by"] != [REFUSED]
        and MUTANTS[name] not in LOOPS
    ]
    return tabulate(sorted(rows), ["check", "mutant"], tablefmt="pipe")


def quick(record: Record) -> str:
    """What quick mode misses of what all checks reject."""
    missed = [
        f"- {name} ({', '.join(f'`{check}`' for check in line['rejected_by'])})"
        for name, line in record.items()
        if line["rejected_by"] and set(line["rejected_by"]) <= set(SLOW)
    ]
    return f"Quick mode misses {len(missed)} of them:\n\n" + "\n".join(missed)


def claims(record: Record) -> str:
    """What passes if its author claims nothing but an order."""
    structure = {"energy", "symplectic", "reversible"}
    passing = [
        f"- {name} ({', '.join(f'`{check}`' for check in line['rejected_by'])})"
        for name, line in record.items()
        if line["rejected_by"] and set(line["rejected_by"]) <= structure
    ]
    return f"If the order alone is claimed, {len(passing)} more pass:\n\n" + "\n".join(passing)


def survivors(record: Record) -> str:
    """What no check rejects, with the reason."""
    rows = [
        [name, SURVIVORS.get(name, "not listed")]
        for name, line in record.items()
        if not line["rejected_by"]
    ]
    return tabulate(rows, ["mutant", "why"], tablefmt="pipe")


SHOWN = {each.__name__: each for each in (families, checks, alone, quick, claims, survivors)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True, help="file of outcomes, *.jsonl")
    parser.add_argument("--only", default="", help="mutants whose name has this in it")
    parser.add_argument("--show", choices=list(SHOWN), help="a table; nothing is judged")
    options = parser.parse_args()
    found = known(options.out)
    if options.show:
        print(SHOWN[options.show]({name: found[name] for name in MUTANTS if name in found}))
        return
    # A warning out of the judge is a fault of the judge.
    warnings.simplefilter("error")
    left = [
        mutant
        for mutant in MUTANTS.values()
        if mutant.name not in found and options.only in mutant.name
    ]
    with options.out.open("a") as file:
        for mutant in track(left, description="mutants", console=Console(stderr=True)):
            line = {"name": mutant.name, "family": mutant.family, "change": mutant.change}
            found[mutant.name] = {**line, "rejected_by": rejected_by(mutant)}
            file.write(json.dumps(found[mutant.name]) + "\n")
            file.flush()
    for name in MUTANTS:
        if name in found and not found[name]["rejected_by"]:
            print(f"survives: {name}\n    {found[name]['change']}")


if __name__ == "__main__":
    main()
