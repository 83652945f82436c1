"""Do the tests notice? Deliberate faults, one at a time, and the test that catches each.

`benchmarks/faults.toml` lists the faults. Each is written into a copy of a checkout, in a temporary
folder, and the test files that ought to notice are run there, up to the first failure.

    python benchmarks/faults.py --out docs/data/faults.jsonl
    python benchmarks/faults.py --untouched                  # do these files pass without a fault?
    python benchmarks/faults.py --checkout ../older --python ../older/.venv/bin/python

Faults that have a line in the output already are not tried again. Another checkout may have its
files elsewhere: the fault is then written where its text is, and test files are found by their
names. Where a line has been written differently, a fault lists what it said each time. Half an hour
for all faults, on one processor of a busy machine.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
FAULTS = Path(__file__).with_name("faults.toml")
# A fault may make a loop endless.
_TIME_LIMIT_S = 900


def main() -> None:
    """Apply the faults and write a line of JSON for each."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--checkout", type=Path, default=ROOT)
    parser.add_argument("--python", default=sys.executable, help="With the checkout's packages.")
    parser.add_argument("--only", default="", help="Faults in files whose name has this in it.")
    parser.add_argument("--out", type=Path, help="Default: standard output.")
    parser.add_argument("--untouched", action="store_true", help="Run the tests without a fault.")
    options = parser.parse_args()
    faults = tomllib.loads(FAULTS.read_text())["fault"]
    faults = [fault for fault in faults if options.only in fault["file"]]
    with tempfile.TemporaryDirectory(prefix="ropeode-faults-") as folder:
        copy = Path(folder) / "checkout"
        shutil.copytree(
            options.checkout, copy, ignore=shutil.ignore_patterns(".git", ".venv*", "__pycache__")
        )
        # Every fault is where it should be, before the first one takes its time.
        places = [place_of(fault, copy) for fault in faults]
        files = [test_files(fault["tests"], copy) for fault in faults]
        if options.untouched:
            every = sorted({file for each in files for file in each})
            print(run_tests(copy, options.python, every, None) or "All pass.")
            return
        tried = rows_of(options.out) if options.out and options.out.exists() else []
        out = options.out.open("a") if options.out else sys.stdout
        for number, (fault, place, tests) in enumerate(zip(faults, places, files, strict=True)):
            if any(fault.items() <= row.items() for row in tried):
                continue
            path, old, new = place
            original = path.read_text()
            write(path, original.replace(old, new), 2 * number)
            started = time.perf_counter()
            caught_by = run_tests(copy, options.python, tests, fault.get("only"))
            seconds = round(time.perf_counter() - started, 1)
            write(path, original, 2 * number + 1)
            row = {**fault, "caught_by": caught_by, "seconds": seconds}
            print(json.dumps(row), file=out, flush=True)


def rows_of(path: Path) -> list[dict[str, Any]]:
    """What has been found so far."""
    return [json.loads(line) for line in path.read_text().splitlines()]


def place_of(fault: dict[str, Any], copy: Path) -> tuple[Path, str, str]:
    """The one file with the fault's text, the text, and what it becomes.

    Ends the program where there is not exactly one such place.
    """
    own = copy / "ropeode" / fault["file"]
    folders = (copy / "ropeode", copy / "docs/studies")
    others = (path for folder in folders for path in folder.rglob("*.py"))
    for files in ([own] if own.exists() else [], others):
        places = [
            (path, old, new)
            for path in files
            for old, new in zip(texts(fault["old"]), texts(fault["new"]), strict=True)
            for _ in range(path.read_text().count(old))
        ]
        if places:
            break
    if len(places) != 1:
        sys.exit(f"{fault['file']}: {fault['old']!r} occurs {len(places)} times, not once.")
    return places[0]


def texts(value: str | list[str]) -> list[str]:
    """One text, or what a line has said in several versions."""
    return value if isinstance(value, list) else [value]


def test_files(names: list[str], copy: Path) -> list[str]:
    """Those test files that a checkout has, wherever they are."""
    there = [path for name in names for path in (copy / "tests").rglob(Path(name).name)]
    if not there:
        sys.exit(f"{', '.join(names)}: no test file has this name.")
    return [str(path.relative_to(copy)) for path in there]


def write(path: Path, text: str, number: int) -> None:
    """Write a module so that no bytecode of before is taken for its own.

    Arguments:
        path, text: of the module.
        number: a time of its own, in whole seconds, which is all that bytecode knows of it.
    """
    path.write_text(text)
    os.utime(path, (number, number))


def run_tests(copy: Path, python: str, tests: list[str], only: str | None) -> str | None:
    """The test that failed first; None if none did."""
    command = [python, "-m", "pytest", "-x", "-q", "--tb=no", *tests]
    if "slow:" in (copy / "pyproject.toml").read_text():
        command += ["-m", "not slow"]
    if only:
        command += ["-k", only]
    try:
        done = subprocess.run(
            command,
            cwd=copy,
            env={**os.environ, "PYTHONPATH": str(copy)},
            capture_output=True,
            text=True,
            timeout=_TIME_LIMIT_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return "the time limit"
    if done.returncode == 0:
        return None
    named = re.search(r"^(?:FAILED|ERROR) (.*?)(?: - .*)?$", done.stdout, re.MULTILINE)
    if named is None:
        sys.exit(f"No test was run: {done.stdout}{done.stderr}")
    return named[1]


if __name__ == "__main__":
    main()
