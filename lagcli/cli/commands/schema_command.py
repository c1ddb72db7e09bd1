"""`lagcli schema`: the JSON Schema of model files."""

from __future__ import annotations

from typing import Annotated

import typer

from lagcli.cli.commands import options
from lagcli.cli.terminal import exits


@exits.command
def schema(
    output: Annotated[
        str | None,
        typer.Option(
            "-o", "--output", metavar="FILE", help="write it to this file, lagcli.schema.json as a rule"
        ),
    ] = None,
    force: options.ForceOption = False,
    quiet: options.QuietOption = False,
    debug: options.DebugOption = False,
) -> None:
    """Print the JSON Schema of model files (draft 7), by which editors complete, explain and check keys.

    New models name lagcli.schema.json, in their own folder, on their first line.
    """
    from lagcli.cli.commands import new_files
    from lagcli.input import format_schema

    name = output or new_files.STDOUT
    new_files.write(name, format_schema.text(), force=force, may_replace=new_files.is_schema)
    if name != new_files.STDOUT and not quiet:
        exits.print_err(f"wrote {name}")
