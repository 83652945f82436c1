"""The command and the Python code that compute what the page shows."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping
from typing import Any

from ropeode.laboratory.answers import Answer
from ropeode.laboratory.messages import AskCommand, Command
from ropeode.laboratory.setup import Laboratory
from ropeode.problems import PROBLEMS, ROPES, Problem
from ropeode.progress import Progress
from ropeode.study import check_steps
from ropeode.validation import bad_value


def answer(ask: AskCommand, laboratory: Laboratory, progress: Progress) -> Answer:
    """See `ropeode.laboratory.answers.answer_to`."""
    problem, ladder = laboratory.problem(ask.problem), check_steps(ask.steps_per_frame)
    kind = problem.parameters.get("kind")
    if kind not in PROBLEMS:
        allowed = "a problem of the library, which a command can name"
        raise bad_value("problem", ask.problem.name, allowed, "use the code that made it")
    changed = _changed(problem)
    message = Command(
        command=_command(kind, problem.frames, changed, ask.steppers, ladder),
        python=_python(kind, problem.frames, changed, ask.steppers, ladder),
    )
    return message, {}


def _changed(problem: Problem) -> dict[str, Any]:
    """The parameters that are not those by default."""
    usual = PROBLEMS[problem.parameters["kind"]](frames=problem.frames).parameters
    return {n: each for n, each in problem.parameters.items() if each != usual.get(n)}


def _command(
    kind: str,
    frames: int,
    changed: Mapping[str, Any],
    steppers: tuple[str, ...],
    ladder: tuple[int, ...],
) -> str | None:
    if changed and kind not in ROPES:
        return None
    words = ["ropeode", "table"]
    if kind != "rope":
        words += ["--kind" if kind in ROPES else "--problem", kind]
    for name, value in changed.items():
        words.append(f"--{name.replace('_', '-')}={_option(value)}")
    words += ["--frames", str(frames)]
    if steppers:
        words += ["--steppers", ",".join(steppers)]
    words += ["--steps", ",".join(map(str, ladder))]
    return shlex.join(words)


def _option(value: Any) -> str:
    """A parameter as the command line takes it."""
    if not isinstance(value, (list, tuple)):
        return repr(value)
    rows = any(isinstance(each, (list, tuple)) for each in value)
    return (";" if rows else ",").join(map(_option, value))


def _python(
    kind: str,
    frames: int,
    changed: Mapping[str, Any],
    steppers: tuple[str, ...],
    ladder: tuple[int, ...],
) -> str:
    def named(values: Mapping[str, Any]) -> str:
        return ", ".join(f"{name}={value!r}" for name, value in values.items())

    if kind in ROPES:
        rope = ROPES[kind].__name__
        imported = f"from ropeode import {rope}, accuracy_table, format_table"
        made = f"{rope}({named(changed)}).problem(frames={frames})"
    else:
        function = kind.replace("-", "_")
        imported = "from ropeode import accuracy_table, format_table\n"
        imported += f"from ropeode.problems.{function} import {function}"
        made = f"{function}({named({'frames': frames, **changed})})"
    asked = f"{json.dumps(list(steppers)) if steppers else None}, {list(ladder)}"
    lines = [
        imported,
        "",
        f"problem = {made}",
        f"table = accuracy_table(problem, {asked})",
        "print(format_table(table))",
        "",
    ]
    return "\n".join(lines)
