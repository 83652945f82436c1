"""What a submission does to its process reaches no other, and what is done is not done again."""

from __future__ import annotations

import contextlib
import gc
import json
import sys
import tempfile
import warnings

from ropeode.classroom import Class, Steppers, Submission, Trajectories
from tests.classroom.harm import Harm

FORGED = json.dumps({"name": "forges", "status": "checked", "verdict": "right"})
SAYS = "for n in range(3, 99):\n try: os.write(n, {!r})\n except OSError: pass\n"
LIVES = ("raised", "it lives, in 0 files")
# The line to the guard, which nobody finds who does not look for it.
LINE = "from ropeode import sandbox\nline = sandbox._this.stream\n"
# By the harm: the status of the submission, and what the message says.
HARM = {
    "pass": LIVES,
    "open('left', 'w')": ("raised", "it lives, in 1 files"),
    "for n in range(3, 99):\n try: os.write(n, b'[1]\\n{')\n except OSError: pass": LIVES,
    "while True: pass": ("out of time", "within 1 s of processor time, during 'harm'"),
    "os.fork()\nwhile True: pass": ("out of time", "within 1 s of processor time, during 'harm'"),
    "time.sleep(1000)": ("out of time", "within 8 s, during 'harm'"),
    # No more than needed: taking memory costs processor time, of which it has a second.
    "hoard = bytearray(5 * 2**26)\ntime.sleep(1000)": ("out of memory", "more than 300 MiB"),
    # What it starts counts too, but what they share counts once.
    "if os.fork() == 0: hoard = bytearray(5 * 2**26)\ntime.sleep(1000)": (
        *("out of memory", "it needed more than 300 MiB of memory, during 'harm'"),
    ),
    "for _ in range(3):\n if os.fork() == 0: time.sleep(1000)\ntime.sleep(0.5)": LIVES,
    "os._exit(7)": ("crashed", "ended its process (exit code 7), during 'harm'"),
    "os.kill(os.getpid(), signal.SIGSEGV)": ("crashed", "ended its process (SIGSEGV)"),
    # A signal takes its time.
    "os.kill(os.getppid(), signal.SIGKILL)\ntime.sleep(3)": ("crashed", "killed its parent"),
    "with open(f'/proc/{os.getppid()}/stat') as stat:\n"
    " os.kill(int(stat.read().split()[3]), signal.SIGKILL)\ntime.sleep(3)": (
        *("crashed", "it ended the process that guards it, during 'harm'"),
    ),
    "os.kill(0, signal.SIGKILL)": ("crashed", "killed its parent process (SIGKILL)"),
    # What it writes wherever it can is not taken for a report, nor listened to for ever.
    SAYS.format(b"\n" + FORGED.encode() + b"\n"): LIVES,
    SAYS.format(b"x" * 2**20).replace("try: ", "try:\n  while True: "): ("out of time", "within"),
    # Half a report.
    f"{LINE}line.line.sendall(line.packed(b'r', b'{{}}')[:-1])\nos._exit(7)": (
        *("crashed", "it ended its process (exit code 7)"),
    ),
    "if os.fork() == 0:\n os.setsid()\n STAYS\nWAIT": LIVES,
    # The one that it leaves has begun before it is an orphan, which is ended at once.
    "if os.fork() == 0:\n os.setsid()\n if os.fork() == 0:\n  STAYS\n WAIT\n os._exit(0)\nWAIT": (
        LIVES
    ),
    "os.setsid()\nif os.fork() == 0:\n STAYS\nWAIT\nos._exit(7)": ("crashed", "(exit code 7)"),
}
# What a process says of itself, and ends: a whole report, half a one, none.
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


def says(report):
    return f"{LINE}line.send(b'r', {report.encode(errors='surrogateescape')!r})\nos._exit(0)"


def test_harm_reaches_no_other(tmp_path, monkeypatch):
    """Whatever a submission's process does or says, it has an outcome, and nothing is left."""
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(scratch))

    def code(n, harm):
        """STAYS leaves a process, and WAIT waits until that has begun."""
        file = repr(str(tmp_path / f"pid-{n}"))
        stays = f"os.symlink(str(os.getpid()), {file}); time.sleep(1000)"
        wait = f"while not os.path.lexists({file}): time.sleep(0.01)"
        return harm.replace("STAYS", stays).replace("WAIT", wait)

    # The last one begins when the others have done what they do.
    everything = [*HARM, *map(says, REPORTS), "pass"]
    submissions = [
        Submission(str(n), (code(n, harm),), "", "") for n, harm in enumerate(everything)
    ]
    outcomes = Class(tmp_path, submissions, Harm(300.0), None).outcomes(lambda *_: None)
    # Nobody can speak for another one.
    assert [each.name for each in outcomes] == [each.name for each in submissions]
    *harmed, last = outcomes
    for (harm, (status, words)), outcome in zip(HARM.items(), harmed, strict=False):
        assert (outcome.status, words in outcome.message) == (status, True), (harm, outcome)
    said = [outcome.status for outcome in harmed[len(HARM) :]]
    assert dict(zip(REPORTS, said, strict=True)) == REPORTS
    # What another one has written is in a folder of its own.
    assert (last.status, last.message) == LIVES
    assert not list(scratch.iterdir())
    left = [each.readlink() for each in tmp_path.glob("pid-*")]
    assert len(left) == 3
    if sys.platform == "linux":
        assert not [each for each in left if ("/proc" / each).exists()]


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


def test_what_is_done_is_kept_for_the_same_question(tmp_path, capfd, monkeypatch):
    """And nothing had begun in the process from which those of the submissions are forked."""
    # Python and JAX warn where threads run.
    monkeypatch.setenv("PYTHONWARNINGS", "always:This process:DeprecationWarning")
    submissions = [Submission(name, (f"{name}.py",), "", "one") for name in ("anna", "bert")]
    submissions.append(Submission("carla", (), "there is no Python file", "one"))
    for name in ("anna", "bert"):
        (tmp_path / f"{name}.py").write_text("def\n")
    results = tmp_path / "results"

    def of(submissions=submissions, memory=2000.0, **check):
        asked = Steppers(memory, {"time_limit": 60.0, **check})
        return Class(tmp_path, submissions, asked, results)

    statuses = [each.status for each in of().outcomes(lambda *_: None)]
    assert statuses == ["syntax error", "syntax error", "no stepper"]
    assert capfd.readouterr().err == ""
    assert done_before(of()) == 1.0
    # One has another file, or another place in it; the question is another one.
    two = [submissions[0], submissions[1]._replace(digest="two"), submissions[2]]
    assert done_before(of(two)) == 2 / 3
    where = [submissions[0]._replace(where=("anna.py:verlet",)), *submissions[1:]]
    assert done_before(of(where)) == 2 / 3
    for changed in ({"memory": 1999.0}, {"quick": True}):
        assert done_before(of(**changed)) == 1 / 3
    forged = json.loads((results / "anna.json").read_text())
    forged["outcome"]["order"] = "high"
    for damaged in ("{", json.dumps(forged), "[" * 100_000):
        (results / "anna.json").write_text(damaged)
        assert done_before(of()) == 2 / 3
    (results / "anna.json").unlink()
    assert done_before(of()) == 2 / 3


def test_nothing_stays_open(tmp_path, capfd, monkeypatch):
    """Python warns of each pipe that it has to close itself; and of forks, as above."""
    monkeypatch.setenv("PYTHONWARNINGS", "always:This process:DeprecationWarning")
    (tmp_path / "a.csv").touch()
    asked = Trajectories(
        2000.0, values={}, folder=".", arguments={"dts": None}, truth="", time_limit=60.0
    )
    own = Class(tmp_path, [Submission("a", ("a.csv",), "", "")], asked, None)
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        assert [each.status for each in own.outcomes(lambda *_: None)] == ["refused"]
        del own
        gc.collect()
    assert not [str(each.message) for each in seen]
    assert capfd.readouterr().err == ""
