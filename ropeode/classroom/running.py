"""Checks the submissions of a folder, some at a time, and keeps what is done."""

from __future__ import annotations

import hashlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from ropeode.checking.check import chosen_checks, cut_off
from ropeode.checking.claims import checked_claims
from ropeode.checking.report import Claims
from ropeode.classroom.examination import outcome_of, without_report
from ropeode.classroom.outcome import Outcome, keep, kept
from ropeode.classroom.submissions import Submission
from ropeode.errors import RopeodeError
from ropeode.files import make_folder, refuse_code
from ropeode.identity import software
from ropeode.progress import Progress
from ropeode.threads import cores

_CODE = "from ropeode.classroom.nursery import main; main()"
_ENDS_IN_S = 5.0


class _InAll(NamedTuple):
    """What a whole submission may take."""

    processor_s: int
    wall_s: float


def _in_all(time_limit: float) -> _InAll:
    """The limits of a whole submission, of which ropeode needs a part itself.

    Arguments:
        time_limit: of the step in each check.
    """
    return _InAll(round(20.0 + 6.0 * time_limit), 60.0 + 10.0 * time_limit)


class Asked(NamedTuple):
    """What is asked of every submission, as for `check_stepper`.

    Fields:
        claims: as they were given.
        only: names of checks.
        skip: likewise.
        quick: whether what takes long is left out.
        time_limit: seconds of processor time that a step may use in each check.
        memory_mib: memory that a submission may hold, in MiB.
    """

    claims: Claims
    only: Sequence[str] | None
    skip: Sequence[str]
    quick: bool
    time_limit: float
    memory_mib: float

    @property
    def arguments(self) -> dict[str, Any]:
        """The arguments of `check_stepper`."""
        claims = dict(vars(self.claims))
        return {
            "expected_order": claims.pop("order"),
            **claims,
            "only": self.only,
            "skip": self.skip,
            "quick": self.quick,
            "time_limit": self.time_limit,
        }


class Class:
    """The submissions of a folder, and the process from which theirs are forked.

    Arguments:
        folder: of the submissions.
        submissions: in it.
        asked: of each.
        results: a folder that keeps what is done; None to keep nothing.
    """

    def __init__(
        self,
        folder: Path,
        submissions: Sequence[Submission],
        asked: Asked,
        results: Path | None,
    ) -> None:
        refuse_code("step", folder)
        self._folder, self._submissions = folder.resolve(), submissions
        self._asked = asked._replace(claims=checked_claims(asked.claims))
        self._checks = chosen_checks(asked.only, asked.skip, asked.quick)
        self._results = results
        self._process: subprocess.Popen | None = None
        if results is not None:
            make_folder(results)

    def end(self) -> None:
        """End all processes; nothing where there are none."""
        if self._process is not None and self._process.stdin is not None:
            # It ends the others when nobody is there any more.
            self._process.stdin.close()
            try:
                self._process.wait(_ENDS_IN_S)
            except subprocess.TimeoutExpired:
                os.killpg(self._process.pid, signal.SIGKILL)
                self._process.wait()

    def outcomes(self, progress: Progress) -> list[Outcome]:
        """What became of each submission, in their order.

        Arguments:
            progress: is called with the submission that was done last, and the fraction.

        Raises:
            RopeodeError: the process that checks them has died.
        """
        done: dict[str, Outcome] = {}
        keys = {each.name: self._key(each) for each in self._submissions}
        if self._results is not None:
            for name, key in keys.items():
                if (outcome := kept(name, key, self._results)) is not None:
                    done[name] = outcome
        for each in self._submissions:
            if each.where is None:
                done[each.name] = without_report(
                    each.name, "no stepper", RopeodeError(each.trouble), self._folder
                )
        left = [each for each in self._submissions if each.name not in done]
        count = len(self._submissions)
        progress(f"{len(done)} of {count}", len(done) / count)
        for outcome in self._examined(left) if left else ():
            done[outcome.name] = outcome
            if self._results is not None:
                keep(outcome, keys[outcome.name], self._results)
            progress(f"{len(done)} of {count}: {outcome.name}", len(done) / count)
        return [done[each.name] for each in self._submissions]

    def _key(self, submission: Submission) -> str:
        """What an outcome depends on."""
        asked = self._asked
        words = json.dumps(
            [submission.digest, submission.where, asked.arguments, asked.memory_mib, software()]
        )
        return hashlib.sha256(words.encode()).hexdigest()

    def _examined(self, submissions: Sequence[Submission]) -> Iterator[Outcome]:
        where = {each.name: str(each.where) for each in submissions}
        asked = {
            "submissions": list(where.items()),
            "folder": str(self._folder),
            "workers": cores(),
            "check": self._asked.arguments,
            **_in_all(self._asked.time_limit)._asdict(),
            "memory_mib": self._asked.memory_mib,
        }
        start = (
            f"import os, sys; sys.path[:] = {sys.path!r}\n"
            # XLA reads this for the number of its threads; there is a process for each processor.
            f"os.environ['NPROC'] = '1'\n{_CODE}"
        )
        self._process = subprocess.Popen(
            [sys.executable, "-c", start],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            # Ctrl-C is for this process.
            start_new_session=True,
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps(asked).encode() + b"\n")
        self._process.stdin.flush()
        for line in self._process.stdout:
            event = json.loads(line)
            name = event["name"]
            yield self._outcome(name, where.pop(name), event)
        self.end()
        if where:
            raise RopeodeError(
                f"the process that checks submissions ended before {len(where)} of them were "
                f"done. Fix: run the command again; with -o DIR, what is done is kept."
            )

    def _outcome(self, name: str, where: str, event: Mapping[str, Any]) -> Outcome:
        asked, limit = self._asked, event["limit"]
        if event["outcome"] is not None:
            return Outcome(**event["outcome"])
        during = f", during {event['during']!r}" if event["during"] else ""
        in_all = _in_all(asked.time_limit)
        limits = {
            "processor": f"within {in_all.processor_s} s of processor time",
            "wall": f"within {in_all.wall_s:g} s",
            "memory": f"with {asked.memory_mib:g} MiB of memory",
        }
        if limit:
            status = "out of memory" if limit == "memory" else "out of time"
            error = RopeodeError(f"it did not finish {limits[limit]}{during}")
            return without_report(name, status, error, self._folder)
        report = cut_off(where, asked.claims, self._checks, event["how"], event["during"])
        return outcome_of(name, report, "crashed")
