"""Commands with subcommands."""

from __future__ import annotations

from typing import Any

import click
from click.shell_completion import CompletionItem


class WholeHelp(click.Group):
    """A group whose help has the first sentence of each command, however long it is."""

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the commands; click would cut off what does not fit into one line."""
        whole = formatter.width * 10
        rows = [(name, each.get_short_help_str(whole)) for name, each in self.commands.items()]
        with formatter.section("Commands"):
            formatter.write_dl(rows)


class DefaultGroup(WholeHelp):
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

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """The subcommands, and what the default one begins with: an option, or its argument."""
        default = self.commands[self._default]
        within = click.Context(default, parent=ctx)
        found = super().shell_complete(ctx, incomplete)
        if incomplete.startswith("-"):
            return found + default.shell_complete(within, incomplete)
        argument = next(each for each in default.params if isinstance(each, click.Argument))
        return found + argument.shell_complete(within, incomplete)
