"""What the lab answers: the numbers of tables, curves and certificates, and nothing else."""

from __future__ import annotations

import base64
import io
import json
import math
import re
import shlex

import numpy as np
import pytest
from PIL import Image

from ropeode import Problem, check_stepper, grade, hanging_equilibrium, simulate
from ropeode.analysis import normal_modes
from ropeode.errors import InputError
from ropeode.laboratory import Laboratory, answer_to, chosen, drawing_of
from ropeode.laboratory.messages import AskCommand, AskLibrary, ProblemChoice
from ropeode.problems import PROBLEMS
from ropeode.progress import silent
from ropeode.render import format_check
from tests.checking.trajectory_writing import write_runs
from tests.laboratory.conftest import ROPE


def run_of(stepper, steps, **problem):
    asked = {"problem": problem or ROPE, "stepper": stepper, "steps_per_frame": steps}
    return {"kind": "run", **asked}


def test_differences_are_those_of_the_nodes_in_float64(ask, laboratory):
    run, arrays = ask(run_of("explicit-euler", 64))
    truth, of_truth = ask({"kind": "truth", "problem": ROPE})
    finer = laboratory.motion(ROPE, silent).finer
    own = simulate(finer.problem, "explicit-euler", 64 // 8, progress=silent)
    wanted = own.positions - finer.positions
    assert run.every == 1
    assert np.array_equal(arrays["differences"], wanted)
    farthest = np.linalg.norm(wanted, axis=2).max(axis=1)
    np.testing.assert_allclose(arrays["errors"], farthest, rtol=1e-12, atol=1e-300)
    assert truth.trusted == len(of_truth["bound"]) == len(of_truth["times"]) == 25
    assert (truth.links, truth.fixed) == (((0, 1), (1, 2), (2, 3)), (0,))


def test_the_library_has_every_problem_and_says_what_its_parameters_are(ask):
    library, _ = ask({"kind": "library"})
    assert [each.name for each in library.problems] == list(PROBLEMS)
    names = {each.name for each in library.steppers}
    assert names >= {"rk4", "diffrax:Tsit5", "scipy:RK45"}
    for problem in library.problems:
        assert set() < set(problem.default_steppers) <= set(problem.steppers) <= names
        for each in problem.parameters:
            assert each.words
            assert each.allowed
            if each.low is not None and each.high is not None:
                assert each.low <= each.default <= each.high
                assert each.low > 0 or not each.logarithmic
                assert each.low >= 0 or each.allowed.startswith("a finite number")
                assert each.logarithmic or "> 0" not in each.allowed


PHASE = run_of("rk4", 64) | {"kind": "phase", "mode": 1}
FILM = {"kind": "film", "problem": ROPE, "steppers": ["rk4"], "steps_per_frame": 16}


@pytest.mark.parametrize(
    ("question", "named"),
    [
        (run_of("rk4", 16, name="ropes"), "problem"),
        (run_of("rk4", 16, parameters={"num_nodes": 10**9}), "num_nodes"),
        (run_of("rk4", 16, parameters={"num_nodes": "1000000000"}), "num_nodes"),
        (run_of("rk4", 16, frames=601), "frames"),
        (run_of("rk4", 16, name="kepler", parameters={"self": 1}), "self"),
        (run_of("/etc/passwd", 16), "stepper"),
        (run_of("scipy:RK45", 2**20), "steps_per_frame"),
        (run_of("diffrax:Kvaerno3", 2**20), "steps_per_frame"),
        (run_of("constraint-verlet:sweeps=999999999", 16), "steps_per_frame"),
        (PHASE | {"mode": 6}, "mode"),
        (FILM | {"problem": {"name": "lorenz"}}, "2 or 3 components"),
    ],
)
def test_what_cannot_be_answered_is_refused_with_the_field(ask, question, named):
    with pytest.raises(InputError, match=named):
        ask(question)


@pytest.mark.parametrize("kind", ["rope", "kepler", ["rope"]])
def test_a_problem_that_says_wrongly_what_it_is_is_none_of_the_library(kind):
    said = {"kind": kind, "start": 1.0}
    own = Problem.second_order(lambda t, x, v, a: -x, [[1.0]], [[0.0]], [0.0, 1.0], parameters=said)
    given, choice = chosen(own)
    assert given is own
    assert drawing_of(own).axes == ("x", "v")
    laboratory = Laboratory(own)
    first = answer_to(AskLibrary(kind="library"), laboratory, silent)[0].problems[0]
    assert (first.name, first.parameters) == (choice.name, ())
    question = {"kind": "command", "problem": choice, "steppers": (), "steps_per_frame": (16,)}
    with pytest.raises(InputError, match="use the code that made it"):
        answer_to(AskCommand(**question), laboratory, silent)


def test_the_stability_region_is_that_of_an_explanation_and_what_has_none_says_why(ask):
    found, arrays = ask({"kind": "stability", "problem": ROPE, "stepper": "rk4"})
    rows, columns = arrays["radius"].shape
    z = np.linspace(*found.real, columns) + 1j * np.linspace(*found.imaginary, rows)[:, None]
    polynomial = np.abs(1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24)
    np.testing.assert_allclose(arrays["radius"], polynomial, rtol=1e-9)
    # Of the fastest oscillation along the solution RK4 allows dt = 2 sqrt(2) / omega at most.
    fastest = np.abs(arrays["eigenvalues"][..., 1]).max()
    assert math.isclose(found.largest_stable_dt, math.sqrt(8) / fastest, rel_tol=0.01)
    assert arrays["eigenvalues"].shape == (4, 12, 2)
    none, others = ask({"kind": "stability", "problem": ROPE, "stepper": "rattle"})
    assert none.why_none
    assert others.keys() == {"times", "eigenvalues"}
    why, _ = ask({"kind": "theory", "problem": ROPE, "stepper": "constraint-verlet"})
    assert why.words.startswith("no error is predicted: ")


def test_phase_planes_are_those_of_nodes_and_of_modes(ask, laboratory):
    motion = laboratory.motion(ROPE, silent)
    _, arrays = ask({"kind": "phase", "problem": ROPE, "node": 2, "component": 1})
    assert np.array_equal(arrays["x"], motion.finer.positions[:, 2, 1])
    assert np.array_equal(arrays["v"], motion.finer.velocities[:, 2, 1])
    found, arrays = ask(PHASE)
    still = hanging_equilibrium(motion.problem)
    modes = normal_modes(motion.problem, still)
    # The node that is farthest out in a mode alone is out by 1, and the others by nothing.
    shapes = np.linalg.pinv(modes.weights.reshape(6, -1))
    np.testing.assert_allclose(np.abs(shapes).max(axis=0), 1.0)
    at_once = np.einsum("kdn,tdn->tk", modes.weights, motion.finer.states[:, 0] - still[0])
    np.testing.assert_allclose(arrays["x"], at_once[:, 1], rtol=1e-3)
    assert "mode 1" in found.x_label


def test_files_are_graded_in_the_words_of_grade(ask, laboratory, tmp_path):
    problem = laboratory.problem(ROPE)
    paths = write_runs(tmp_path, problem, "rk4", (16, 32, 64), ".csv")
    files = [{"name": f"../runs/{each.name}", "text": each.read_text()} for each in paths]
    question = {"kind": "grade", "problem": ROPE}
    found, arrays = ask({**question, "files": files})
    report = grade(paths, problem, progress=silent)
    lines = [line.text for line in found.lines]
    assert " ".join(format_check(report).split()).startswith(lines[0])
    assert lines[2 : 2 + len(report.findings)] == [f"{x.check}: {x.line}" for x in report.findings]
    for index, (run, path) in enumerate(zip(found.runs, paths, strict=True)):
        own, _ = ask(run_of("rk4", int(path.stem)))
        assert (run.stepper, run.dt) == (path.name, own.dt)
        assert run.error_max == own.error_max
        assert arrays[f"{index}.differences"].shape == (4, 4, 2)
    few, _ = ask({**question, "files": files[:1]})
    assert (few.lines[0].status, len(few.runs)) == ("note", 1)
    bad = {"name": "a.csv", "text": "t,node,x,y\n0,0,zero,1\n"}
    with pytest.raises(InputError, match=r"a\.csv") as refused:
        ask({**question, "files": [bad, *files]})
    # Where it was written meanwhile.
    assert not re.search("/tmp|ropeode-", str(refused.value))


@pytest.mark.slow
def test_a_check_has_the_words_of_check(ask):
    found, _ = ask({"kind": "check", "stepper": "rk4", "quick": True})
    report = check_stepper("rk4", quick=True, progress=silent)
    wanted = [f"{each.check}: {each.line}" for each in report.findings]
    assert [line.text for line in found.lines[1 : 1 + len(wanted)]] == wanted
    # There is no verdict before the last check.
    assert not {line.status for line in found.lines} & {"right", "wrong"}
    whole, _ = ask({"kind": "check", "stepper": "rk4"})
    assert found.made < whole.made == whole.checks
    assert whole.lines[1].status == "right"


@pytest.mark.slow
def test_command_and_code_compute_what_is_shown(ask, laboratory, run):
    changed = {"pinned": [0, 3], "stiffness": 55.5, "initial_velocity": [0.0, 0.125]}
    rope = ProblemChoice(name="rope", parameters={"num_nodes": 4, **changed}, frames=3)
    kepler = ProblemChoice(name="kepler", parameters={"eccentricity": 0.2})
    stepper = "stormer-verlet:start=rest,damping=lagged"
    question = {"kind": "command", "steppers": [stepper], "steps_per_frame": [16, 32]}
    found, _ = ask({**question, "problem": rope})
    made: dict = {}
    exec(found.python, made)
    assert made["problem"] == laboratory.problem(rope)
    rows = made["table"].rows
    assert [(row.stepper, row.steps_per_frame) for row in rows] == [(stepper, 16), (stepper, 32)]
    program, *words = shlex.split(found.command)
    assert program == "ropeode"
    done = run(*words, "--format", "json")
    assert done.returncode == 0, done.stderr
    printed = json.loads(done.stdout)["rows"]
    assert [each["error_max"] for each in printed] == [row.error_max for row in rows]
    # The command line has no options for other problems.
    other, _ = ask({**question, "problem": kepler})
    assert other.command is None
    exec(other.python.partition("table =")[0], made)
    assert made["problem"] == laboratory.problem(kepler)


@pytest.mark.slow
def test_a_film_is_a_gif(ask):
    found, _ = ask(FILM)
    with Image.open(io.BytesIO(base64.b64decode(found.gif))) as film:
        assert (film.format, film.n_frames) == ("GIF", 25)
