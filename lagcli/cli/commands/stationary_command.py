"""`lagcli stationary`: stationary points of a function on the surfaces of a model."""

from __future__ import annotations

from typing import Annotated

from lagcli.cli.commands import equilibrium_command, options
from lagcli.model import settings
from lagcli.output.files import write_guard


@options.command()
def stationary(
    model: options.ModelArgument,
    of: Annotated[str, options.named("EXPR", "the function, such as 'a.x*a.y'")],
    output: options.PointsOption = None,
    starts: options.StartsOption = 32,
    seed: options.SeedOption = 0,
    limit: options.LimitOption = settings.LIMIT,
    changes: options.SetOption = None,
    as_json: options.JsonOption = False,
    quiet: options.QuietOption = False,
    verbose: options.VerboseOption = False,
) -> None:
    """Find the stationary points of a function of the coordinates on the holonomic surfaces, with their multipliers.

    Masses and forces play no part. Exit 4 where none is found.
    """
    from lagcli.api import static_points

    write_guard.require_outputs(model, output, None, as_json)
    read = options.read(model, changes, as_json, verbose)
    with options.refusals(as_json, "--{}".format):
        found = static_points.stationary(read, of, starts=starts, seed=seed, limit=limit)
    equilibrium_command.print_report(read, found, output, as_json, quiet)
