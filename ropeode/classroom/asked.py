"""What is asked of every submission: of steppers by `check`, of trajectories by `grade`."""

from __future__ import annotations

import abc
import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import ClassVar

from ropeode.checking import CheckReport
from ropeode.classroom.outcome import Status
from ropeode.sandbox import Limits


@dataclasses.dataclass(frozen=True)
class Asked(abc.ABC):
    """What is asked, as plain values: another process reads it.

    Arguments:
        memory_mib: memory that a submission may hold, in MiB.
    """

    memory_mib: float

    # The status of a submission that is not there, or not of the form that is asked for.
    refused: ClassVar[Status]
    # Modules that are imported when they are first needed; here before the first submission.
    ahead: ClassVar[tuple[str, ...]]

    @property
    @abc.abstractmethod
    def limits(self) -> Limits:
        """Of a submission."""

    @abc.abstractmethod
    def report(
        self, where: Sequence[str], folder: Path, scratch: Path, say: Callable[[str], None]
    ) -> tuple[CheckReport, str]:
        """The report on a submission, and its behaviour as `Outcome` has it.

        Arguments:
            where: its files, from the folder on, as `Submission` has them.
            folder: of all submissions.
            scratch: holds what was laid ready for all of them.
            say: is called with what is being done.

        Raises:
            RopeodeError: there is none; says why.
        """

    def cut_off(self, where: Sequence[str], how: str, during: str) -> CheckReport | None:
        """The report on a submission that ended its process; None where it is not to blame.

        Arguments:
            where: as for `report`.
            how: in words, such as "ended its process (exit code 0)".
            during: what was being done.
        """
        return None
