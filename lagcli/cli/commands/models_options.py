"""`lagcli models`: its options."""

from __future__ import annotations

from typing import Annotated

import typer

from lagcli.cli.commands import completing, options
from lagcli.cli.terminal import exits


@exits.command
def models(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="[NAME]", help="a model of the gallery", autocompletion=completing.gallery_names
        ),
    ] = None,
    output: Annotated[
        str | None,
        typer.Option("-o", "--output", metavar="FILE", help="copy it to this file, or into this folder"),
    ] = None,
    force: options.ForceOption = False,
    no_schema: options.NoSchemaOption = False,
    as_json: Annotated[bool, typer.Option("--json", help="JSON on standard output")] = False,
    quiet: options.QuietOption = False,
    debug: options.DebugOption = False,
) -> None:
    """List the models of the gallery by subject, print one, or copy it with -o."""
    from lagcli.cli.actions import models_command

    if name is None and output is not None:
        raise exits.UsageError("-o copies one model: give its NAME; `lagcli models` lists them")
    if name is None:
        models_command.listed(as_json, quiet)
        return
    found = models_command.found(name)
    if output is None:
        models_command.printed(found, as_json)
    else:
        models_command.copied(found, output, not no_schema, force, quiet)
