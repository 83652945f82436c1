"""The overhead of a sweep over its runs, and how it grows with workers and with cases.

    python benchmarks/sweep.py [--cases N] [--tasks T] [--repeats R] [--dask]

Three parts. The cost of a case in the process that hands it out and stores its row, by step, on a
grid of a hundred million cases, of which the first N are computed at no cost; memory and files
after each tenth of them. A real sweep of T tasks: cases per second in this process,
in one and in two others, and with `--dask` on clusters of one and of two workers, medians of
interleaved runs, without the first quarter, which compiles. Bytes of a row.
"""

from __future__ import annotations

import argparse
import contextlib
import functools
import itertools
import os
import pickle
import resource
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from tabulate import tabulate

from ropeode import SweepSpec, read_sweep
from ropeode.cache import set_up_jax
from ropeode.sweep import (
    RESULTS,
    DaskCluster,
    InProcess,
    LocalProcesses,
    Row,
    Store,
    Task,
    evaluate,
    work_through,
)
from ropeode.sweep.design.spec import MOST_PROBLEMS

# Of a hundred million cases, nearly: 10000 dampings, 2500 stiffnesses, 2 steppers, 2 steps.
HUGE = {
    "steppers": ["semi-implicit-euler", "rk4"],
    "steps_per_frame": [16, 32],
    "rope": {"num_nodes": 4},
    "grid": {
        "damping": [0.001 * i for i in range(1, 10_001)],
        "stiffness": [float(i) for i in range(1, 2501)],
        "frames": [2],
    },
}
REAL = """
steppers = ["semi-implicit-euler", "stormer-verlet", "rk4"]
steps_per_frame = [16, 32, 64]
[rope]
num_nodes = 8
[grid]
frames = [4]
damping = [{dampings}]
stiffness = [50.0, 100.0, 150.0, 200.0]
"""


class Part:
    """The first tasks of a sweep."""

    def __init__(self, spec: SweepSpec, cases: int):
        self._spec, self._cases = spec, cases

    @property
    def count(self) -> int:
        """How many cases."""
        return self._cases

    def tasks(self, first: int = 0):
        """Its tasks, from a number on."""
        tasks = self._spec.tasks(first)
        each = next(self._spec.tasks()).cases
        return itertools.islice(tasks, max(0, self._cases // len(each) - first))


def nothing(task: Task) -> list[Row]:
    """Rows like real ones, at no cost, with numbers that cannot be compressed."""
    numbers = dict.fromkeys(RESULTS)
    return [
        {
            **case.inputs(),
            **numbers,
            "status": "ok",
            "reference": case.problem_key,
            "order_verdict": "converges",
            "order_used": "16, 32, 64, 128",
            **{
                name: int(case.key[8 * i : 8 * i + 13], 16) / 2**52
                for i, name in enumerate(("error_max", "error_rms", "error_final", "round_off"))
            },
        }
        for case in task.cases
    ]


def memory() -> float:
    """Megabytes that this process has now."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 2**20


def each_step(spec: SweepSpec, cases: int, folder: Path) -> None:
    """Time of each step by itself, in CPU seconds of this process."""
    tasks = list(Part(spec, cases).tasks())
    store = Store(folder / "steps", spec.columns)
    rows = [nothing(task) for task in tasks]
    steps: dict[str, Callable[[], object]] = {
        "cases made and hashed": lambda: list(Part(spec, cases).tasks()),
        "tasks pickled and read": lambda: [pickle.loads(pickle.dumps(task)) for task in tasks],
        "rows pickled and read": lambda: [pickle.loads(pickle.dumps(each)) for each in rows],
        "files of tasks written": lambda: [
            store.add(n // 256, store.table(task.cases, each))
            for n, (task, each) in enumerate(zip(tasks, rows, strict=True))
        ],
        "files merged": lambda: [store.seal(n) for n in range(len(tasks) // 256 + 1)],
        "tasks skipped on going on": lambda: next(spec.tasks(len(tasks)), None),
    }
    table = []
    for name, step in steps.items():
        began, cpu = time.perf_counter(), time.process_time()
        step()
        spent = time.perf_counter() - began, time.process_time() - cpu
        table.append([name, *(f"{1e6 * each / cases:.1f}" for each in spent)])
    print(f"\n{cases} cases in {len(tasks)} tasks; microseconds per case\n")
    print(tabulate(table, ["step", "elapsed", "CPU"], colalign=("left", "right", "right")))


def growth(spec: SweepSpec, cases: int, folder: Path) -> None:
    """Memory and files as the sweep goes on."""
    store, table, began = Store(folder / "growth", spec.columns), [], time.perf_counter()

    def look(text: str, fraction: float | None) -> None:
        done = round(cases * (fraction or 0.0))
        if done >= cases * (len(table) + 1) / 10 or done == 0 == len(table):
            files = list(store.folder.rglob("*.parquet"))
            size = sum(path.stat().st_size for path in files)
            table.append(
                [
                    done,
                    f"{time.perf_counter() - began:.1f}",
                    f"{memory():.0f}",
                    len(files),
                    f"{size / max(done, 1):.0f}",
                ]
            )

    work_through(Part(spec, cases), store, InProcess(nothing), look)
    print(f"\nthe first {cases} cases of {spec.count}, with work that costs nothing\n")
    print(tabulate(table, ["cases", "seconds", "MB of memory", "files", "bytes per case"]))


@contextlib.contextmanager
def engine(kind: str, folder: Path):
    work = functools.partial(evaluate, folder=folder)
    if kind == "this process":
        yield InProcess(work)
    elif kind.startswith("dask"):
        import distributed

        with distributed.LocalCluster(
            n_workers=int(kind[-1]), threads_per_worker=1, dashboard_address=":0"
        ) as cluster:
            yield DaskCluster(work, cluster.scheduler_address)
    else:
        with contextlib.closing(LocalProcesses(work, int(kind[0]))) as made:
            yield made


def processor_time() -> float:
    """Seconds of processor time of this process and of its children that have ended."""
    own = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(each.ru_utime + each.ru_stime for each in own)


def rate(spec: SweepSpec, kind: str, folder: Path) -> tuple[float, float, float, float]:
    """Cases per second once all workers have compiled, the whole in seconds, bytes per case.

    Last the milliseconds of processor time per case, starting and compiling included.
    """
    samples: list[tuple[float, float]] = []
    began, busy = time.perf_counter(), processor_time()
    with engine(kind, folder) as made:
        store = Store(folder / "rows", spec.columns)
        work_through(
            spec, store, made, lambda text, part: samples.append((time.perf_counter(), part or 0.0))
        )
    whole = time.perf_counter() - began
    # The first quarter of the tasks pays for starting and compiling.
    (start, before), (end, after) = samples[max(1, len(samples) // 4)], samples[-1]
    size = sum(path.stat().st_size for path in store.folder.rglob("*.parquet"))
    busy = 1e3 * (processor_time() - busy) / spec.count
    return spec.count * (after - before) / (end - start), whole, size / spec.count, busy


def real(tasks: int, repeats: int, kinds: list[str], folder: Path) -> None:
    dampings = ", ".join(f"{0.001 * i:.3f}" for i in range(1, tasks * MOST_PROBLEMS // 4 + 1))
    path = folder / "real.toml"
    path.write_text(REAL.format(dampings=dampings))
    spec = read_sweep(path)
    found: dict[str, list[tuple[float, ...]]] = {kind: [] for kind in kinds}
    for repeat in range(repeats):
        for kind in kinds:
            own = folder / f"{kind} {repeat}"
            own.mkdir()
            found[kind].append(rate(spec, kind, own))
    table = []
    for kind, each in found.items():
        rates, wholes, sizes, busy = zip(*each, strict=True)
        table.append(
            [
                kind,
                f"{statistics.median(rates):.0f}",
                f"{min(rates):.0f} to {max(rates):.0f}",
                f"{statistics.median(wholes):.1f}",
                f"{sizes[0]:.0f}",
                f"{statistics.median(busy):.1f}",
            ]
        )
    print(f"\na real sweep of {spec.count} cases; load {os.getloadavg()[0]:.1f}\n")
    heads = ["where", "cases/s", "spread", "seconds in all", "bytes per case", "CPU ms per case"]
    print(tabulate(table, heads))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=200_000)
    parser.add_argument("--tasks", type=int, default=16)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--dask", action="store_true")
    chosen = parser.parse_args()
    set_up_jax()
    kinds = ["this process", "1 worker", "2 workers", *(["dask 1", "dask 2"] * chosen.dask)]
    spec = SweepSpec(HUGE)
    with tempfile.TemporaryDirectory() as name:
        each_step(spec, min(chosen.cases, 50_000), Path(name))
        growth(spec, chosen.cases, Path(name))
        real(chosen.tasks, chosen.repeats, kinds, Path(name))


if __name__ == "__main__":
    main()
