"""Examines the submissions of a folder, some at a time, and keeps what is done."""

from __future__ import annotations

import atexit
import dataclasses
import gc
import hashlib
import importlib
import json
import os
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

from ropeode.cache import set_up_jax, software
from ropeode.classroom.examination import Asked, examined, outcome_of, without_report
from ropeode.classroom.outcome import Outcome, Status, as_json, from_json, keep, kept
from ropeode.classroom.submissions import Submission
from ropeode.classroom.trajectories import REFERENCE
from ropeode.errors import RopeodeError
from ropeode.files import make_folder
from ropeode.progress import Progress
from ropeode.references import Reference, save_reference
from ropeode.sandbox import Child, Ended, GuardLost, Nursery, doing
from ropeode.threads import cores, use_cores


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
        self._nursery: Nursery | None = None
        if results is not None:
            make_folder(results)

    def end(self) -> None:
        """End all processes; nothing where there are none."""
        if self._nursery is not None:
            self._nursery.end()

    def outcomes(self, progress: Progress) -> list[Outcome]:
        """What became of each submission, in their order.

        Arguments:
            progress: is called with the submission that was done last, and the fraction.

        Raises:
            RopeodeError: something else has ended the processes that check them.
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
        scratch = Path(tempfile.mkdtemp(prefix="ropeode-"))
        if self._reference is not None:
            save_reference(self._reference, scratch / REFERENCE)
        self._nursery = nursery = Nursery(_prepare, self._asked.ahead, scratch)
        with ThreadPoolExecutor(cores()) as pool, nursery:
            jobs = [pool.submit(self._outcome, each, scratch, nursery) for each in submissions]
            try:
                for done in as_completed(jobs):
                    yield done.result()
            finally:
                pool.shutdown(wait=False, cancel_futures=True)

    def _outcome(self, submission: Submission, scratch: Path, nursery: Nursery) -> Outcome:
        name, where, asked = submission.name, submission.where, self._asked
        with Child(
            *(_examine, name, where, self._folder, asked, scratch),
            limits=asked.limits,
            quiet=True,
            nursery=nursery,
        ) as child:
            try:
                ended = child.wait()
            except GuardLost:
                if nursery.has_ended:
                    raise
                ended = Ended("ended the process that guards it", child.during)
        if ended.result is not None:
            if (outcome := from_json(ended.result)) is not None:
                # Whatever it says of itself, it is this one's.
                return dataclasses.replace(outcome, name=name)
            error = RopeodeError("its process wrote something in place of its report")
            return without_report(name, "crashed", error, self._folder)
        report = None if ended.limit else asked.cut_off(where, ended.how, ended.during)
        if report is not None:
            return outcome_of(name, report, "crashed")
        status: Status = "out of time" if ended.limit else "crashed"
        if ended.limit == "memory":
            status = "out of memory"
        during = f", during {ended.during!r}" if ended.during else ""
        error = RopeodeError(f"it {ended.how}{during}")
        return without_report(name, status, error, self._folder)


def _prepare(ahead: Sequence[str], scratch: Path) -> None:
    """Prepare the process from which those of submissions are forked: it imports what they need."""
    # Whatever becomes of the process that has made it.
    atexit.register(shutil.rmtree, scratch, ignore_errors=True)
    # XLA reads this for the number of its threads; there is a process for each processor.
    os.environ["NPROC"] = "1"
    set_up_jax()
    for module in ahead:
        importlib.import_module(module)
    use_cores(1)
    gc.collect()
    # What is imported stays: to look for garbage in it takes long, in each process.
    gc.freeze()


def _examine(name: str, where: Sequence[str], folder: Path, asked: Asked, scratch: Path) -> bytes:
    """What becomes of a submission, in its own process with a working directory of its own."""
    os.chdir(tempfile.mkdtemp(dir=scratch))
    return as_json(examined(name, where, folder, asked, scratch, doing))
