"""What released physics engines and integrators really do: `make audit`.

    python benchmarks/audit/judge.py .venv-audit --out docs/data/audit.jsonl [--only NAME ...]

Each engine is installed in an environment of its own, without ropeode. An exporter of at most 40
lines reads `spec.toml` and `initial.csv`, as `ropeode grade --init` writes them, and writes a
trajectory for each number of steps per frame; `ropeode grade` judges the files as they are. A row
of the data file is a method of an engine; rows of engines that are not named stay.
"""

from __future__ import annotations

import argparse
import functools
import json
import platform
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np

from ropeode import grade, reference
from ropeode.checking import Layout, states_of, write_start
from ropeode.checking.energy_drift import measure_drift
from ropeode.errors import InputError, RopeodeError
from ropeode.files import write_whole
from ropeode.json_form import json_of
from ropeode.problems import Problem
from ropeode.references import Reference
from ropeode.study import TableJob, read_spec

HERE = Path(__file__).resolve().parent
ENGINES = HERE / "engines.toml"
PROBLEMS = HERE / "problems"
# Steps per frame that are tried for the largest stable step, and the frames that it must survive.
LADDER = (*range(1, 25), 28, 32, 40, 48, 64, 96, 128)
# Steps per frame of the runs that are graded; few of them are powers of two, which would make
# step sizes exact in single precision.
RUNS = {
    "coarse": (12, 16, 20, 24, 30, 36, 45, 55, 68, 80),
    "first": (100, 150, 225, 340, 500, 750, 1100),
    "fourth": (50, 75, 110, 165, 250, 375),
    "late": (500, 750, 1100, 1650, 2500, 3700),
    "adams": (100, 150, 225, 340, 500),
    "sixth": (30, 40, 54, 72, 96, 130),
    "stars": (10, 15, 22, 33, 50, 75),
    "stars4": (60, 90, 135, 200, 300, 450),
    "stars8": (4, 6, 9, 13, 20, 30),
    "stars9": (120, 180, 270, 400, 600, 900),
    "stars24": (16, 20, 24, 30, 40, 50),
    "stars6": (2, 3, 4, 5, 6, 8),
    "stars15": (1, 2, 3, 4, 6, 8, 12),
    "slow": (60, 90, 135, 200, 300, 450),
    "fine": (1500, 3000, 6000, 12000, 24000, 48000),
    "fine2": (1024, 2048, 4096, 8192, 16384, 32768),
}
LONG = 64
# Steps per frame of the run whose energy is reported.
DRIFT = 64
SECONDS = 900
TOO_LATE = f"stopped after {SECONDS} s"


def engines() -> list[dict[str, Any]]:
    """The engines of the audit, with their methods, claims and citations."""
    return tomllib.loads(ENGINES.read_text())["engine"]


def job_of(case: str, frames: int | None = None) -> TableJob:
    """A case's problem, as a spec that is ready to run."""
    values = read_spec(PROBLEMS / f"{case}.toml")
    return TableJob(values if frames is None else {**values, "frames": frames}, PROBLEMS)


@functools.cache
def certified(case: str) -> Reference:
    """The reference of a case."""
    return reference(job_of(case).given)


def exported(
    python: Path, script: str, method: str, job: TableJob, steps: Sequence[int], folder: Path
) -> tuple[list[Path], dict[int, float], str]:
    """What an exporter writes: its files, seconds per step, and why it ended early.

    Arguments:
        python: of the engine's environment.
        script: the exporter's file name.
        method: its first argument.
        job: the problem.
        steps: steps per frame.
        folder: that is filled.
    """
    write_start(folder, job)
    command = [python.absolute(), HERE / "exporters" / script, method, *map(str, steps)]
    try:
        done = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, timeout=SECONDS, check=False
        )
        ended = done.stderr.strip().splitlines()[-1] if done.returncode else ""
        lines = done.stdout.splitlines()
    except subprocess.TimeoutExpired as late:
        ended, lines = TOO_LATE, (late.stdout or b"").decode().splitlines()
    pairs = [line.split(",") for line in lines if line[:1].isdigit() and line.count(",") == 1]
    files = [folder / f"rope-{n}.csv" for n in steps]
    return [file for file in files if file.exists()], {int(n): float(s) for n, s in pairs}, ended


def states_in(file: Path, problem: Problem) -> np.ndarray | None:
    """The states at the problem's sample times, not-a-number from where the file ends, if any."""
    layout = Layout.of(problem)
    nodes, columns = layout.nodes, len(layout.columns(velocities=True))
    lines = [line.split(",") for line in file.read_text().splitlines() if line[:1] not in "#t"]
    rows = [[float(value) for value in line[2:]] for line in lines if len(line) == 2 + columns]
    if not rows:
        return None
    values = np.full((len(problem.ts) * nodes, columns), np.nan)
    values[: len(rows)] = rows[: len(values)]
    return states_of(problem, values.reshape(-1, nodes, columns))


def judged(files: Sequence[Path], case: str) -> dict[str, Any]:
    """The verdict of `ropeode grade` on a case, as JSON."""
    try:
        return json_of(grade(files, certified(case)))
    except (InputError, RopeodeError) as refused:
        return {"refused": str(refused)}


def summary(report: dict[str, Any]) -> dict[str, Any]:
    """What the page shows of a verdict.

    Arguments:
        report: of the form of `ropeode grade --format json`, or with the reason why it was refused.
    """
    if "refused" in report:
        return {"verdict": "refused", "why": report["refused"]}
    order = next(each for each in report["findings"] if each["check"] == "order")
    found: dict[str, Any] = {
        "verdict": report["verdict"],
        "finding": order["finding"],
        "diagnosis": [each["finding"] for each in report["diagnosis"]],
        "notes": report["notes"],
        "quantities": {},
    }
    if order["convergence"] is not None:
        found["dt"] = order["convergence"]["dt"]
        keys = ("verdict", "observed", "ci95", "limit_off", "limit_allowed", "why", "errors")
        found["quantities"] = {
            name: {key: each[key] for key in keys} | {"used": len(each["used"])}
            for name, each in order["convergence"]["quantities"].items()
        }
    return found


def largest_stable(stable: dict[int, bool]) -> int | None:
    """The fewest steps per frame from which on all that were tried are stable.

    Arguments:
        stable: by steps per frame.
    """
    fewest = None
    for steps in sorted(stable, reverse=True):
        if not stable[steps]:
            break
        fewest = steps
    return fewest


def long_run(
    python: Path, engine: dict[str, Any], method: dict[str, Any], case: str, folder: Path
) -> Any:
    """Energy and stability on an undamped problem, over many frames."""
    job = job_of(case, LONG)
    problem = job.given
    ladder = sorted({DRIFT, *method.get("ladder", LADDER)}, reverse=True)
    files, _, ended = exported(python, engine["exporter"], method["argument"], job, ladder, folder)
    if ended == TOO_LATE:
        words = f"{engine['exporter']} {method['argument']}"
        raise SystemExit(f"{words}: {ended}; shorten its `ladder`")
    verdicts: dict[int, bool] = {}
    drift: dict[str, Any] = {}
    with np.errstate(all="ignore"):
        for steps in ladder:
            file = folder / f"rope-{steps}.csv"
            states = states_in(file, problem) if file in files else None
            if states is None:
                verdicts[steps] = False
                continue
            measured = measure_drift(problem, states)
            verdicts[steps] = measured.verdict != "growing"
            if steps == DRIFT:
                drift = {"verdict": measured.verdict, "line": measured.line, **measured.evidence}
    fewest = largest_stable(verdicts)
    return {
        "drift": drift,
        "frames": LONG,
        "tried": sorted(verdicts),
        "fewest_stable": fewest,
        "ended": ended,
    }


def row_of(engine: dict[str, Any], method: dict[str, Any], environments: Path) -> dict[str, Any]:
    """All that is measured of a method of an engine."""
    python = environments / engine["environment"] / "bin/python"
    words = "import importlib.metadata as m; print(m.version({!r}))".format(engine["package"])
    version = subprocess.run(
        [python, "-c", words], check=True, capture_output=True, text=True
    ).stdout.strip()
    row: dict[str, Any] = {
        "engine": engine["name"],
        "exporter": engine["exporter"],
        "version": version,
        "method": method["name"],
        "cases": {},
    }
    seconds: dict[int, float] = {}
    with tempfile.TemporaryDirectory() as folder:
        for run, chosen in method["runs"].items():
            case, steps = run.partition(" ")[0], RUNS[chosen]
            place = Path(folder) / run.replace(" ", "-")
            files, times, ended = exported(
                python, engine["exporter"], method["argument"], job_of(case), steps, place
            )
            if not files:
                raise SystemExit(f"{engine['exporter']} {method['argument']}: {ended}")
            row["cases"][run] = {"steps": steps, "ended": ended, **summary(judged(files, case))}
            seconds |= {} if seconds else times
        undamped = next((case for case in ("springs", "rigid") if case in method["runs"]), None)
        if case := method.get("long", undamped):
            row["long"] = long_run(python, engine, method, case, Path(folder) / "long")
    row["seconds_per_step"] = float(np.median([*seconds.values()])) if seconds else None
    return row


def main() -> int:
    """Run the audit, and write its rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("environments", type=Path, help="folder with one environment per engine")
    parser.add_argument("--out", type=Path, required=True, help="data file, JSON lines")
    parser.add_argument("--only", nargs="*", help="environments; the rows of others stay")
    given = parser.parse_args()
    old = (
        [json.loads(line) for line in given.out.read_text().splitlines()]
        if given.out.exists()
        else []
    )
    rows = {(row["exporter"], row["method"]): row for row in old[1:]}
    for engine in engines():
        if given.only and engine["environment"] not in given.only:
            continue
        for method in engine["methods"]:
            row = row_of(engine, method, given.environments)
            rows[engine["exporter"], method["name"]] = row
            print(line_of(row), flush=True)
            write_rows(given.out, rows)
    return 0


def write_rows(out: Path, rows: dict[tuple[str, str], dict[str, Any]]) -> None:
    """Write the data file: a line of facts, and one for each row, in the order of the engines."""
    facts = {"python": platform.python_version(), "machine": platform.machine(), "long": LONG}
    known = [(each["exporter"], one["name"]) for each in engines() for one in each["methods"]]
    lines = [facts, *(rows[key] for key in known if key in rows)]
    write_whole(out, "".join(json.dumps(each) + "\n" for each in lines).encode())


def line_of(row: dict[str, Any]) -> str:
    """A row, while it is measured."""
    found = "; ".join(
        f"{case}: {each['verdict']}, {each.get('finding') or each.get('why')}"
        for case, each in row["cases"].items()
    )
    return f"{row['engine']} {row['method']}: {found}; {row.get('long')}; {row['seconds_per_step']}"


if __name__ == "__main__":
    with jax.enable_x64(True):
        sys.exit(main())
