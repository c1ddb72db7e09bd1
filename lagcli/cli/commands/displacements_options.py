"""`lagcli displacements`: its options."""

from __future__ import annotations

from typing import Annotated

import typer

from lagcli.cli import exits, model_reading
from lagcli.cli.options import (
    AssembleOption,
    DebugOption,
    JsonOption,
    ModelArgument,
    QuietOption,
    SetOption,
    VerboseOption,
)


@exits.command
def displacements(
    model: ModelArgument,
    at: Annotated[
        float | None, typer.Option(metavar="T", help="the time to run to; by default the start")
    ] = None,
    assemble: AssembleOption = False,
    changes: SetOption = None,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
    debug: DebugOption = False,
) -> None:
    """Print bases of the allowed and virtual displacements, the dependent and independent components, and whether the
    forces between particles act along lines.

    Exit 3 where the motion stops before T.
    """
    from lagcli.cli import displacements_command as displacing

    read = model_reading.reported(lambda: model_reading.load(model, changes), as_json)
    model_reading.reported(lambda: displacing.run(read, at, assemble, as_json, quiet), as_json)
