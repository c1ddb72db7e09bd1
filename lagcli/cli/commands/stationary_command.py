"""`lagcli stationary`: stationary points of a function on the surfaces of a model."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from lagcli.cli.commands import options, static_points_text
from lagcli.cli.terminal import exits
from lagcli.model import settings

if TYPE_CHECKING:
    from lagcli.model.model import Model
    from lagcli.statics.static_report import StaticReport


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

    def find(read: Model) -> StaticReport:
        from lagcli.api import stationary as finding

        return finding.stationary(read, of, starts=starts, seed=seed, limit=limit)

    asked = static_points_text.PointOptions(output, as_json, quiet)
    static_points_text.answer(model, changes, verbose, asked, find)
