"""What `ropeode grade` says of programs as people write them, with one mistake or none.

    python benchmarks/programs.py --out docs/data/programs.jsonl
    python benchmarks/programs.py --out again.jsonl --only Verlet
    python benchmarks/programs.py --out docs/data/programs.jsonl --show

The programs are loops of tests/checking/written_programs.py, which share nothing with the package.
They solve the ropes of the well-known assignment for 20 frames. What is in the file already is
not graded again. `--show` prints the table of docs/validation/programs.md.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console
from rich.progress import track
from tabulate import tabulate

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.outcomes import lines_in
from ropeode import InextensibleRope, Rope, grade, reference
from ropeode.errors import InputError
from tests.checking.written_programs import (
    Program,
    explicit,
    frozen,
    kick_drift_kick,
    on_a_floor,
    rk4,
    slowed_down,
    speed,
)

FRAMES = 20
STEPS = (32, 64, 128, 256)
FINE = (128, 256, 512, 1024)
ROPES = {
    "springs": Rope(),
    "damped springs": Rope(damping=0.01),
    "thrown, damped": Rope(damping=0.01, initial_velocity=(3.0, -1.0)),
    "rigid links": InextensibleRope(),
    "unequal masses": Rope(
        node_mass=tuple(1.0 + i % 3 for i in range(16)), damping=0.05, initial_velocity=(3.0, -1.0)
    ),
}
KEPT = {"method": "verlet", "kept": 1.0 - 5e-5}


class Case(NamedTuple):
    """A program, and how it is graded.

    Fields:
        does: what it does, in words.
        change: of a right `Program`.
        order: that is claimed.
        rope: of `ROPES`.
        steps: per frame, of each file.
        digits: in the files.
        positions_only: whether the files have no velocities.
    """

    does: str
    change: dict[str, Any]
    order: int = 1
    rope: str = "springs"
    steps: tuple[int, ...] = STEPS
    digits: int = 17
    positions_only: bool = False


CASES = (
    Case("semi-implicit Euler, right", {}),
    Case("Verlet, each step keeps 1 - 5e-5", KEPT, positions_only=True),
    Case("the same, three coarse files", KEPT, steps=(16, 32, 64), positions_only=True),
    Case("the same, started by Taylor", {**KEPT, "starts": "taylor"}, 2, positions_only=True),
    Case("the same on rigid links", KEPT, 1, "rigid links", FINE, positions_only=True),
    Case("Verlet on rigid links, gravity 9.8", {"method": "verlet", "gravity": 9.8}, 1,
         "rigid links", FINE, positions_only=True),
    Case("forces never set to zero", {"adds_up": True}),
    Case("springs push", {"push": True}),
    Case("the last node never moves", {"rested": (15,)}),
    Case("gravity times dt once more", {"gravity_times_dt": True}),
    Case("a dashpot in the springs", {"dashpot": 0.3}),
    Case("a dashpot with the wrong sign", {"dashpot": -0.01}),
    Case("air drag added per spring", {"drag_per_spring": 0.02}),
    Case("the damping is missing", {"damping": 0.0}, rope="damped springs"),
    Case("springs pull at one end only", {"one_sided": True}),
    Case("lengths in single precision", {"single_length": True}),
    Case("the same, Verlet", {"method": "verlet", "single_length": True}, 2, positions_only=True),
    Case("RK4 in single precision", {"method": rk4, "number": np.float32}, 4, digits=9),
    Case("nodes at i/16 in place of i/15", {"fence_post": True}),
    Case("all forces times 0.999", {"acceleration_times": 0.999}),
    Case("kick-drift-kick with damping", {"method": kick_drift_kick}, 2, "thrown, damped"),
    Case("Verlet started with x(-dt) = x(0)", {"method": "verlet", "starts": "rest"}, 2,
         "thrown, damped", positions_only=True),
    Case("explicit Euler where order 2 is claimed", {"method": explicit}, 2, "damped springs",
         FINE),
    Case("forces not divided by the mass", {"masses_that_divide": 0}, rope="unequal masses"),
    Case("gravity times the mass", {"masses_of_gravity": 1}, rope="unequal masses"),
    Case("a spring's direction that is no unit vector", {"spring_times": lambda length, _: length}),
    Case("drag with the square of the speed", {"drag_times": speed}, rope="thrown, damped"),
    Case("gravity 9.8, and the damping is missing", {"gravity": 9.8, "damping": 0.0},
         rope="thrown, damped"),
    Case("velocity Verlet without the new acceleration", {"method": frozen}, 2, "thrown, damped"),
    Case("a floor at y = 146", {"afterwards": on_a_floor}),
    Case("RK4 that keeps speeds below 4", {"method": rk4, "afterwards": slowed_down}, 4,
         "thrown, damped"),
    Case("RK4 with `while t < end`", {"method": rk4, "counts_by_time": True}, 4,
         steps=(10, 20, 50, 100)),
    Case("RK4, samples by a straight line between steps", {"method": rk4,
         "line_between_steps": True}, 4),
)  # fmt: skip


def graded(case: Case, truth: Any) -> dict[str, Any]:
    """What is said of a program, and the processor time that it took."""
    with tempfile.TemporaryDirectory() as folder:
        columns = 2 if case.positions_only else 4
        program = Program(truth.problem, **case.change)
        files = program.files(Path(folder), case.steps, columns, digits=f"%.{case.digits}g")
        started = time.process_time()
        try:
            report = grade(files, truth, expected_order=case.order)
        except InputError as error:
            # Where the files lie is of no interest.
            line = str(error).replace(f"{folder}/", "")
            said = {"verdict": "refused", "order": line, "diagnosis": []}
        else:
            lines = [each.line for each in report.findings if each.check == "order"]
            causes = [[each.cause, each.line, each.remedy] for each in report.diagnosis]
            said = {"verdict": report.verdict, "order": "; ".join(lines), "diagnosis": causes}
    return {"name": case.does, **said, "seconds": round(time.process_time() - started, 1)}


def shown(record: dict[str, dict[str, Any]]) -> str:
    """The table of all programs."""
    rows = [
        [
            line["name"],
            line["verdict"],
            "; ".join(f"**{cause}**: {words}" for cause, words, _ in line["diagnosis"])
            or line["order"],
        ]
        for line in record.values()
    ]
    return tabulate(rows, ["what the program does", "verdict", "words"], tablefmt="pipe")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True, help="file of outcomes, *.jsonl")
    parser.add_argument("--only", default="", help="programs whose words have this in them")
    parser.add_argument("--show", action="store_true", help="the table; nothing is graded")
    options = parser.parse_args()
    record = {line["name"]: line for line in lines_in(options.out)}
    if options.show:
        print(shown({case.does: record[case.does] for case in CASES if case.does in record}))
        return
    truths: dict[str, Any] = {}
    missing = [case for case in CASES if options.only in case.does and case.does not in record]
    with options.out.open("a") as file:
        for case in track(missing, description="programs", console=Console(stderr=True)):
            if case.rope not in truths:
                truths[case.rope] = reference(ROPES[case.rope].problem(FRAMES))
            file.write(json.dumps(graded(case, truths[case.rope])) + "\n")
            file.flush()


if __name__ == "__main__":
    main()
