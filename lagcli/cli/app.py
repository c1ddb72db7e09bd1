"""The program: its name, its options, and the group of its commands."""

from __future__ import annotations

from typing import Annotated

import typer

from lagcli.cli import command_group

app = typer.Typer(
    name="lagcli",
    cls=command_group.CommandGroup,
    help="Degrees of freedom, Lagrange multipliers and constraint forces of constrained mechanical systems.",
    epilog="MODEL is a YAML file; - reads it from standard input.",
    no_args_is_help=True,
    **command_group.LOOKS,
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
