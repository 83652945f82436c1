"""The arguments of library problems: checked by their types, and recorded in the problem."""

from __future__ import annotations

import functools
import inspect
import json
import typing
from collections.abc import Callable
from typing import Any, ParamSpec

from pydantic import create_model

from ropeode.problems.picture import PICTURES, Picture
from ropeode.problems.problem import Problem
from ropeode.validation import Input, check_memory, field

P = ParamSpec("P")


def library_problem(
    picture: Picture | None = None, **validators: Any
) -> Callable[[Callable[P, Problem]], Callable[P, Problem]]:
    """Check the arguments of a function that builds a problem, and record them in the problem.

    The type of an argument says what is allowed, as `ropeode.validation.Positive` does; its
    default is the example in messages. The problem's kind is the function's name, with hyphens.

    Arguments:
        picture: how the problem is drawn, where the general rule would not show what it is.
        validators: pydantic's, for checks beyond the type of an argument.
    """

    def decorated(build: Callable[P, Problem]) -> Callable[P, Problem]:
        types = typing.get_type_hints(build, include_extras=True)
        fields: dict[str, Any] = {
            name: (
                types[name],
                field(
                    argument.default,
                    allowed=types[name].__metadata__[-1],
                    example=json.dumps(argument.default),
                ),
            )
            for name, argument in inspect.signature(build).parameters.items()
        }
        arguments = create_model(
            build.__name__, __base__=Input, __validators__=validators, **fields
        )
        kind = build.__name__.replace("_", "-")
        if picture is not None:
            PICTURES[kind] = picture

        @functools.wraps(build)
        def checked(*values: P.args, **named: P.kwargs) -> Problem:
            given = arguments(*values, **named)
            check_memory(getattr(given, "frames", 1))
            parameters = {"kind": kind, **given.model_dump(mode="json")}
            return build(**dict(given)).changed(parameters=parameters)  # pyright: ignore[reportCallIssue]

        return checked

    return decorated
