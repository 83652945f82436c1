"""How fast trajectories are read, and in how much memory.

    python benchmarks/grade.py [--megabytes M] [--nodes N] [--folder DIR]

Writes trajectories of a rope with every step, as a program would print them with 17 digits, and
the same numbers as NPZ and NetCDF; reads each as `ropeode grade` does, in a process of its own,
and prints the rate and the largest memory above that of the process before. The CSV file comes
in two sizes, one four times the other, which shows how both go on. The numbers are random: what
is read, and looked through, does not depend on them.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import h5netcdf
import numpy as np
from tabulate import tabulate

from ropeode import Rope

FRAMES, AT_ONCE = 20, 1000


def samples(count: int, nodes: int):
    """Blocks of times and of numbers, ``(times, nodes, 4)``."""
    draw = np.random.default_rng(0)
    for first in range(0, count, AT_ONCE):
        size = min(AT_ONCE, count - first)
        times = (first + np.arange(size)) * (FRAMES / (count - 1))
        yield times, draw.normal(size=(size, nodes, 4)) * 100.0


def write_csv(path: Path, count: int, nodes: int) -> None:
    line = "%.17g,%d,%.17g,%.17g,%.17g,%.17g\n"
    with path.open("w") as file:
        file.write(f"# dt = {FRAMES / (count - 1)!r}\nt,node,x,y,vx,vy\n")
        for times, values in samples(count, nodes):
            rows = np.column_stack(
                [
                    np.repeat(times, nodes),
                    np.tile(np.arange(nodes), len(times)),
                    values.reshape(-1, 4),
                ]
            )
            file.write((line * len(rows)) % tuple(rows.reshape(-1).tolist()))


def write_arrays(folder: Path, count: int, nodes: int) -> list[Path]:
    blocks = list(samples(count, nodes))
    t, values = (np.concatenate(parts) for parts in zip(*blocks, strict=True))
    x, v, dt = values[:, :, :2].copy(), values[:, :, 2:].copy(), FRAMES / (count - 1)
    np.savez(folder / "it.npz", t=t, positions=x, velocities=v, dt=dt)
    with h5netcdf.File(folder / "it.nc", "w") as file:
        file.dimensions = {"time": count, "node": nodes, "axis": 2}
        file.create_variable("t", ("time",), data=t)
        file.create_variable("positions", ("time", "node", "axis"), data=x)
        file.create_variable("velocities", ("time", "node", "axis"), data=v)
        file.attrs["dt"] = dt
    return [folder / "it.npz", folder / "it.nc"]


def read(path: Path, nodes: int) -> None:
    """Read a file, and print the seconds of processor time and the megabytes that it took."""
    from ropeode.checking import read_runs

    problem = Rope(num_nodes=nodes).problem(frames=FRAMES)
    before, started = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.process_time()
    read_runs([path], problem, fewest=1)
    seconds = time.process_time() - started
    print(seconds, (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024)


def measured(path: Path, nodes: int) -> list[str]:
    command = [sys.executable, __file__, "--read", str(path), "--nodes", str(nodes)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    seconds, memory = map(float, done.stdout.split())
    size = path.stat().st_size / 1e6
    return [path.name, f"{size:.0f}", f"{seconds:.1f}", f"{size / seconds:.0f}", f"{memory:.0f}"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--megabytes", type=int, default=1000)
    parser.add_argument("--nodes", type=int, default=16)
    parser.add_argument("--folder", type=Path)
    parser.add_argument("--read", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.read:
        read(given.read, given.nodes)
        return
    # About 91 bytes for a node at a time; the same number of samples in each quarter of a frame.
    count = 4 * FRAMES * max(1, round(given.megabytes * 1e6 / 364 / given.nodes / FRAMES)) + 1
    rows = []
    with tempfile.TemporaryDirectory(dir=given.folder) as folder:
        for name, size in (("quarter.csv", (count - 1) // 4 + 1), ("whole.csv", count)):
            path = Path(folder) / name
            write_csv(path, size, given.nodes)
            rows.append(measured(path, given.nodes))
            path.unlink()
        rows += [
            measured(path, given.nodes) for path in write_arrays(Path(folder), count, given.nodes)
        ]
    headers = ["file", "MB", "CPU seconds", "MB/s", "memory MB"]
    print(tabulate(rows, headers, disable_numparse=True, stralign="right"))


if __name__ == "__main__":
    main()
