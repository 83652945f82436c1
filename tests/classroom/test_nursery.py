"""What a submission does to its process reaches no other, and what is done is not done again."""

from __future__ import annotations

import contextlib
import dataclasses
import gc
import json
import os
import signal
import tempfile
import time
import warnings

import pytest

from ropeode.classroom import Asked, Class, Steppers, Submission, Trajectories
from ropeode.errors import RopeodeError
from ropeode.sandbox import MEBIBYTE, Limits


@dataclasses.dataclass(frozen=True)
class Harm(Asked):
    """Runs the code of a submission, without a check, which takes longer than what is tested."""

    refused, ahead = "refused", ()
    limits = Limits(cpu=1.0, wall=8.0, memory=100.0 * MEBIBYTE)

    def report(self, where, folder, scratch, say):
        say("harm")
        exec(where[0], {"os": os, "signal": signal, "time": time})
        raise RopeodeError(f"it lives, in {len(os.listdir())} files")


FORGED = json.dumps({"name": "forges", "status": "checked", "verdict": "right"})
SAYS = "for n in range(3, 99):\n try: os.write(n, {!r})\n except OSError: pass\n"
LIVES = ("raised", "it lives, in 0 files")
# The line to the guard, which nobody finds who does not look for it.
LINE = "from ropeode import sandbox\nline = sandbox._this.stream\n"
# What is no report, though a process says it of itself.
NO_REPORTS = (
    FORGED.replace("}", f', "order": 1{"0" * 400}}}'),
    FORGED.replace("}", ', "page": "<script>"}'),
    FORGED.replace("}", ', "report": [["Drawing", ["<svg>"]]]}'),
    "\udcff",
)


def says(report):
    return f"{LINE}line.send(b'r', {report.encode(errors='surrogateescape')!r})\nos._exit(0)"


# By the harm: the status of the submission, and what the message says.
HARM = {
    "import builtins, numpy\nbuiltins.left = open('left', 'w')\nnumpy.sum = None": (
        *("raised", "it lives, in 1 files"),
    ),
    "os.fork()\nwhile True: pass": ("out of time", "within 1 s of processor time, during 'harm'"),
    # What it starts counts too, but what they share counts once. And no more than needed: taking
    # memory costs processor time, of which it has a second.
    "if os.fork() == 0: hoard = bytearray(2**27)\ntime.sleep(1000)": (
        *("out of memory", "it needed more than 100 MiB of memory, during 'harm'"),
    ),
    "for _ in range(3):\n if os.fork() == 0: time.sleep(1000)\ntime.sleep(0.5)": LIVES,
    # A signal takes its time.
    "os.kill(os.getppid(), signal.SIGKILL)\ntime.sleep(3)": ("crashed", "killed its parent"),
    "with open(f'/proc/{os.getppid()}/stat') as stat:\n"
    " os.kill(int(stat.read().split()[3]), signal.SIGKILL)\ntime.sleep(3)": (
        *("crashed", "it ended the process that guards it"),
    ),
    "os.kill(0, signal.SIGKILL)": ("crashed", "killed its parent process (SIGKILL)"),
    # What it writes wherever it can is not taken for a report, nor listened to for ever.
    SAYS.format(b"\n" + FORGED.encode() + b"\n"): LIVES,
    SAYS.format(b"x" * 2**20).replace("try: ", "try:\n  while True: "): ("out of time", "within"),
    # Half a report.
    f"{LINE}line.line.sendall(line.packed(b'r', b'{{}}')[:-1])\nos._exit(7)": (
        *("crashed", "it ended its process (exit code 7), during 'harm'"),
    ),
    # What stays in a session of its own keeps nobody waiting.
    "if os.fork() == 0:\n os.setsid()\n time.sleep(1000)": LIVES,
    says(FORGED): ("checked", ""),
    **dict.fromkeys(map(says, NO_REPORTS), ("crashed", "")),
    # What begins when the others have done what they do, finds nothing of it.
    "import builtins, numpy\nassert numpy.sum([2]) == 2 and not hasattr(builtins, 'left')": LIVES,
}


def test_harm_reaches_no_other(tmp_path, monkeypatch):
    """Whatever a submission's process does or says, it has an outcome, and nothing is left."""
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(scratch))

    submissions = [Submission(str(n), (harm,), "", "") for n, harm in enumerate(HARM)]
    outcomes = Class(tmp_path, submissions, Harm(300.0), None).outcomes(lambda *_: None)
    # Nobody can speak for another one.
    assert [each.name for each in outcomes] == [each.name for each in submissions]
    for (harm, (status, words)), outcome in zip(HARM.items(), outcomes, strict=True):
        assert (outcome.status, words in outcome.message) == (status, True), (harm, outcome)
    assert not list(scratch.iterdir())


@pytest.fixture
def nothing_is_said(capfd, monkeypatch):
    """Python warns of each pipe that it has to close itself, and of forks where threads run.

    JAX warns of these too: nothing may have begun in the process from which others are forked.
    """
    monkeypatch.setenv("PYTHONWARNINGS", "always:This process:DeprecationWarning")
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        yield
        gc.collect()
    assert not [str(each.message) for each in seen]
    assert capfd.readouterr().err == ""


class Stop(Exception):
    """Raised before anything is examined."""


def done_before(own):
    """The part of a class of which the outcome is kept."""

    def stop(text, fraction):
        found.append(fraction)
        if fraction < 1.0:
            raise Stop

    found = []
    with contextlib.suppress(Stop):
        own.outcomes(stop)
    return found[0]


def test_what_is_done_is_kept_for_the_same_question(tmp_path, nothing_is_said):
    anna, bert = (Submission(name, (f"{name}.py",), "", "one") for name in ("anna", "bert"))
    carla = Submission("carla", (), "there is no Python file", "one")
    for name in ("anna", "bert"):
        (tmp_path / f"{name}.py").write_text("def\n")
    results = tmp_path / "results"

    def of(first=anna, memory=2000.0, **check):
        asked = Steppers(memory, {"time_limit": 60.0, **check})
        return Class(tmp_path, [first, bert, carla], asked, results)

    statuses = [each.status for each in of().outcomes(lambda *_: None)]
    assert statuses == ["syntax error", "syntax error", "no stepper"]
    assert done_before(of()) == 1.0
    # One has another file, or another place in it; the question is another one.
    for other in ({"digest": "two"}, {"where": ("anna.py:verlet",)}):
        assert done_before(of(anna._replace(**other))) == 2 / 3
    for changed in ({"memory": 1999.0}, {"quick": True}):
        assert done_before(of(**changed)) == 1 / 3
    forged = json.loads((results / "anna.json").read_text())
    forged["outcome"]["order"] = "high"
    for damaged in ("", "{", json.dumps(forged), "[" * 100_000):
        (results / "anna.json").write_text(damaged)
        assert done_before(of()) == 2 / 3


@pytest.mark.slow
def test_nothing_stays_open(tmp_path, nothing_is_said):
    (tmp_path / "a.csv").touch()
    asked = Trajectories(
        2000.0, values={}, folder=".", arguments={"dts": None}, truth="", time_limit=60.0
    )
    own = Class(tmp_path, [Submission("a", ("a.csv",), "", "")], asked, None)
    assert [each.status for each in own.outcomes(lambda *_: None)] == ["refused"]
