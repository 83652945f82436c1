"""The command line as whole processes: time and memory, and where the time of a table goes.

    python benchmarks/cli.py [--repeats R] [--memory]

`--memory` adds a table and a simulation of a rope of 4096 nodes over 1000 frames; that takes
minutes.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from tabulate import tabulate

RUN = [sys.executable, "-m", "ropeode"]
STEPS = Path(__file__).parents[1] / "docs/examples/steps.py"
CHECK = [*RUN, "check", f"{STEPS}:velocity_verlet", "--order", "2"]
LARGE = ["--num-nodes", "4096", "--frames", "1000"]
SIMULATE = (
    "import ropeode; run = ropeode.simulate("
    "ropeode.Rope(num_nodes=4096).problem(frames=1000), 'semi-implicit-euler', 16);"
    "assert run.positions.shape == (1001, 4096, 2), run.positions.shape"
)


# As a user has it: whoever installs packages compiles their modules, and the first command those of
# a checkout.
ENVIRONMENT = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
SPLIT = [sys.executable, str(Path(__file__).parent / "split.py")]


def timed(command: list[str], cache: str) -> tuple[float, float, float]:
    """Seconds by the clock and of processors, and peak memory in MiB of a whole process."""
    started = time.perf_counter()
    process = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, env={**ENVIRONMENT, "XDG_CACHE_HOME": cache}
    )
    _, status, usage = os.wait4(process.pid, 0)
    seconds = time.perf_counter() - started
    assert os.waitstatus_to_exitcode(status) == 0, command
    return seconds, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def splits(repeats: int) -> None:
    """Print where the time of a table goes, as medians, cold and warm."""
    found: dict[str, list[dict[str, float]]] = {"cold": [], "warm": []}
    for _ in range(repeats):
        with tempfile.TemporaryDirectory() as cache:
            for state in found:
                done = subprocess.run(
                    SPLIT,
                    check=True,
                    capture_output=True,
                    env={**ENVIRONMENT, "XDG_CACHE_HOME": cache},
                )
                found[state].append(json.loads(done.stdout))
    rows = [
        (name, *(f"{statistics.median(run[name] for run in runs):.2f}" for runs in found.values()))
        for name in found["cold"][0]
    ]
    print(tabulate(rows, headers=("part of a table", "cold, s", "warm, s"), disable_numparse=True))


def beside_imports(repeats: int) -> None:
    """Print how long a warm table takes, beside importing what computes it, in turns."""
    imports = [sys.executable, "-c", "import jax, diffrax"]
    with tempfile.TemporaryDirectory() as warm:
        timed([*RUN, "table"], warm)
        pairs = [(timed([*RUN, "table"], warm), timed(imports, warm)) for _ in range(repeats)]
    for what, of in (("wall time", 0), ("processor time", 1)):
        ratio = statistics.median(table[of] / alone[of] for table, alone in pairs)
        print(f"a warm table takes {ratio:.2f} times the {what} of `import jax, diffrax`")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--memory", action="store_true")
    given = parser.parse_args()

    rows = []

    def measure(name: str, command: list[str], *, cold: bool = False, repeats: int) -> None:
        with tempfile.TemporaryDirectory() as warm:
            if not cold:
                timed(command, warm)
            found = []
            for _ in range(repeats):
                with tempfile.TemporaryDirectory() as empty:
                    found.append(timed(command, empty if cold else warm))
        seconds = sorted(s for s, _, _ in found)
        rows.append(
            (name, f"{statistics.median(seconds):.2f}", f"{seconds[0]:.2f}-{seconds[-1]:.2f}",
             f"{statistics.median(p for _, p, _ in found):.2f}", f"{max(m for *_, m in found):.0f}")
        )  # fmt: skip

    measure("python -c pass", [sys.executable, "-c", "pass"], repeats=given.repeats)
    measure("import jax", [sys.executable, "-c", "import jax"], repeats=given.repeats)
    measure("ropeode --help", [*RUN, "--help"], repeats=given.repeats)
    measure("ropeode table --help", [*RUN, "table", "--help"], repeats=given.repeats)
    measure("ropeode table, cold", [*RUN, "table"], cold=True, repeats=given.repeats)
    measure("ropeode table, warm", [*RUN, "table"], repeats=given.repeats)
    for words, more in (("", []), (" --quick", ["--quick"])):
        check = [*CHECK, *more]
        measure(f"ropeode check{words}, cold", check, cold=True, repeats=given.repeats)
        measure(f"ropeode check{words}, warm", check, repeats=given.repeats)
    if given.memory:
        measure("simulate 4096 x 1000", [sys.executable, "-c", SIMULATE], cold=True, repeats=1)
        large = [*RUN, "table", *LARGE, "--steppers", "semi-implicit-euler", "--steps", "16,24,36"]
        measure("table 4096 x 1000", large, cold=True, repeats=1)
    headers = ("command", "seconds", "min-max", "of processors", "peak MiB")
    print(tabulate(rows, headers=headers, disable_numparse=True))
    print()
    beside_imports(given.repeats)
    print()
    splits(given.repeats)


if __name__ == "__main__":
    main()
