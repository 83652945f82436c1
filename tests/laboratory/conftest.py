"""One laboratory for all tests of answers, so that references and programs are shared."""

from __future__ import annotations

import asyncio
import inspect

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


@pytest.hookimpl(tryfirst=True)
def pytest_pyfunc_call(pyfuncitem):
    """Run a test that is a coroutine function in the event loop of its module."""
    if not inspect.iscoroutinefunction(pyfuncitem.obj):
        return None
    names = inspect.signature(pyfuncitem.obj).parameters
    given = {name: pyfuncitem.funcargs[name] for name in names}
    pyfuncitem.funcargs["runner"].run(pyfuncitem.obj(**given))
    return True


@pytest.fixture(scope="module")
def runner():
    with asyncio.Runner() as runner:
        yield runner


@pytest.fixture(scope="module")
def lab(runner):
    """One lab for all tests of a module that want no other."""
    started = running()
    yield runner.run(started.__aenter__())
    runner.run(started.__aexit__(None, None, None))


@pytest.fixture
def page(lab, runner):
    """A page that talks to it."""
    opened = lab.page()
    yield runner.run(opened.__aenter__())
    runner.run(opened.__aexit__(None, None, None))
