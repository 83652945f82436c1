"""Cases put together into tasks: problems of one shape, with all their steppers and steps."""

from __future__ import annotations

import dataclasses
from collections.abc import Container, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from ropeode.sweep.design.cases import Case, Design, Point
from ropeode.sweep.design.content_hash import digest

# Of one task. More would lose more work where a process is killed, and gain little.
MOST_PROBLEMS = 64
# Of problems in a sweep whose references are kept, each in a file: more files than that are a
# burden to most file systems.
MOST_KEPT = 100_000
# Of the states of one run of all problems of a task.
MOST_BYTES = 2**26
# Parameters that say how large arrays are. Others may as well, in a user's problem; then what
# a task holds is run in parts.
SHAPES = ("frames", "num_nodes", "num_masses", "start")
# Problems among which those of one shape are looked for, where shapes alternate.
_LOOK_AT = 1024


@dataclasses.dataclass(frozen=True)
class Task:
    """Cases that are run together, in any process.

    Arguments:
        folder: that the file of the problem is in, if it is from a file.
        surroundings: in which the keys were made.
        digest: sha256 of that file; None for a problem of the library.
        keep: whether references are kept in the sweep's folder. All cases of a problem are in
            one task, so that they are needed again only where a sweep is extended or a task
            was interrupted.
        cases: of problems of one shape.
    """

    folder: Path
    surroundings: Mapping[str, str]
    digest: str | None
    keep: bool
    cases: tuple[Case, ...]

    @property
    def key(self) -> str:
        """The hash of the keys of its cases."""
        return digest([case.key for case in self.cases])

    def without(self, known: Container[str]) -> Task | None:
        """The task without the cases whose keys are known; None if nothing is left."""
        left = tuple(case for case in self.cases if case.key not in known)
        return dataclasses.replace(self, cases=left) if left else None


def batched(design: Design, first: int = 0) -> Iterator[tuple[Case, ...]]:
    """The cases of a design, those of problems of one shape together.

    Problems of one shape are looked for among some thousand at a time, so that memory is
    bounded whatever the design's size.

    Arguments:
        design: whose cases.
        first: so many of the batches are left out, without their cases being made.
    """
    look_up = design.point if any(name in design.drawn for name in SHAPES) else design.place
    number = 0
    for start in range(0, design.problems, _LOOK_AT):
        shapes: dict[Shape, list[int]] = {}
        for index in range(start, min(start + _LOOK_AT, design.problems)):
            shapes.setdefault(_shape(design, look_up(index)), []).append(index)
        for shape, alike in shapes.items():
            most = max(1, min(MOST_PROBLEMS, MOST_BYTES // shape.bytes))
            for at in range(0, len(alike), most):
                if number >= first:
                    points = map(design.point, alike[at : at + most])
                    yield tuple(case for point in points for case in design.cases_of(point))
                number += 1


class Shape(NamedTuple):
    """What says how large a run is.

    Fields:
        dim: components of a position; 1 where it is not known.
        nodes: or masses; 1 where it is not known.
        frames: 1 where it is not known.
    """

    dim: int
    nodes: int
    frames: int

    @property
    def bytes(self) -> int:
        """Of the positions and velocities at all samples."""
        return 16 * self.dim * self.nodes * (self.frames + 1)


def _shape(design: Design, point: Point) -> Shape:
    given = {**design.maker.defaults, **point.parameters}

    def whole(name: str) -> int:
        # What is wrong is told when the problem is built.
        value = given.get(name)
        return int(value) if isinstance(value, (int, float)) and value >= 1 else 1

    start = given.get("start")
    dim = len(start) if isinstance(start, (list, tuple)) else 1
    return Shape(dim, max(whole("num_nodes"), whole("num_masses")), whole("frames"))
