"""What `ropeode grade FOLDER` asks of every submission: trajectories, one for each step size."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ropeode.checking import CheckReport, read_runs
from ropeode.checking.grade import grade
from ropeode.classroom.examination import Asked
from ropeode.errors import InputError
from ropeode.sandbox import MEBIBYTE, Limits
from ropeode.study import TableJob

# The reference that all submissions share, in the folder that is laid ready for them.
REFERENCE = "reference.nc"
# Of the time limit of the reference, what files may take to be read and explained.
_PROCESSOR, _WALL = 10.0, 20.0


@dataclasses.dataclass(frozen=True)
class Trajectories(Asked):
    """A grade for the files of each.

    Arguments:
        values: of the spec of the problem, as `TableJob` takes them.
        folder: that its names of files start from.
        arguments: those of `grade` that go with the files.
        truth: a digest of the reference.
        time_limit: of the reference, in seconds.
    """

    values: Mapping[str, Any]
    folder: str
    arguments: Mapping[str, Any]
    truth: str
    time_limit: float

    refused = "refused"
    ahead = (
        "ropeode.bars",
        "ropeode.checking.diagnosis.trajectories",
        "ropeode.problems.library",
        "ropeode.references.files.netcdf",
        "ropeode.references.files.store",
        "ropeode.simulation.driver",
    )

    @property
    def limits(self) -> Limits:
        """Large files take their time, and causes that are sought."""
        longest = self.time_limit
        return Limits(_PROCESSOR * longest, _WALL * longest, self.memory_mib * MEBIBYTE)

    def report(
        self, where: Sequence[str], folder: Path, scratch: Path, say: Callable[[str], None]
    ) -> tuple[CheckReport, str]:
        """The report of `grade`, and a digest of the numbers."""
        reference = str(scratch / REFERENCE)
        job = TableJob({"reference": reference, **self.values}, Path(self.folder))
        files = [folder / each for each in where]
        report = grade(files, job.given, **self.arguments, progress=lambda text, _: say(text))
        say("a comparison with others")
        digest = hashlib.sha256()
        try:
            runs = read_runs(files, job.problem, self.arguments["dts"])
        except InputError:
            # They were graded as what they were meant to be.
            return report, ""
        for run in runs:
            digest.update(repr((run.dt, run.values.shape)).encode() + run.values.tobytes())
        return report, digest.hexdigest()
