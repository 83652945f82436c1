"""Examines the submissions of a folder, some at a time, and keeps what is done."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from ropeode.cache import software
from ropeode.classroom.asked import Asked
from ropeode.classroom.examination import outcome_of, without_report
from ropeode.classroom.outcome import Outcome, Status, from_json, keep, kept
from ropeode.classroom.submissions import Submission
from ropeode.classroom.trajectories import REFERENCE
from ropeode.errors import RopeodeError
from ropeode.files import make_folder
from ropeode.progress import Progress
from ropeode.references.files.store import save_reference
from ropeode.references.reference import Reference
from ropeode.threads import cores

_ENDS_IN_S = 5.0


class Class:
    """The submissions of a folder, and the process from which theirs are forked.

    Arguments:
        folder: of the submissions.
        submissions: in it.
        asked: of each.
        results: a folder that keeps what is done; None to keep nothing.
        reference: that all submissions share; None where they need none.
    """

    def __init__(
        self,
        folder: Path,
        submissions: Sequence[Submission],
        asked: Asked,
        results: Path | None,
        reference: Reference | None = None,
    ) -> None:
        self._folder, self.submissions = folder.resolve(), submissions
        self._asked, self._reference = asked, reference
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
        keys = {each.name: self._key(each) for each in self.submissions}
        if self._results is not None:
            for name, key in keys.items():
                if (outcome := kept(name, key, self._results)) is not None:
                    done[name] = outcome
        for each in self.submissions:
            if not each.where:
                done[each.name] = without_report(
                    each.name, self._asked.refused, RopeodeError(each.trouble), self._folder
                )
        left = [each for each in self.submissions if each.name not in done]
        count = len(self.submissions)
        progress(f"{len(done)} of {count}", len(done) / count)
        for outcome in self._examined(left) if left else ():
            done[outcome.name] = outcome
            if self._results is not None:
                keep(outcome, keys[outcome.name], self._results)
            progress(f"{len(done)} of {count}: {outcome.name}", len(done) / count)
        return [done[each.name] for each in self.submissions]

    def _key(self, submission: Submission) -> str:
        """What an outcome depends on."""
        asked = [type(self._asked).__name__, dataclasses.asdict(self._asked)]
        words = json.dumps([submission.digest, submission.where, asked, software()])
        return hashlib.sha256(words.encode()).hexdigest()

    def _examined(self, submissions: Sequence[Submission]) -> Iterator[Outcome]:
        where = {each.name: each.where for each in submissions}
        # The process that is started removes it.
        scratch = tempfile.mkdtemp(prefix="ropeode-")
        if self._reference is not None:
            save_reference(self._reference, Path(scratch) / REFERENCE)
        told = {
            "kind": [type(self._asked).__module__, type(self._asked).__qualname__],
            "asked": dataclasses.asdict(self._asked),
            "submissions": list(where.items()),
            "folder": str(self._folder),
            "scratch": scratch,
            "workers": cores(),
        }
        start = (
            f"import os, sys; sys.path[:] = {sys.path!r}\n"
            # XLA reads this for the number of its threads; there is a process for each processor.
            "os.environ['NPROC'] = '1'\n"
            "from ropeode.classroom.nursery import main; main()"
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
        self._process.stdin.write(json.dumps(told).encode() + b"\n")
        self._process.stdin.flush()
        with self._process.stdout as lines:
            for line in lines:
                event = json.loads(line)
                name = event["name"]
                yield self._outcome(name, where.pop(name), event)
        self.end()
        if where:
            raise RopeodeError(
                f"the process that checks submissions ended before {len(where)} of them were "
                f"done. Fix: run the command again; with -o DIR, what is done is kept."
            )

    def _outcome(self, name: str, where: Sequence[str], event: Mapping[str, Any]) -> Outcome:
        if event["outcome"] is not None:
            if (outcome := from_json(event["outcome"])) is not None:
                # Whatever it says of itself, it is this one's.
                return dataclasses.replace(outcome, name=name)
            error = RopeodeError("its process wrote something in place of its report")
            return without_report(name, "crashed", error, self._folder)
        during = f", during {event['during']!r}" if event["during"] else ""
        limits = self._asked.limits
        words = {
            "processor": f"within {limits.processor_s} s of processor time",
            "wall": f"within {limits.wall_s:g} s",
            "memory": f"with {limits.memory_mib:g} MiB of memory",
            "report": "without a flood of words in place of its report",
        }
        if limit := event["limit"]:
            known: dict[str, Status] = {"memory": "out of memory", "report": "crashed"}
            error = RopeodeError(f"it did not finish {words[limit]}{during}")
            return without_report(name, known.get(limit, "out of time"), error, self._folder)
        report = self._asked.cut_off(where, event["how"], event["during"])
        if report is None:
            error = RopeodeError(f"its process {event['how']}{during}")
            return without_report(name, "crashed", error, self._folder)
        return outcome_of(name, report, "crashed")
