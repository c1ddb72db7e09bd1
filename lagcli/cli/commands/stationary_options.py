"""`lagcli stationary`: its options."""

from __future__ import annotations

from typing import Annotated

import typer

from lagcli.cli import exits, model_reading
from lagcli.cli.options import (
    DebugOption,
    JsonOption,
    LimitOption,
    ModelArgument,
    PointsOption,
    QuietOption,
    SeedOption,
    SetOption,
    StartsOption,
    VerboseOption,
)
from lagcli.model import settings


@exits.command
def stationary(
    model: ModelArgument,
    of: Annotated[str, typer.Option("--of", metavar="EXPR", help="the function, such as 'a.x*a.y'")],
    output: PointsOption = None,
    starts: StartsOption = 32,
    seed: SeedOption = 0,
    limit: LimitOption = settings.LIMIT,
    changes: SetOption = None,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
    debug: DebugOption = False,
) -> None:
    """Find the stationary points of a function of the coordinates on the holonomic surfaces, with their multipliers.

    Masses and forces play no part. Exit 4 where none is found.
    """
    from lagcli.cli import preflight, stationary_command

    options = preflight.PointOptions(output, starts, seed, limit, as_json, quiet)
    options.require(model)
    read = model_reading.reported(lambda: model_reading.load(model, changes), as_json)
    if verbose:
        exits.say_all(warning.render() for warning in read.warnings)
    model_reading.reported(lambda: stationary_command.run(read, of, options), as_json)
