"""ropeode side by side with its peers: the same work, to the same true error, in one run.

    python benchmarks/peers.py [--out FILE] [--parts stepping,references,study]
    python benchmarks/peers.py --show FILE [TABLE]

Steppers with constant steps against the assignment's C++ loop, Numba, a naive `lax.scan`,
diffrax and NumPy: before anything is timed, all have to arrive at the same positions; methods
that do not step alike run at the step size that reaches one true error. References against
SciPy's DOP853 and LSODA, CVODE (scikit-sundae) and heyoka: each at the loosest tolerance of a
ladder whose true error is small enough; the truth is a stored reference in extended precision.
A convergence study against NodePy's `ctest`.

Medians of runs that take turns, round by round; ratios are those of the same round. Prints
Markdown, and writes all single times with `--out` as JSON, anew after each case: what ends early
keeps what it has measured. `--show` prints such a file again, or one table of it. Peers come with
`pip install '.[peers]'`; one that is missing is left out, and a line says so.
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
import platform
import sys
import tempfile
from collections.abc import Iterable, Iterator
from importlib import metadata
from pathlib import Path
from typing import Any

from against.tables import TABLES
from against.timing import Peers

from ropeode.files import write_whole

PACKAGES = (
    "ropeode", "jax", "diffrax", "numpy", "scipy", "numba", "scikit-sundae", "heyoka", "nodepy"
)  # fmt: skip
PARTS = ("stepping", "references", "study")


def processor() -> str:
    """Its name, where the system tells it."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def about() -> dict[str, Any]:
    """When, where and with what it is run."""
    versions = {"Python": platform.python_version()}
    for package in PACKAGES:
        try:
            versions[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    return {
        "date": datetime.date.today().isoformat(),
        "processor": processor(),
        "cores": os.cpu_count(),
        "versions": versions,
    }


def cases_of(parts: list[str], peers: Peers) -> Iterator[dict[str, Any]]:
    """All cases of some parts."""
    # Not above: `--show` needs no JAX.
    from against import many, references, stepping, studies
    from stepping import SOURCE, compiled

    if "stepping" in parts:
        with tempfile.TemporaryDirectory() as folder:
            program = compiled(folder, SOURCE)
            if program is None:
                peers.leave_out("C++", "there is no compiler (g++) on the search path")
            yield from stepping.run(stepping.Size(), peers, program)
            yield from many.run(many.Size(), peers, program)
    if "references" in parts:
        yield from references.run(references.Size(), peers)
    if "study" in parts:
        yield from studies.run(studies.Size(), peers)


def measured(cases: Iterable[dict[str, Any]], peers: Peers, out: Path | None) -> dict[str, Any]:
    """All results; a file has those that there are so far, after each case."""
    results: dict[str, Any] = {"made": about(), "left_out": peers.left_out, "cases": []}
    for case in cases:
        results["cases"].append(case)
        if out:
            write_whole(out, json.dumps(results, indent=1))
    return results


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--out", type=Path, help="write all results as JSON")
    parser.add_argument("--parts", default=",".join(PARTS), help=f"(default {','.join(PARTS)})")
    parser.add_argument("--show", nargs="+", metavar=("FILE", "TABLE"), help="print a result file")
    given = parser.parse_args()
    if given.show:
        file, *names = given.show
        if unknown := [name for name in names if name not in TABLES]:
            parser.error(f"no table {unknown[0]}; there are: {', '.join(TABLES)}")
        try:
            results = json.loads(Path(file).read_text())
        except (OSError, json.JSONDecodeError) as reason:
            parser.error(f"{file} is no result file of this benchmark: {reason}")
    else:
        names, parts = [], given.parts.split(",")
        if unknown := [part for part in parts if part not in PARTS]:
            parser.error(f"no part {unknown[0]}; there are: {', '.join(PARTS)}")
        if given.out and not given.out.absolute().parent.is_dir():
            parser.error(f"--out: there is no folder {given.out.absolute().parent}")
        peers = Peers()
        results = measured(cases_of(parts, peers), peers, given.out)
    # What nobody has explained yet comes last, so that the rest is printed.
    order = names or sorted(TABLES, key=lambda name: name == "losses")
    sys.stdout.write("\n\n".join(text for name in order if (text := TABLES[name](results))) + "\n")


if __name__ == "__main__":
    main()
