"""One laboratory for all tests of answers, so that references and programs are shared."""

from __future__ import annotations

import pytest

from ropeode.laboratory import Laboratory, answer_to, answers_in, page_with
from ropeode.laboratory.messages import ProblemChoice
from ropeode.progress import silent
from tools.default_recording import FILE

ROPE = ProblemChoice(name="rope", parameters={"num_nodes": 4}, frames=3)


def csv_of(run):
    """A run as another program may print it."""
    lines = [f"# dt = {run.dt}", "t,node,x,y,vx,vy"]
    lines += [
        ",".join(map(repr, [float(t), node, *map(float, x), *map(float, v)]))
        for t, xs, vs in zip(run.times, run.positions, run.velocities, strict=True)
        for node, (x, v) in enumerate(zip(xs, vs, strict=True))
    ]
    return "\n".join([*lines, ""])


@pytest.fixture(scope="session")
def laboratory():
    return Laboratory()


@pytest.fixture(scope="session")
def ask(laboratory):
    """The answer to a question, as message and arrays."""
    return lambda question: answer_to(question, laboratory, silent)


@pytest.fixture(scope="session")
def recorded_file():
    """The lab in one file with the shipped recording."""
    answers = answers_in(FILE.read_text())
    (truth,) = (header for ask, header, _ in answers if ask.kind == "truth")
    return page_with("", FILE.read_text(), truth["certificate"])
