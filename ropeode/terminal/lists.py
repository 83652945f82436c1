"""Options that take several values, separated by commas."""

from __future__ import annotations

from typing import Any

import click


def split_at_commas(text: str) -> list[str]:
    """The parts between the commas, without blanks around them and without empty ones."""
    return [part.strip() for part in text.split(",") if part.strip()]


class CommaSeparated(click.ParamType):
    """A list of texts, which are checked by what uses them."""

    name = "list"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> list[str]:
        """The parts of a text."""
        return split_at_commas(value)
