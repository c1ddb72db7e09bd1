"""`lagcli equilibrium`: its options."""

from __future__ import annotations

from lagcli.cli.commands import options
from lagcli.cli.requests import model_reading
from lagcli.cli.terminal import exits
from lagcli.model import settings


@exits.command
def equilibrium(
    model: options.ModelArgument,
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
    """Find the points of rest: with zero velocities and accelerations the equations of motion hold at every t.

    With lambda, R, the effective potential and the type by the bordered Hessian. Exit 4 where none is found.
    """
    from lagcli.cli.actions import equilibrium_command, static_points_command

    asked = static_points_command.PointOptions(output, starts, seed, limit, as_json, quiet)
    asked.require(model)
    read = model_reading.read(model, changes, as_json, verbose)
    model_reading.reported(lambda: equilibrium_command.run(read, asked), as_json)
