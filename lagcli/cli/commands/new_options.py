"""`lagcli new`: its options."""

from __future__ import annotations

from typing import Annotated

import typer

from lagcli.cli.commands import completing, options
from lagcli.cli.terminal import exits


@exits.command
def new(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="NAME", help="the name of the model; NAME.yaml is written, - for standard output"
        ),
    ] = None,
    template: Annotated[
        str | None,
        typer.Option(
            metavar="TEMPLATE",
            help="particles, coordinates, rolling, mechanism, family or box",
            autocompletion=completing.templates,
        ),
    ] = None,
    force: options.ForceOption = False,
    no_schema: options.NoSchemaOption = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="what was written, as JSON on standard output")
    ] = False,
    quiet: options.QuietOption = False,
    debug: options.DebugOption = False,
) -> None:
    """Write a model with comments, to change into one's own.

    On a terminal what is not given is asked for.
    """
    from lagcli.cli.actions import new_command

    new_command.run(name, template, new_command.NewOptions(not no_schema, force, as_json, quiet))
