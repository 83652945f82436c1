"""The command line, as a user meets it."""

from __future__ import annotations

import io
import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import click
import pytest

from ropeode.cli import cli, run_command
from ropeode.errors import UserCodeError, streams_kept
from ropeode.references import entries
from ropeode.steppers import STEPPERS
from tests.cli.conftest import interrupted
from tests.time_limit import HANGS_AFTER_S, until

# The rope of `small_rope`: what it compiles serves many tests.
SMALL = ["--num-nodes", "4", "--frames", "3"]
QUICK = ["table", *SMALL, "--steppers", "rk4", "--steps", "16,32,64"]


def test_help_and_completion_import_nothing_that_computes(environment):
    code = (
        "import sys\n"
        "from click.shell_completion import BashComplete\n"
        "from ropeode.cli import cli\n"
        "from tests.cli.conftest import commands\n"
        "for path in commands(cli):\n"
        "    try: cli.main([*path, '--help'], standalone_mode=False)\n"
        "    except SystemExit: pass\n"
        "complete = BashComplete(cli, {}, 'ropeode', '_ROPEODE_COMPLETE').get_completions\n"
        "for words, begun in ([], 'tab'), (['sweep'], 'r'), (['table'], '--no-c'):\n"
        "    print('COMPLETED', *sorted(each.value for each in complete(words, begun)))\n"
        "heavy = {'jax', 'numpy', 'scipy', 'matplotlib'}\n"
        "print(heavy & set(sys.modules), file=sys.stderr)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment
    )
    assert done.stderr == "set()\n"
    *lines, top, group, option = done.stdout.splitlines()
    assert (top, group, option) == ("COMPLETED table", "COMPLETED r run", "COMPLETED --no-code")
    assert lines[0].startswith("Usage: ")
    assert max(map(len, lines)) <= 80


def test_table_out_and_format(run, tmp_path):
    done = run(*QUICK)
    assert (done.returncode, done.stderr) == (0, "")
    assert "  converges" in done.stdout
    assert "Reference: diffrax Dopri8" in done.stdout
    for name, form in [("a.json", []), ("b.txt", ["--format", "json"])]:
        done = run(*QUICK, "--out", name, *form)
        assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
        assert json.loads((tmp_path / name).read_text())["schema"] == "ropeode.accuracy-table/1"
    assert sorted(os.listdir(tmp_path)) == ["a.json", "b.txt"]


def test_spec_file_with_options_on_top(run, tmp_path):
    """Where a spec stands, or a problem."""
    assert run("spec", "--out", "mine.toml").returncode == 0
    assert run("spec").stdout == (tmp_path / "mine.toml").read_text()
    for spec in (["mine.toml"], ["--problem", "mine.toml"]):
        done = run("table", *spec, *QUICK[1:], "--damping", "0.5", "--format", "json")
        assert done.returncode == 0, done.stderr
        problem = json.loads(done.stdout)["problem"]
        assert (problem["frames"], problem["parameters"]["damping"]) == (3, 0.5)


# As they are typed, and what they mean.
ROPE_OPTIONS = {
    "frames": ("3", 3),
    "start": ("0,0,0", [0, 0, 0]),
    "end": ("-3,1,0", [-3, 1, 0]),
    "num_nodes": ("3", 3),
    "node_mass": ("1,2,3", [1, 2, 3]),
    "stiffness": ("4,5", [4, 5]),
    "pinned": ("1", [1]),
    "gravity": ("0,0,-2", [0, 0, -2]),
    "damping": ("0,0.1,0.2", [0, 0.1, 0.2]),
}
VELOCITIES = [("1,2,0", [1, 2, 0]), ("1,0,0;0,0,0;0,-1,3", [[1, 0, 0], [0, 0, 0], [0, -1, 3]])]


@pytest.mark.parametrize(("text", "velocity"), VELOCITIES)
def test_every_rope_option(table_job, text, velocity):
    """What would be computed; computing it takes seconds and shows no more of the options."""
    options = {**ROPE_OPTIONS, "initial_velocity": (text, velocity)}
    typed = [f"--{name.replace('_', '-')}={text}" for name, (text, _) in options.items()]
    others = ["--steps=8,12,18", "--norm=velocity-rms", "--accuracy=1e-5", "--rtol=1e-10"]
    job = table_job(*typed, *others)
    parameters = json.loads(json.dumps(dict(job.problem.parameters)))
    assert parameters == {"kind": "rope", **{name: value for name, (_, value) in options.items()}}
    assert job.spec.steps_per_frame == (8, 12, 18)
    assert (job.spec.norm, job.spec.rtol, job.spec.accuracy) == ("velocity-rms", 1e-10, 1e-5)


NONSENSE = """
from ropeode import Problem
def rhs(t, y, args):
    return helper(y)
def helper(y):
    return y.nonsense
problem = Problem(rhs, [1.0], [0.0, 1.0])
"""


def test_users_traceback_is_shown_and_that_of_ropeode_if_asked_for(run):
    Path("mine.py").write_text(NONSENSE)
    done = run("table", "--problem", "mine.py:problem")
    assert done.returncode == 2
    assert 'mine.py", line 6, in helper' in done.stderr
    assert "site-packages" not in done.stderr
    assert done.stderr.splitlines()[-1].startswith("ropeode: rhs: raised AttributeError")
    assert "Traceback" in run("--debug", "table", "--damping", "-1").stderr


def test_no_reference_is_exit_code_1(run):
    done = run(*QUICK, "--accuracy", "1e-30")
    assert done.returncode == 1
    assert done.stderr.startswith("ropeode: no reference for 'rope'")
    assert len(done.stderr.splitlines()) == 1


LONG = "--num-nodes 512 --frames 200"


@pytest.mark.parametrize(
    ("command", "after"),
    [
        (f"table {LONG} --out t.txt", 2.0),
        pytest.param(f"table {LONG}", 0.0, marks=pytest.mark.slow),
        pytest.param(f"table {LONG}", 8.0, marks=pytest.mark.slow),
        pytest.param(f"animate {LONG} --out a.gif", 2.0, marks=pytest.mark.slow),
    ],
)
def test_ctrl_c_ends_cleanly(command, after, started, tmp_path):
    """So many seconds after the process has begun to import JAX."""
    process = started(*command.split())
    maps = Path(f"/proc/{process.pid}/maps")
    until(lambda: "numpy" in maps.read_text())
    time.sleep(after)
    assert interrupted(process) == ("", "ropeode: interrupted; nothing was written.\n", 130)
    assert os.listdir(tmp_path) == []


def test_version_and_steppers(run):
    assert run("--version").stdout.startswith("ropeode ")
    done = run("steppers")
    assert done.returncode == 0
    assert "\nstormer-verlet " in done.stdout
    assert "start=rest,damping=per-step" in run("steppers", "stormer-verlet").stdout


@pytest.mark.slow
def test_report(run, tmp_path):
    pictures = ["--plots", "pictures", "--out", "report.json"]
    done = run("report", "--figures", "4", "--frames", "400", *pictures)
    assert (done.returncode, done.stdout) == (0, "")
    assert done.stderr == "wrote 2 pictures to pictures\n"
    assert sorted(os.listdir(tmp_path / "pictures")) == ["contact-sheet-1.png", "figure-04.png"]
    figures = json.loads((tmp_path / "report.json").read_text())["figures"]
    assert [each["verdict"] for each in figures] == ["holds"]


@pytest.mark.slow
def test_an_interrupted_report_keeps_what_is_finished(environment, started):
    """Figure 4 is done in no time; figure 6, which takes a minute, is interrupted."""
    kept = Path(environment["XDG_CACHE_HOME"]) / "ropeode" / "report"
    process = started("report", "--figures", "4,6", "--frames", "2000")
    until(lambda: list(kept.glob("*/*.npz")))
    words = "finished runs are kept; the same command goes on from there"
    assert interrupted(process) == ("", f"ropeode: interrupted; {words}.\n", 130)
    assert len(list(kept.glob("*/*.npz"))) == 1


def test_the_stored_library(run):
    listed = run("reference", "list")
    assert listed.returncode == 0
    assert all(len(line) <= 80 for line in listed.stdout.splitlines())
    for name in entries():
        assert f"\n{name} " in listed.stdout
    assert "eccentricity 0.9" in " ".join(run("reference", "show", "kepler").stdout.split())
    done = run("table", "--reference", "kepler", "--steppers", "rk4", "--steps", "200,300")
    assert "Reference: heyoka Taylor" in done.stdout


@pytest.mark.slow
def test_references_in_files(run):
    done = run("reference", *SMALL, "-o", "rope.nc")
    assert done.returncode == 0, done.stderr
    assert done.stdout.endswith("wrote rope.nc\n")
    shown = run("reference", "show", "rope.nc").stdout
    assert "SciPy DOP853" in shown
    assert "Estimated error bound" in " ".join(shown.split())
    assert all(len(line) <= 80 for line in shown.splitlines())
    verified = run("reference", "verify", "rope.nc").stdout
    assert verified.count("within the bounds") == 2
    assert "4 of 4 samples" in " ".join(verified.split())

    more = ["--steppers", "rk4", "--steps", "8,12,18", "--format", "json"]
    tables = [run("table", *words, *more).stdout for words in (["--reference", "rope.nc"], SMALL)]
    mine, its = map(json.loads, tables)
    assert [row["error_max"] for row in mine["rows"]] == [row["error_max"] for row in its["rows"]]
    assert mine["problem"] == its["problem"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        # Which errors are predicted is a matter of time.
        f"table --no-predict --steps 8,16,32 --steppers {','.join(STEPPERS)}",
        "table --problem hires --no-predict --steps 8,16 --steppers rk4,gauss4,bdf2",
        "reference compute --problem hires --out a.nc",
    ],
)
def test_three_processes_with_one_cache_say_the_same(
    words, run_process, environment, monkeypatch, tmp_path
):
    """But for the times in the last column of a table."""
    monkeypatch.setitem(environment, "XDG_CACHE_HOME", str(tmp_path))
    said = set()
    for _ in range(3):
        done = run_process(*words.split())
        assert done.returncode == 0, done.stderr
        said.add(re.sub(r" +[\d.e-]+$", "", done.stdout, flags=re.M))
    assert len(said) == 1


@pytest.mark.parametrize(
    ("raised", "code", "says"),
    [
        (MemoryError("Unable to allocate 7.28 TiB"), 2, "memory: Unable to allocate 7.28 TiB"),
        # Exit codes 1 and 2 are verdicts; what is broken in here must not look like one.
        (ZeroDivisionError(), 3, "a fault of ropeode"),
    ],
)
def test_what_a_command_raises_is_told_apart(raised, code, says, monkeypatch, capsys):
    def broken():
        raise raised

    monkeypatch.setitem(cli.commands, "broken", click.Command("broken", callback=broken))
    assert run_command(["broken"]) == code
    error = capsys.readouterr().err
    assert says in error
    assert ("Traceback" in error) == (code == 3)


def test_a_platform_that_is_not_here_is_named(run_process, environment, monkeypatch):
    monkeypatch.setitem(environment, "JAX_PLATFORMS", "xyz")
    done = run_process("table", "--problem", "oscillator", "--frames=1")
    assert done.returncode == 2
    assert done.stderr.startswith("ropeode: JAX_PLATFORMS: 'xyz' given; ")


@pytest.mark.slow
def test_without_a_home_standard_output_is_the_result_alone(run_process, environment, monkeypatch):
    pytest.importorskip("heyoka", reason="heyoka is an extra")
    for name in ("HOME", "XDG_CACHE_HOME"):
        monkeypatch.delitem(environment, name, raising=False)
    words = ("--problem=oscillator", "--frames=1", "--level=extended", "--steps=8,16,32")
    done = run_process("table", *words, "--format=json")
    assert done.stdout.startswith("{"), done.stderr
    assert json.loads(done.stdout)["schema"].startswith("ropeode.accuracy-table")


def test_a_process_says_and_ends_with_what_a_command_does_in_this_process(run, run_process):
    words = ["check", "rk4", "--only", "pin"]
    here, there = run(*words), run_process(*words)
    assert here.returncode == there.returncode == 2
    assert (here.stdout, here.stderr) == (there.stdout, there.stderr)


def test_a_process_does_not_wait_for_other_threads(environment):
    code = (
        "import sys, threading, time\n"
        "from ropeode.cli import run_process\n"
        "threading.Thread(target=time.sleep, args=(10_000,)).start()\n"
        "sys.argv[1:] = ['spec', '--nonsense']\n"
        "run_process()"
    )
    command = [sys.executable, "-c", code]
    assert subprocess.run(command, env=environment, timeout=HANGS_AFTER_S).returncode == 2


@pytest.mark.parametrize(
    ("line", "code", "words"),
    [
        ("steppers > /dev/full", 2, "output: No space left on device; allowed: "),
        # Standard output may be closed, and its reader may go away.
        ("check --template rhs >&-", 0, ""),
        ("spec | head -1 >&2", 0, "# What `ropeode table THIS-FILE` computes."),
    ],
)
def test_output_that_goes_nowhere(line, code, words, environment, tmp_path):
    done = subprocess.run(
        ["bash", "-c", f"{sys.executable} -m ropeode {line}"],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env=environment,
        timeout=HANGS_AFTER_S,
    )
    assert (done.returncode, done.stdout) == (code, "")
    assert words in done.stderr
    assert len(done.stderr.splitlines()) == bool(words)


PRINTS_ELSEWHERE = """
import io, sys
sys.stdout = io.StringIO()
def step(rhs, t, y, dt, args):
    sys.stderr = sys.stdout = None
    return y + dt * rhs(t, y, args)
"""


@pytest.mark.slow
def test_a_file_that_prints_elsewhere_does_not_take_the_table_along(run):
    Path("steps.py").write_text(PRINTS_ELSEWHERE)
    done = run("table", *SMALL, "--steppers", "steps.py", "--steps", "16,32,64")
    assert done.returncode == 0
    assert "steps.py:step" in done.stdout


def test_code_that_closes_the_output_is_told_so(monkeypatch):
    monkeypatch.setattr(sys, "stdout", io.StringIO())
    with pytest.raises(UserCodeError, match="closes sys.stdout"), streams_kept():
        sys.stdout.close()
