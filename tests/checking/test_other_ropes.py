"""Files of the rope of the other kind are said to be that, and only such files."""

from __future__ import annotations

import dataclasses

import pytest
from trajectory_writing import node_values, write_npz

from ropeode import reference
from ropeode.checking.grade import grade
from ropeode.checking.trajectories.other_ropes import other_rope
from ropeode.checking.trajectories.run_files import read_runs
from ropeode.problems import InextensibleRope, Rope
from ropeode.simulation import simulate

SAME = {"num_nodes": 4, "node_mass": (1.0, 2.0, 0.5, 1.0), "damping": 0.02}


def nothing_is_certified(problem):
    raise AssertionError(f"a reference of {problem} is computed")


@pytest.fixture(scope="module")
def ropes():
    """The references of both kinds."""
    return {
        rope.kind: reference(rope.problem(frames=3))
        for rope in (Rope(**SAME), InextensibleRope(**SAME))
    }


def written(folder, problem, stepper, steps=(32, 64, 128)):
    return [
        write_npz(folder / f"{n}.npz", run.times, node_values(problem, run.states), run.dt)
        for n in steps
        for run in [simulate(problem, stepper, n)]
    ]


CASES = {
    "rope": ("inextensible-rope", "rattle", "with rigid links: at dt = 0.007812 the error is"),
    "inextensible-rope": ("rope", "velocity-verlet", "with springs of stiffness 100: at dt ="),
}


@pytest.mark.parametrize("given", CASES)
def test_files_of_the_other_rope(tmp_path, ropes, given):
    kind, stepper, words = CASES[given]
    made = written(tmp_path, ropes[kind].problem, stepper)
    runs = read_runs(made, ropes[given].problem)
    found = other_rope(ropes[given], runs, reference)
    assert found is not None
    assert found.cause == "other-rope"
    assert f"the files fit the same rope {words}" in found.line
    assert "against that rope, positions order 2.0" in found.line
    assert f'kind = "{kind}"' in found.remedy
    assert found.evidence["error"] > 100 * found.evidence["error_of_other"]
    assert found.evidence["other"] == ropes[kind].problem.parameters


def test_the_report_says_so(tmp_path, ropes):
    made = written(tmp_path, ropes["inextensible-rope"].problem, "rattle")
    report = grade(made, ropes["rope"], expected_order=1)
    assert [each.check for each in report.failed] == ["order"]
    assert [each.cause for each in report.diagnosis] == ["other-rope"]
    assert "positions order 2.0" in report.diagnosis[0].line


@pytest.mark.parametrize("gravity", [-2.0, -1.0001])
def test_files_of_neither(tmp_path, ropes, gravity):
    """With another gravity they converge to no rope, however near the other one is."""
    heavy = InextensibleRope(**SAME, gravity=(0, gravity)).problem(frames=3)
    runs = read_runs(written(tmp_path, heavy, "rattle"), heavy)
    assert other_rope(ropes["rope"], runs, reference) is None


def test_right_files(tmp_path, ropes):
    known = ropes["rope"]
    runs = read_runs(written(tmp_path, known.problem, "velocity-verlet"), known.problem)
    assert other_rope(known, runs, reference) is None


@pytest.mark.slow
def test_ropes_that_the_runs_cannot_tell_apart(tmp_path):
    """Springs so stiff that they move as rigid links do, as far as the errors show."""
    rigid = reference(InextensibleRope(num_nodes=3).problem(frames=1))
    stiff = reference(Rope(num_nodes=3, stiffness=1e4).problem(frames=1))
    runs = read_runs(written(tmp_path, rigid.problem, "explicit-euler", (4, 8, 16)), rigid.problem)
    assert other_rope(stiff, runs, lambda problem: rigid) is None


def test_what_has_no_other_kind(tmp_path, ropes, small_rope):
    known = ropes["rope"]
    runs = read_runs(written(tmp_path, known.problem, "velocity-verlet"), known.problem)
    # Rigid links allow no pins apart from each other.
    pinned = dataclasses.replace(known, problem=Rope(**SAME, pinned=(0, 3)).problem(frames=3))
    assert other_rope(pinned, runs, nothing_is_certified) is None
    # Its numbers are not those that it was built from.
    args = known.problem.args._replace(gravity=known.problem.args.gravity * 2)
    changed = dataclasses.replace(known, problem=known.problem.changed(args=args, exact=None))
    assert other_rope(changed, runs, nothing_is_certified) is None
    # It is no rope.
    bare = dataclasses.replace(known, problem=known.problem.changed(parameters={}))
    assert other_rope(bare, runs, nothing_is_certified) is None
