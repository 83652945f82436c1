"""Files of the rope of the other kind are said to be that, and only such files."""

from __future__ import annotations

import dataclasses

import pytest
from trajectory_writing import write_runs

from ropeode import grade
from ropeode.problems import InextensibleRope, Rope
from tests.exact_reference import rope_reference

SAME = {"num_nodes": 4, "node_mass": (1.0, 2.0, 0.5, 1.0), "damping": 0.02}
STEPS = (16, 32, 64)


@pytest.fixture(scope="module")
def ropes():
    """The references of both kinds."""
    return {
        rope.kind: rope_reference(rope.problem(frames=3))
        for rope in (Rope(**SAME), InextensibleRope(**SAME))
    }


CASES = {
    "rope": ("inextensible-rope", "rattle", "with rigid links: at dt = 0.01562 the error is"),
    "inextensible-rope": ("rope", "velocity-verlet", "with springs of stiffness 100: at dt ="),
}


@pytest.mark.parametrize(
    "given", ["rope", pytest.param("inextensible-rope", marks=pytest.mark.slow)]
)
def test_files_of_the_other_rope(tmp_path, ropes, given):
    kind, stepper, words = CASES[given]
    made = write_runs(tmp_path, ropes[kind].problem, stepper, STEPS)
    report = grade(made, ropes[given], expected_order=1)
    assert [each.check for each in report.failed] == ["order"]
    (found,) = report.diagnosis
    assert found.cause == "other-rope"
    assert f"the files fit the same rope {words}" in found.line
    assert "against that rope, positions order 2.0" in found.line
    assert f'kind = "{kind}"' in found.remedy
    assert found.evidence["error"] > 100 * found.evidence["error_of_other"]
    assert found.evidence["other"] == ropes[kind].problem.parameters


# The rope that the files solve, the stepper, and the reference that they are compared with.
slow = pytest.mark.slow
HEAVY, NEAR = (InextensibleRope(**SAME, gravity=(0, g)) for g in (-2.0, -1.0001))
NEITHER = [
    (Rope(**SAME), "velocity-verlet", Rope(**SAME)),
    # With another gravity they converge to no rope, however near the other one is.
    pytest.param(HEAVY, "rattle", Rope(**SAME), marks=slow),
    pytest.param(NEAR, "rattle", Rope(**SAME), marks=slow),
    # Rigid links allow no pins apart from each other.
    pytest.param(InextensibleRope(**SAME), "rattle", Rope(**SAME, pinned=(0, 3)), marks=slow),
]


@pytest.mark.parametrize(("solved", "stepper", "given"), NEITHER)
def test_files_of_neither(tmp_path, ropes, solved, stepper, given):
    # Coarser steps leave it open whether there is a limit.
    made = write_runs(tmp_path, solved.problem(frames=3), stepper, (32, 64, 128))
    known = dataclasses.replace(ropes["rope"], problem=given.problem(frames=3))
    found = [each.cause for each in grade(made, known, expected_order=1).diagnosis]
    assert "other-rope" not in found
    assert (found == []) == (solved == given)


@slow
def test_ropes_that_the_runs_cannot_tell_apart(tmp_path):
    """Springs so stiff that they move as rigid links do, as far as the errors show."""
    stiff = rope_reference(Rope(num_nodes=3, stiffness=1e4).problem(frames=1))
    rigid = InextensibleRope(num_nodes=3).problem(frames=1)
    made = write_runs(tmp_path, rigid, "explicit-euler", (4, 8, 16))
    assert all(
        each.cause != "other-rope" for each in grade(made, stiff, expected_order=1).diagnosis
    )
