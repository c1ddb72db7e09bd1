"""The program: its name, its options, and the group of its commands."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Callable
from typing import Annotated, Any, TypeAlias

import typer
from typer.core import TyperCommand, TyperGroup

from lagcli.cli.commands import COMMANDS
from lagcli.cli.terminal import exits
from lagcli.errors import diagnostics

Click: TypeAlias = Any  # contexts, commands, formatters: other classes by the version of typer

# What the program and its commands have in common.
LOOKS: dict[str, Any] = {"rich_markup_mode": None, "pretty_exceptions_enable": False}
LOOKS["context_settings"] = {"help_option_names": ["-h", "--help"]}

# The error of a wrong command line, of the library that typer uses or of the one it holds, by its version.
_UsageError: Any = typer.BadParameter.__base__


def _parsed(parse: Callable[[Click, list[str]], list[str]], ctx: Click, args: list[str]) -> list[str]:
    """The arguments that are left; ends with exit 2 and the nearest option where there is none of a name."""
    try:
        return parse(ctx, args)
    except _UsageError as error:
        name = getattr(error, "option_name", None)
        if not isinstance(name, str) or not hasattr(error, "possibilities"):
            raise
    options = [option for one in ctx.command.get_params(ctx) for option in one.opts if option.startswith("-")]
    shown = diagnostics.printable(name).replace("\n", " ")[:200]
    known = diagnostics.meant("options").get(name)
    hint = f"did you mean `{known}`?" if known in options else diagnostics.nearest(name, options)
    return ctx.fail(f"there is no option `{shown}`{f'; {hint}' if hint else ''}")  # type: ignore[no-any-return]


class Command(TyperCommand):
    """One command."""

    def parse_args(self, ctx: Click, args: list[str]) -> list[str]:
        """Options and arguments; an unknown option, one without its value, or an argument too many, with a hint."""
        ctx.allow_extra_args = True  # they are refused here, with what was meant
        left = _parsed(super().parse_args, ctx, args)
        options = [option for option in self.get_params(ctx) if option.opts[0].startswith("-")]
        names = {name for option in options for name in option.opts}
        for option in options:
            value = ctx.params.get(option.name)
            for taken in value if isinstance(value, (list, tuple)) else (value,):
                if str(taken) in names:
                    ctx.fail(f"`{option.opts[0]}` has no value: `{taken}` is an option itself")
        if ctx.args and not ctx.resilient_parsing:  # the latter while a shell completes
            first = ctx.args[0]
            shown = diagnostics.printable(first).replace("\n", " ")[:200]
            takes_tables = any("--run" in option.opts for option in self.get_params(ctx))
            is_table = takes_tables and not first.lower().endswith((".yaml", ".yml"))
            hint = f"; did you mean `--run {shown}`?" if is_table else ""
            ctx.fail(f"`{shown}` is one argument too many{hint}")
        return left


class CommandGroup(TyperGroup):
    """The group of all commands; the options of a command are read when it is asked for."""

    def parse_args(self, ctx: Click, args: list[str]) -> list[str]:
        """Options of the program, an unknown one with a hint."""
        return _parsed(super().parse_args, ctx, args)

    def list_commands(self, ctx: Click) -> list[str]:
        """The names, in the order of the help."""
        return list(COMMANDS)

    def get_command(self, ctx: Click, cmd_name: str) -> Click:
        """The command of this name, None where there is none."""
        if cmd_name not in COMMANDS:
            return None
        if cmd_name not in self.commands:
            declared = importlib.import_module(f"lagcli.cli.commands.{cmd_name}_command")
            alone = typer.Typer(add_completion=False, **LOOKS)
            alone.command(cmd_name, cls=Command, short_help=COMMANDS[cmd_name])(getattr(declared, cmd_name))
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
            if name.lower().endswith((".yaml", ".yml")) or os.path.exists(name):
                hint = f"did you mean `lagcli simulate {shown}`?"
            elif known := diagnostics.meant("commands").get(name.casefold()):
                hint = f"did you mean `{known}`?"
            else:
                listed = f"the commands are {diagnostics.listed(list(COMMANDS))}"
                hint = diagnostics.nearest(name, COMMANDS) or listed
            ctx.fail(f"there is no command `{shown}`; {hint}")
        return super().resolve_command(ctx, args)


app = typer.Typer(
    name="lagcli",
    cls=CommandGroup,
    help="Degrees of freedom, Lagrange multipliers and constraint forces of constrained mechanical systems.",
    epilog="MODEL is a YAML file; - reads it from standard input.",
    no_args_is_help=True,
    **LOOKS,
)


def _version(wanted: bool) -> None:
    if wanted:
        from lagcli import __version__

        print(f"lagcli {__version__}", flush=True)
        raise typer.Exit()


@app.callback()
def main(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="print the version and exit")
    ] = False,
) -> None:
    """Degrees of freedom, Lagrange multipliers and constraint forces of constrained mechanical systems."""


def run() -> int:
    """Carry out the command line in `sys.argv`; its exit code."""
    if sys.stdout is None:  # closed by the caller: a stream that cannot be written
        nothing = os.open(os.devnull, os.O_RDONLY)
        sys.stdout = open(nothing, "w", encoding="utf-8")  # noqa: SIM115 - as long as the program
    sys.stderr = sys.stderr or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115 - as long as the program
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            # Names and titles may hold any letter; a terminal that cannot show one gets an escape, no failure.
            stream.reconfigure(encoding="utf-8", errors="backslashreplace")
    return exits.guarded(_commands, debug="--debug" in sys.argv)


def _commands() -> None:
    """The commands end in `SystemExit` with their own code; here ends what typer itself prints, as --help."""
    stdout = sys.stdout
    try:
        app(prog_name="lagcli")
    except SystemExit as end:
        # Typer answers a closed pipe with exit 1 and another sys.stdout.
        closed = sys.stdout is not stdout
        sys.stdout = stdout
        if closed:
            raise BrokenPipeError from None
        raise exits.Exit(end.code if isinstance(end.code, int) else exits.DONE) from None
