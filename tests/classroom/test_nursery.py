"""What a submission does to its process reaches no other, and what is done is not done again."""

from __future__ import annotations

import gc
import json
import shutil
import subprocess
import sys
import warnings

import pytest

from ropeode.classroom import running
from ropeode.classroom.outcome import Outcome, from_json
from ropeode.classroom.running import Class
from ropeode.classroom.steppers import Steppers
from ropeode.classroom.submissions import Submission

# Without checks, which take longer than what is tested here.
NURSERY = """
import os, signal, time
from ropeode.classroom import nursery
from ropeode.classroom.asked import Asked, Limits
from ropeode.errors import RopeodeError

class Harm(Asked):
    refused, ahead = "refused", ()
    limits = Limits(1, 8.0, 300.0)

    def report(self, where, folder, scratch, say):
        say("harm")
        exec(where[0])
        raise RopeodeError(f"it lives, in {len(os.listdir())} files")

nursery._KINDS["Harm"] = Harm
nursery.main()
"""
FORGED = json.dumps({"name": "forges", "status": "checked", "verdict": "right"})
SAYS = "for n in range(3, 99):\n try: os.write(n, {!r})\n except OSError: pass\n"
# By the harm: the limit that it breaks, or how its process ended; or that it has its outcome.
HARM = {
    "pass": "raised",
    "open('left', 'w')": "raised",
    "for n in range(3, 99):\n try: os.write(n, b'[1]\\n{')\n except OSError: pass": "raised",
    "while True: pass": "processor",
    "time.sleep(1000)": "wall",
    # No more than needed: taking memory costs processor time, of which it has a second.
    "hoard = bytearray(5 * 2**26)\ntime.sleep(1000)": "memory",
    "os._exit(7)": "ended its process (exit code 7)",
    "os.kill(os.getpid(), signal.SIGSEGV)": "ended its process (SIGSEGV)",
    # A signal takes its time.
    "os.kill(os.getppid(), signal.SIGKILL)\ntime.sleep(3)": "killed its parent process (SIGKILL)",
    "os.kill(0, signal.SIGKILL)": "killed its parent process (SIGKILL)",
    # Whatever it says of itself.
    SAYS.format(b"\noutcome " + FORGED.encode() + b"\n")
    + "os.kill(os.getppid(), signal.SIGKILL)\ntime.sleep(3)": "killed its parent process (SIGKILL)",
    # It may not be listened to for ever, and neither may what it leaves.
    SAYS.format(b"x" * 2**20).replace("try: ", "try:\n  while True: "): "report",
    "if os.fork() == 0:\n os.setsid()\n STAYS\nWAIT": "raised",
    # The one that it leaves has begun before it is an orphan, which is ended at once.
    "if os.fork() == 0:\n os.setsid()\n if os.fork() == 0:\n  STAYS\n WAIT\n os._exit(0)\nWAIT": (
        "raised"
    ),
    "os.setsid()\nif os.fork() == 0:\n STAYS\nWAIT\nos._exit(7)": "ended its process (exit code 7)",
}
# By what is in the line of a report: a whole report, half a one, none.
REPORTS = {
    FORGED: "checked",
    FORGED[:-9]: "crashed",
    FORGED.replace("right", "<b>"): "crashed",
    json.dumps({**json.loads(FORGED), "order": 10**400}): "crashed",
    json.dumps({**json.loads(FORGED), "page": "<script>"}): "crashed",
    json.dumps({**json.loads(FORGED), "report": [["Drawing", ["<svg>"]]]}): "crashed",
    "[" * 100_000: "crashed",
    "\udcff": "crashed",
    "3": "crashed",
}


def test_harm_reaches_no_other(tmp_path):
    scratch = tmp_path / "scratch"
    scratch.mkdir()

    def harmed(n, harm):
        """Its code: STAYS leaves a process, and WAIT waits until that has begun."""
        file = repr(str(tmp_path / f"pid-{n}"))
        stays = f"os.symlink(str(os.getpid()), {file}); time.sleep(1000)"
        wait = f"while not os.path.lexists({file}): time.sleep(0.01)"
        return harm.replace("STAYS", stays).replace("WAIT", wait)

    told = {
        "kind": "Harm",
        "asked": {"memory_mib": 300.0},
        # The last one begins when the others have done what they do.
        "submissions": [
            *((harm, [harmed(n, harm)]) for n, harm in enumerate(HARM)),
            ("last", ["pass"]),
        ],
        "folder": str(tmp_path),
        "scratch": str(scratch),
        "workers": 4,
    }
    command = [sys.executable, "-c", NURSERY]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(json.dumps(told) + "\n")
        process.stdin.flush()
        events = {each["name"]: each for each in map(json.loads, process.stdout)}
    found = {
        name: (of(event) and of(event).status) or event["limit"] or event["how"]
        for name, event in events.items()
    }
    assert found == {**HARM, "last": "raised"}
    # What another one has written is in a folder of its own.
    assert of(events["last"]).message == "it lives, in 0 files"
    assert all(event["during"] == "harm" for event in events.values())
    assert not scratch.exists()
    left = [each.readlink() for each in tmp_path.glob("pid-*")]
    assert len(left) == 3
    if sys.platform == "linux":
        assert not [each for each in left if ("/proc" / each).exists()]


def of(event):
    return event["outcome"] and from_json(event["outcome"])


@pytest.mark.parametrize("said", REPORTS)
def test_a_report_is_one_or_none(tmp_path, monkeypatch, said):
    """Whatever a submission's process says, it has an outcome, and it has no other's name."""
    event = {"name": "a", "outcome": said, "how": "", "limit": "", "during": ""}
    monkeypatch.setattr(running, "_CODE", f"input(); print({json.dumps(event)!r})")
    own = Class(tmp_path, [Submission("a", ("a.py",), "", "")], Steppers(100.0, {}), tmp_path)
    (outcome,) = own.outcomes(lambda *_: None)
    assert (outcome.name, outcome.status) == ("a", REPORTS[said])


@pytest.fixture
def examined(monkeypatch):
    """The names of submissions that were examined; nothing is done with them."""
    names = []

    def instead(self, submissions):
        for each in submissions:
            names.append(each.name)
            yield Outcome(each.name, "checked", "right")

    monkeypatch.setattr(Class, "_examined", instead)
    return names


def test_what_is_done_is_kept_for_the_same_question(tmp_path, examined):
    submissions = [Submission(name, (f"{name}.py",), "", "one") for name in ("anna", "bert")]
    submissions.append(Submission("carla", (), "there is no Python file", "one"))

    def outcomes(submissions=submissions, memory=1.0, **check):
        examined.clear()
        own = Class(tmp_path, submissions, Steppers(memory, check), tmp_path / "results")
        return {each.name: each.status for each in own.outcomes(lambda text, done: None)}

    assert outcomes() == {"anna": "checked", "bert": "checked", "carla": "no stepper"}
    assert examined == ["anna", "bert"]
    assert outcomes()["anna"] == "checked"
    assert examined == []
    outcomes([submissions[0], submissions[1]._replace(digest="two")])
    assert examined == ["bert"]
    outcomes([submissions[0]._replace(where=("anna.py:verlet",))])
    assert examined == ["anna"]
    for changed in ({"memory": 2.0}, {"quick": True}):
        outcomes(**changed)
        assert examined == ["anna", "bert"]
    shutil.rmtree(tmp_path / "results")
    outcomes()
    assert examined == ["anna", "bert"]


def test_nothing_stays_open(tmp_path, monkeypatch):
    """Python warns of each pipe that it has to close itself."""
    event = {"name": "a", "outcome": FORGED}
    monkeypatch.setattr(running, "_CODE", f"input(); print({json.dumps(event)!r})")
    own = Class(tmp_path, [Submission("a", ("a.py",), "", "")], Steppers(100.0, {}), None)
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        assert [each.status for each in own.outcomes(lambda *_: None)] == ["checked"]
        del own
        gc.collect()
    assert not [str(each.message) for each in seen]
