"""Rows of a sweep: the results of the package's functions one by one, and what can go wrong."""

import dataclasses
import json
import shutil
from pathlib import Path

import pytest

from ropeode import accuracy_table, sweep
from ropeode.analysis import classify_motion
from ropeode.errors import InputError
from ropeode.norms import motion
from ropeode.problems import PROBLEMS, Ensemble
from ropeode.references import each_reference
from ropeode.simulation import simulate
from ropeode.sweep import STATUSES, SweepSpec, Task, read_sweep
from ropeode.theory import stability_limit

VALUES = {
    "steppers": ["velocity-verlet"],
    "steps_per_frame": [1, 4, 8],
    "frames": 4,
    "rope": {"num_nodes": 3, "gravity": [0.0, -50.0]},
    "grid": {"damping": [0.0, 2.0]},
    "random": {"count": 1, "node_mass": {"uniform": [0.5, 2.0], "for_each": "node"}},
    "largest_stable_dt": True,
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("sweep")


def with_settings(task: Task, **changes) -> Task:
    """The same task in another sweep."""
    settings = dataclasses.replace(task.cases[0].settings, **changes)
    cases = [dataclasses.replace(case, settings=settings) for case in task.cases]
    return task._replace(cases=tuple(cases))


def evaluate(task: Task, folder: Path, **more) -> list[dict]:
    """The rows of a task, without their seconds, which differ each time."""
    rows = sweep.evaluate(task, folder, **more)
    for row in rows:
        seconds = row.pop("seconds")
        assert seconds > 0.0 if row["status"] != "failed" else seconds is None or seconds > 0.0
    return rows


def rows_of(spec: SweepSpec, folder: Path) -> list[dict]:
    return [row for task in spec.tasks() for row in evaluate(task, folder)]


@pytest.fixture(scope="module")
def small(folder):
    spec = SweepSpec(VALUES)
    return spec, rows_of(spec, folder)


OF_THE_TABLE = (
    *("status", "dt", "diverged_at", "error_final", "error_max", "error_rms"),
    *("resolved", "resolution", "round_off", "rhs_evaluations"),
)


def test_rows_are_what_the_functions_say_one_by_one(small):
    """Those of the accuracy table, of motion and of stability; in columns of their types.

    The reference of each problem is computed alone, without a sweep.
    """
    spec, rows = small
    problems = {case.problem_key: PROBLEMS["rope"](**case.parameters) for case in spec.cases()}
    alone = {key: next(each_reference(Ensemble.of([it]))) for key, it in problems.items()}
    types = {"string": str, "int64": int, "double": float, "bool": bool}
    for case, row in zip(spec.cases(), rows, strict=True):
        assert {*row, "seconds"} == set(spec.columns)
        assert row["status"] in STATUSES
        for name, value in row.items():
            assert value is None or type(value) is types[spec.columns[name].type], name
        assert json.loads(row["parameters"]) == case.parameters
        own, n = alone[case.problem_key], case.steps_per_frame
        ladder = [n * factor for factor in spec.fields.order_factors]
        table = accuracy_table(own, [case.stepper], ladder)
        moved = classify_motion(simulate(own.problem, case.stepper, n))
        limit = stability_limit(own.problem, case.stepper)
        (of_stepper,) = table.orders
        order = of_stepper.order
        low, high = order.ci95 or (None, None)
        # Step sizes are numbers of steps.
        used = sorted(round(row["dt"] * n / dt) for dt in order.used)
        expected = {
            **case.inputs(),
            **{name: getattr(table.rows[0], name) for name in OF_THE_TABLE},
            "observed_order": order.observed,
            "order_low": low,
            "order_high": high,
            "order_verdict": order.verdict,
            "order_why": order.why,
            "order_used": ", ".join(map(str, used)),
            "expected_order": of_stepper.expected,
            "motion": moved.verdict,
            "swings": moved.swings,
            "settled_at": moved.settled_at,
            "stability_limit": limit,
            "largest_stable_dt": None if limit is None else 1.0 / limit,
            "trusted": own.trusted,
            "horizon": own.horizon,
            "motion_size": motion(own.problem, own.states)[own.trusted - 1],
        }
        assert {name: row[name] for name in expected} == expected
        reasons = [each.partition(": ")[0] for each in row["order_left_out"].split("; ")]
        assert {*reasons} - {""} == {each.reason for each in order.left_out}
        assert (row["reason"] is None) == (limit is not None)
    assert {"diverges", "never_settles"} <= {row["motion"] for row in rows}


@pytest.mark.slow
def test_rows_do_not_depend_on_what_they_are_computed_with(small, folder, tmp_path):
    """What takes long is handed back in parts: the first problem, whatever it takes, and others."""
    spec, rows = small
    (task,) = spec.tasks()
    assert evaluate(task, folder, seconds=100.0) == rows
    assert evaluate(task, folder, seconds=1e-9) == rows[: len(rows) // 2]
    assert evaluate(task._replace(cases=task.cases[::-1]), folder) == rows[::-1]
    # The second problem alone, with a reference of its own.
    for at in (-1, -2):
        assert evaluate(task._replace(cases=task.cases[at:][:1]), tmp_path) == rows[at:][:1]


def made_once(spec, rows, folder):
    """Whether the references of a spec are there, and its rows are made without new ones."""

    def written():
        paths = (folder / "references").rglob("*.npz")
        return {path.stem: path.stat().st_mtime_ns for path in paths}

    before = written()
    assert set(before) >= {case.problem_key for case in spec.cases()}
    return rows_of(spec, folder) == rows and written() == before


@pytest.mark.slow
def test_a_reference_is_made_once_and_again_where_it_is_damaged(small, folder, tmp_path):
    spec, rows = small
    assert made_once(spec, rows, folder)
    shutil.copytree(folder / "references", tmp_path / "references")
    first, *_, last = spec.cases()
    (task,) = spec.tasks()
    paths = {path.stem: path for path in tmp_path.glob("references/*/*.npz")}
    path = paths[first.problem_key]
    whole, other = path.read_bytes(), paths[last.problem_key].read_bytes()
    changed = bytearray(whole)
    changed[len(whole) // 2] ^= 1
    for harmed in (whole[:-100], other, changed):
        path.write_bytes(harmed)
        assert evaluate(task._replace(cases=(first,)), tmp_path) == rows[:1]
        assert path.read_bytes() == whole


EXPLODING = """
def step(acceleration, t, x, v, dt, args):
    return x * (1e300 if t > 1.1 else 1.0), v
"""
NO_REFERENCE = {"accuracy": 1e-300, "largest_stable_dt": False}


def test_no_reference_and_a_run_that_diverges_are_rows(folder, tmp_path):
    (tmp_path / "steps.py").write_text(EXPLODING)
    values = {**VALUES, **NO_REFERENCE, "steps_per_frame": [1, 2]}
    spec = SweepSpec({**values, "steppers": ["rk4", "steps.py:step"]}, tmp_path)
    rows = rows_of(spec, folder)
    missing = ("error_max", "resolved", "observed_order", "order_verdict", "reference")
    # In a run of the second factor, at t = 3 or at t = 2.
    at = {("steps.py:step", 1): 4, ("steps.py:step", 2): 3}
    for row in rows:
        assert {row[name] for name in missing} == {None}
        ended = at.get((row["stepper"], row["steps_per_frame"]))
        status = "no-reference" if ended is None else "diverged"
        assert (row["status"], row["diverged_at"]) == (status, ended)
        assert row["motion"] is not None if ended is None else row["motion"] == "diverges"
        before = "" if ended is None else f"no longer finite at frame {ended}; "
        assert row["reason"].startswith(f"{before}no reference for 'rope': ")
    # A refusal is kept like a reference.
    assert made_once(spec, rows, folder)


def test_a_case_that_cannot_be_built_fails_alone(folder):
    """Each value is fine with the first value of the other, and the last two are not together."""
    velocities = [[0.0, 0.0], [[0.0, 0.0], [0.0, 1.0], [0.0, 0.0]]]
    grid = {"pinned": [[0], [1]], "initial_velocity": velocities}
    rows = rows_of(SweepSpec({**VALUES, "steps_per_frame": [4], "grid": grid}), folder)
    assert [row["status"] for row in rows] == ["ok", "ok", "ok", "failed"]
    assert rows[-1]["reason"].startswith("initial_velocity: ")
    assert "\n" not in rows[-1]["reason"]
    assert set(rows[-1]) == set(rows[0])


RAISING = """
import numpy as np
def euler(acceleration, t, x, v, dt, args):
    if np.max(args.damping) > 0:
        raise RuntimeError("out of\\n room")
    return x + dt * np.asarray(v), v + dt * np.asarray(acceleration(t, x, v, args))
"""


def test_what_a_stepper_raises_while_it_runs_is_the_reason(folder, tmp_path):
    """Another problem of the same task has its rows, also where it is handed back alone."""
    (tmp_path / "steps.py").write_text(RAISING)
    values = {**VALUES, "steppers": ["steps.py:euler"], "steps_per_frame": [4, 16]}
    spec = SweepSpec({**values, "order_factors": [], "largest_stable_dt": False}, tmp_path)
    (task,) = spec.tasks()
    rows = evaluate(task, folder)
    assert [row["status"] for row in rows] == ["ok", "ok", "failed", "failed"]
    assert "RuntimeError: out of room" in rows[3]["reason"]
    assert evaluate(task, folder, seconds=1e-9) == rows[:2]


def test_what_is_not_what_the_keys_were_made_with(folder, tmp_path):
    """A user's file that changes meanwhile, and other software."""
    texts = {
        "own.py": Path("docs/examples/pendulum.py").read_text(),
        "steps.py": EXPLODING,
        "sweep.toml": 'problem = "own.py:pendulum"\nsteppers = ["steps.py:step"]\nframes = 2',
    }
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    (task,) = read_sweep(tmp_path / "sweep.toml").tasks()
    software = {**task.cases[0].settings.software, "jax": "0.0.1"}
    with pytest.raises(InputError, match="^worker: it has jax .* and not 0.0.1; allowed: "):
        evaluate(with_settings(task, software=software), folder)
    for name, words in (
        ("steps.py", "stepper: .* allowed: the same file in all processes"),
        ("own.py", "problem: .* has been changed since the sweep was started"),
    ):
        (tmp_path / name).write_text(texts[name] + "# changed\n")
        with pytest.raises(InputError, match=f"^{words}"):
            evaluate(task, folder)
