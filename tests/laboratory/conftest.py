"""One laboratory for all tests of answers, so that references and programs are shared."""

from __future__ import annotations

import pytest
from pydantic import TypeAdapter

from ropeode.laboratory import Laboratory, answer_to, answers_in, page_with
from ropeode.laboratory.messages import Ask, ProblemChoice
from ropeode.progress import silent
from tests.laboratory.serving import running
from tools.default_recording import FILE

ROPE = ProblemChoice(name="rope", parameters={"num_nodes": 4}, frames=3)


@pytest.fixture(scope="session")
def laboratory():
    return Laboratory()


@pytest.fixture(scope="session")
def ask(laboratory):
    """The answer to a question, as message and arrays."""
    asked = TypeAdapter(Ask).validate_python
    return lambda question: answer_to(asked(question), laboratory, silent)


@pytest.fixture(scope="session")
def recorded_file():
    """The lab in one file with the shipped recording."""
    answers = answers_in(FILE.read_text())
    (truth,) = (header for ask, header, _ in answers if ask.kind == "truth")
    return page_with("", FILE.read_text(), truth["certificate"])


@pytest.fixture(scope="module")
def anyio_backend():
    """Of tests that are marked `anyio`: coroutine functions, which share the loop of their lab."""
    return "asyncio"


@pytest.fixture(scope="module")
async def lab(anyio_backend):
    """One lab for all tests of a module that want no other."""
    async with running() as started:
        yield started


@pytest.fixture
async def page(lab):
    """A page that talks to it."""
    async with lab.page() as opened:
        yield opened
