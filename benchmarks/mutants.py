"""Which wrong steppers are rejected, by which checks, and with which words.

    python benchmarks/mutants.py --out docs/data/mutants.jsonl
    python benchmarks/mutants.py --out docs/data/mutants.jsonl --show families
    python benchmarks/mutants.py --out again.jsonl --sample 10 --seed 1

Each mutant of tests/checking/mutants is checked with the claims of the right stepper that it was
made from, and the words for what is wrong are kept beside the checks that reject it. Each outcome
is written to the file at once; the same command resumes if interrupted. `--show` checks nothing,
and prints a table of the outcomes in the file, for docs/validation/testing-the-checks.md.
`--sample 10` draws a tenth of the mutants at random.
"""

from __future__ import annotations

import argparse
import json
import random
import re
import sys
import warnings
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import track
from tabulate import tabulate

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.outcomes import lines_in
from ropeode.checking import CHECKS, SLOW, CheckReport
from tests.checking.mutants.all import LOOPS, MUTANTS, REFUSED, SURVIVORS, failed_of, report_on

Record = dict[str, dict[str, Any]]


def families(record: Record) -> str:
    """Mutants by family, and how many were rejected."""
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
        by = [rejecting for rejecting in steppers if check in rejecting]
        quick = "" if check in SLOW else "yes"
        rows.append([f"`{check}`", quick, len(by), sum(len(each) == 1 for each in by)])
    head = ["check", "in quick mode", "rejects", "alone"]
    return tabulate(rows, head, tablefmt="pipe", colalign=("left", "left", "right", "right"))


def alone(record: Record) -> str:
    """The mutants that only one check rejects."""
    rows = [
        [f"`{line['rejected_by'][0]}`", name]
        for name, line in record.items()
        if len(line["rejected_by"]) == 1
        and line["rejected_by"] != [REFUSED]
        and MUTANTS[name] not in LOOPS
    ]
    return tabulate(sorted(rows), ["check", "mutant"], tablefmt="pipe")


def quick(record: Record) -> str:
    """The mutants that only the checks outside quick mode reject."""
    missed = [
        f"- {name} ({', '.join(f'`{check}`' for check in line['rejected_by'])})"
        for name, line in record.items()
        if line["rejected_by"] and set(line["rejected_by"]) <= set(SLOW)
    ]
    return f"Quick mode misses {len(missed)} mutants:\n\n" + "\n".join(missed)


def claims(record: Record) -> str:
    """The mutants that pass if only an order is claimed."""
    structure = {"energy", "symplectic", "reversible"}
    passing = [
        f"- {name} ({', '.join(f'`{check}`' for check in line['rejected_by'])})"
        for name, line in record.items()
        if line["rejected_by"] and set(line["rejected_by"]) <= structure
    ]
    head = f"If only the order is claimed, {len(passing)} more mutants pass:"
    return "\n".join([head, "", *passing])


def survivors(record: Record) -> str:
    """The mutants that no check rejects, with the reason."""
    rows = [
        [name, SURVIVORS.get(name, "not listed")]
        for name, line in record.items()
        if not line["rejected_by"]
    ]
    return tabulate(rows, ["mutant", "why"], tablefmt="pipe")


# Causes that name no mistake. A question names none either, nor does an order alone.
_NO_NAME = ("unknown", "unfinished")


def _named(report: CheckReport | None) -> list[dict[str, str]]:
    """The diagnosis of a mutant; where none is made, the line of the check that rejects it."""
    if report is None:
        return []
    if report.diagnosis:
        return [
            {"cause": each.cause, "words": each.line, "fix": each.remedy}
            for each in report.diagnosis
        ]
    return [
        {"cause": finding.check, "words": finding.line, "fix": ""} for finding in report.failed[:1]
    ]


def _kind(line: dict[str, Any]) -> str:
    """How a rejected mutant is named."""
    said = line["named"]
    if any(
        each["cause"] in _NO_NAME
        or each["words"].endswith("?")
        or each["fix"].startswith("use a method of order")
        for each in said
    ):
        return "nothing"
    if said[0]["cause"] in CHECKS:
        return "check"
    return "terms" if all(_NUMBERS.search(each["words"]) for each in said) else "named"


# How words end that only say how far terms are off.
_NUMBERS = re.compile(
    r"^(at dt = 0|its vector)(?!.*only where).*"
    r"(times what it should be|of its size|change at another rate|is off by)"
)


def names(record: Record) -> str:
    """How many mutants have a name, by family; and each that has none."""
    told = {name: line for name, line in record.items() if line.get("named")}
    kinds = ("named", "check", "terms", "nothing")
    rows = [
        [family, len(of), *(of.count(kind) for kind in kinds)]
        for family, of in (
            *(
                (family, [_kind(line) for line in told.values() if line["family"] == family])
                for family in dict.fromkeys(line["family"] for line in told.values())
            ),
            ("all", [_kind(line) for line in told.values()]),
        )
    ]
    head = ["made from", "mutants", "named", "by the check", "terms and factors", "nothing"]
    without = [
        f"- {name}: {line['named'][0]['words']}"
        for name, line in told.items()
        if _kind(line) in ("terms", "nothing")
    ]
    return "\n".join([tabulate(rows, head, tablefmt="pipe"), "", *without])


SHOWN = {each.__name__: each for each in (families, checks, alone, quick, claims, survivors, names)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True, help="file of outcomes, *.jsonl")
    parser.add_argument("--only", default="", help="mutants whose name has this in it")
    parser.add_argument("--sample", type=int, default=1, help="draw one of so many mutants")
    parser.add_argument("--seed", type=int, default=1, help="of the sample (default 1)")
    parser.add_argument("--show", choices=list(SHOWN), help="a table; nothing is checked")
    options = parser.parse_args()
    record = {line["name"]: line for line in lines_in(options.out)}
    if options.show:
        print(SHOWN[options.show]({name: record[name] for name in MUTANTS if name in record}))
        return
    # A warning is a bug of a check.
    warnings.simplefilter("error")
    names = [name for name in MUTANTS if options.only in name]
    if options.sample > 1:
        names = random.Random(options.seed).sample(names, len(names) // options.sample)
    missing = [MUTANTS[name] for name in names if name not in record]
    with options.out.open("a") as file:
        for mutant in track(missing, description="mutants", console=Console(stderr=True)):
            report = report_on(mutant, diagnose=True)
            line = {"name": mutant.name, "family": mutant.family, "change": mutant.change}
            record[mutant.name] = {
                **line,
                "rejected_by": failed_of(report),
                "named": _named(report),
            }
            file.write(json.dumps(record[mutant.name]) + "\n")
            file.flush()
    for name in MUTANTS:
        if name in record and not record[name]["rejected_by"]:
            print(f"survives: {name}\n    {record[name]['change']}")


if __name__ == "__main__":
    main()
