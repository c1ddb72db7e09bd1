"""`lagcli stationary`: its options."""

from __future__ import annotations

from typing import Annotated

import typer

from lagcli.cli.commands import options
from lagcli.cli.requests import model_reading
from lagcli.cli.terminal import exits
from lagcli.model import settings


@exits.command
def stationary(
    model: options.ModelArgument,
    of: Annotated[str, typer.Option("--of", metavar="EXPR", help="the function, such as 'a.x*a.y'")],
    output: options.PointsOption = None,
    starts: options.StartsOption = 32,
    seed: options.SeedOption = 0,
    limit: options.LimitOption = settings.LIMIT,
    changes: options.SetOption = None,
    as_json: options.JsonOption = False,
    quiet: options.QuietOption = False,
    verbose: options.VerboseOption = False,
    debug: options.DebugOption = False,
) -> None:
    """Find the stationary points of a function of the coordinates on the holonomic surfaces, with their multipliers.

    Masses and forces play no part. Exit 4 where none is found.
    """
    from lagcli.cli.actions import static_points_command, stationary_command

    asked = static_points_command.PointOptions(output, starts, seed, limit, as_json, quiet)
    asked.require(model)
    read = model_reading.read(model, changes, as_json, verbose)
    model_reading.reported(lambda: stationary_command.run(read, of, asked), as_json)
