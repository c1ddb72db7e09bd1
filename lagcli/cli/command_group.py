"""The commands as a group that loads the one that is asked for, and answers an unknown one with what was meant."""

from __future__ import annotations

import importlib
import os
from typing import Any, TypeAlias

import typer
from typer.core import TyperGroup

from lagcli.cli.commands import COMMANDS
from lagcli.errors import diagnostics

Click: TypeAlias = Any  # contexts, commands, formatters: other classes by the version of typer

# What the program and its commands have in common.
LOOKS: dict[str, Any] = {
    "rich_markup_mode": None,
    "pretty_exceptions_enable": False,
    "context_settings": {"help_option_names": ["-h", "--help"]},
}

# Words for commands in other programs, and what to type here.
_MEANT = {
    **dict.fromkeys(("run", "sim", "solve", "integrate", "start", "exec"), "lagcli simulate MODEL"),
    **dict.fromkeys(("plot", "draw", "figure", "show"), "lagcli simulate MODEL --plot FILE"),
    **dict.fromkeys(("count", "freedoms", "mobility"), "lagcli dof MODEL"),
    **dict.fromkeys(("validate", "lint", "classify", "verify", "analyze", "analyse"), "lagcli check MODEL"),
    **dict.fromkeys(("equations", "eom", "latex", "lagrange"), "lagcli derive MODEL"),
    **dict.fromkeys(("help",), "lagcli --help"),
    **dict.fromkeys(("version",), "lagcli --version"),
    **dict.fromkeys(("error", "why", "what", "codes"), "lagcli explain CODE"),
}


class CommandGroup(TyperGroup):
    """The group of all commands; the options of a command are read when it is asked for."""

    def list_commands(self, ctx: Click) -> list[str]:
        """The names, in the order of the help."""
        return list(COMMANDS)

    def get_command(self, ctx: Click, cmd_name: str) -> Click:
        """The command of this name, None where there is none."""
        if cmd_name not in COMMANDS:
            return None
        if cmd_name not in self.commands:
            declared = importlib.import_module(f"lagcli.cli.commands.{cmd_name}_options")
            alone = typer.Typer(add_completion=False, **LOOKS)
            alone.command(cmd_name, short_help=COMMANDS[cmd_name])(getattr(declared, cmd_name))
            self.add_command(typer.main.get_command(alone), cmd_name)
        return self.commands[cmd_name]

    def format_commands(self, ctx: Click, formatter: Click) -> None:
        """The list of commands in the help, for which none of them is loaded."""
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))

    def resolve_command(self, ctx: Click, args: list[str]) -> Click:
        """The command that the first argument names; ends with exit 2 and a hint where there is none."""
        name = args[0]
        if name not in COMMANDS and not name.startswith("-"):
            shown = diagnostics.printable(name).replace("\n", " ")[:200]
            ctx.fail(f"there is no command `{shown}`; {self._hint(name, shown)}")
        return super().resolve_command(ctx, args)

    def _hint(self, name: str, shown: str) -> str:
        if name.lower().endswith((".yaml", ".yml")) or os.path.exists(name):
            return f"did you mean `lagcli simulate {shown}`?"
        if name.casefold() in _MEANT:
            return f"did you mean `{_MEANT[name.casefold()]}`?"
        return diagnostics.nearest(name, COMMANDS) or f"the commands are {diagnostics.listed(list(COMMANDS))}"
