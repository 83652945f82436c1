"""Commands with subcommands, one of which is the default."""

from __future__ import annotations

from typing import Any

import click


class DefaultGroup(click.Group):
    """A group that runs a default subcommand if the first argument names none.

    Arguments:
        default: name of the default subcommand.
    """

    def __init__(self, *args: Any, default: str, **named: Any):
        super().__init__(*args, **named)
        self._default = default

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Insert the default subcommand, unless the first argument names one."""
        if args and args[0] not in self.commands and args[0] not in ("-h", "--help"):
            args = [self._default, *args]
        return super().parse_args(ctx, args)
