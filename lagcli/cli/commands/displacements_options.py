"""`lagcli displacements`: its options."""

from __future__ import annotations

from typing import Annotated

import typer

from lagcli.cli.commands import options
from lagcli.cli.requests import model_reading
from lagcli.cli.terminal import exits


@exits.command
def displacements(
    model: options.ModelArgument,
    at: Annotated[
        float | None, typer.Option(metavar="T", help="the time to run to; by default the start")
    ] = None,
    assemble: options.AssembleOption = False,
    changes: options.SetOption = None,
    as_json: options.JsonOption = False,
    quiet: options.QuietOption = False,
    verbose: options.VerboseOption = False,
    debug: options.DebugOption = False,
) -> None:
    """Print bases of the allowed and virtual displacements, the dependent and independent components, and whether the
    forces between particles act along lines.

    Exit 3 where the motion stops before T.
    """
    from lagcli.cli.actions import displacements_command as displacing

    read = model_reading.read(model, changes, as_json)
    model_reading.reported(lambda: displacing.run(read, at, assemble, as_json, quiet), as_json)
