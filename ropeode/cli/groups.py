"""Commands that have commands of their own, one of which need not be named."""

from __future__ import annotations

from typing import Any

import click


class DefaultGroup(click.Group):
    """A group with a command that is meant where none is named.

    Arguments:
        default: name of that command.
    """

    def __init__(self, *args: Any, default: str, **named: Any):
        super().__init__(*args, **named)
        self._default = default

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Put the default command in front of what is no name of a command."""
        if args and args[0] not in self.commands and args[0] not in ("-h", "--help"):
            args = [self._default, *args]
        return super().parse_args(ctx, args)
