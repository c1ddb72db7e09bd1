"""`lagcli stationary`: stationary points of a function on the surfaces of a model."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from lagcli.cli.commands import model_reading, options, static_points_text
from lagcli.cli.commands.static_points_text import PointOptions
from lagcli.cli.terminal import exits
from lagcli.model import settings

if TYPE_CHECKING:
    from lagcli.model.model import Model


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
    asked = static_points_text.PointOptions(output, starts, seed, limit, as_json, quiet)
    asked.require(model)
    read = model_reading.read(model, changes, as_json, verbose)
    model_reading.reported(lambda: carry_out(read, of, asked), as_json)


def carry_out(model: Model, of: str, options: PointOptions) -> None:
    """Find the stationary points and print them. Raises `exits.UsageError`, `exits.Exit`."""
    from lagcli.api import stationary as finding

    try:
        found = finding.stationary(model, of, starts=options.starts, seed=options.seed, limit=options.limit)
    except ValueError as error:
        raise exits.UsageError(f"--{error}") from None
    static_points_text.print_report(model, found, options)
