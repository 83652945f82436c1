"""Writing, sealing and checking reference files, against plain writing and reading.

    python benchmarks/files.py [--megabytes M] [--repeats R] [--folder DIR]

Writes a reference's arrays of so many megabytes as `save_reference` does (NetCDF4, the sha256
of the contents, the checksum, fsync, rename), and beside it the same bytes with nothing but `write`
and `fsync`. Checks the checksum, and beside it reads the file, and hashes it with `hashlib`'s own
`file_digest`. Medians of interleaved runs, and the memory that checking takes at most.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import statistics
import tempfile
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
from tabulate import tabulate

from ropeode.files import write_whole
from ropeode.references import verify_checksum, with_checksum
from ropeode.references.files import netcdf
from ropeode.references.files.encoding import Array

CHUNK = 2**20


def plain_write(path: Path, values: np.ndarray) -> None:
    with path.open("wb") as file:
        file.write(values.data)
        file.flush()
        os.fsync(file.fileno())


def reference_write(path: Path, values: np.ndarray) -> None:
    arrays = {"state": Array(("time", "entry"), values, "state", "1")}
    write_whole(path, with_checksum(netcdf.encoded(arrays, {"schema": "benchmark"})))


def plain_read(path: Path) -> None:
    with path.open("rb") as file:
        while file.read(CHUNK):
            pass


def plain_hash(path: Path) -> None:
    with path.open("rb") as file:
        hashlib.file_digest(file, "sha256")


def seconds(work: Callable[[], object]) -> float:
    began = time.perf_counter()
    work()
    return time.perf_counter() - began


def peak_bytes(work: Callable[[], object]) -> int:
    tracemalloc.start()
    work()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--megabytes", type=int, default=100, help="(default 100)")
    parser.add_argument("--repeats", type=int, default=7, help="(default 7)")
    parser.add_argument("--folder", type=Path, default=None, help="on the disk that is meant")
    options = parser.parse_args()
    values = np.random.default_rng(0).normal(size=(options.megabytes * 125, 1000))
    with tempfile.TemporaryDirectory(dir=options.folder) as folder:
        whole, bare = Path(folder) / "reference.nc", Path(folder) / "plain.bin"
        works: dict[str, Callable[[], object]] = {
            "plain write and fsync": lambda: plain_write(bare, values),
            "reference: write, hash, checksum": lambda: reference_write(whole, values),
            "plain read": lambda: plain_read(whole),
            "plain sha256": lambda: plain_hash(whole),
            "reference: verify the checksum": lambda: verify_checksum(whole),
            "reference: read and check all": lambda: (verify_checksum(whole), netcdf.read(whole)),
        }
        times: dict[str, list[float]] = {name: [] for name in works}
        for _ in range(options.repeats):
            for name, work in works.items():
                times[name].append(seconds(work))
        memory = peak_bytes(lambda: verify_checksum(whole))
    medians = {name: statistics.median(each) for name, each in times.items()}
    peers = {
        "plain write and fsync": "plain write and fsync",
        "reference: write, hash, checksum": "plain write and fsync",
        "plain read": "plain sha256",
        "plain sha256": "plain sha256",
        "reference: verify the checksum": "plain sha256",
        "reference: read and check all": "plain sha256",
    }
    rows = [
        (
            name,
            f"{medians[name]:.3f}",
            f"{min(times[name]):.3f} to {max(times[name]):.3f}",
            f"{options.megabytes / medians[name]:.0f}",
            f"{medians[name] / medians[peers[name]]:.2f} x {peers[name]}",
        )
        for name in works
    ]
    print(f"{options.megabytes} MB, medians of {options.repeats} interleaved runs, in page cache\n")
    print(tabulate(rows, ["", "s", "spread", "MB/s", "ratio"], tablefmt="github"))
    print(f"\nMemory that verifying the checksum takes at most: {memory / 2**20:.2f} MiB")


if __name__ == "__main__":
    main()
