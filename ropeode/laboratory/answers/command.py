"""The command and the Python code that compute what the page shows."""

from __future__ import annotations

import json
import shlex
from typing import Any

from ropeode.laboratory.answers import Answer
from ropeode.laboratory.messages import AskCommand, Command, ProblemChoice
from ropeode.laboratory.setup import Laboratory, choice_of
from ropeode.problems import ROPES
from ropeode.progress import Progress
from ropeode.study import check_steps
from ropeode.validation import bad_value


def command(ask: AskCommand, laboratory: Laboratory, progress: Progress) -> Answer:
    """See `ropeode.laboratory.answers.answer_to`."""
    ladder = check_steps(ask.steps_per_frame)
    choice = choice_of(laboratory.problem(ask.problem))
    if choice is None:
        allowed = "a problem of the library, which a command can name"
        raise bad_value("problem", ask.problem.name, allowed, "use the code that made it")
    what = choice, ask.steppers, ladder
    return Command(command=_command(*what), python=_python(*what)), {}


def _command(
    choice: ProblemChoice, steppers: tuple[str, ...], ladder: tuple[int, ...]
) -> str | None:
    is_rope = choice.name in ROPES
    if choice.parameters and not is_rope:
        return None
    words = ["ropeode", "table"]
    if choice.name != "rope":
        words += ["--kind" if is_rope else "--problem", choice.name]
    for name, value in choice.parameters.items():
        words.append(f"--{name.replace('_', '-')}={_option(value)}")
    words += ["--frames", str(choice.frames)]
    if steppers:
        words += ["--steppers", ",".join(steppers)]
    return shlex.join([*words, "--steps", ",".join(map(str, ladder))])


def _option(value: Any) -> str:
    """A parameter as the command line takes it."""
    if not isinstance(value, (list, tuple)):
        return repr(value)
    rows = any(isinstance(each, (list, tuple)) for each in value)
    return (";" if rows else ",").join(map(_option, value))


def _python(choice: ProblemChoice, steppers: tuple[str, ...], ladder: tuple[int, ...]) -> str:
    given = [f"{name}={value!r}" for name, value in choice.parameters.items()]
    frames = f"frames={choice.frames}"
    if choice.name in ROPES:
        rope = ROPES[choice.name].__name__
        imported = f"from ropeode import {rope}, accuracy_table, format_table"
        made = f"{rope}({', '.join(given)}).problem({frames})"
    else:
        function = choice.name.replace("-", "_")
        imported = "from ropeode import accuracy_table, format_table\n"
        imported += f"from ropeode.problems.{function} import {function}"
        made = f"{function}({', '.join([frames, *given])})"
    asked = f"{json.dumps(list(steppers)) if steppers else None}, {list(ladder)}"
    lines = [
        *(imported, "", f"problem = {made}", f"table = accuracy_table(problem, {asked})"),
        *("print(format_table(table))", ""),
    ]
    return "\n".join(lines)
