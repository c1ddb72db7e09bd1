"""`lagcli equilibrium`: the points of rest of a model."""

from __future__ import annotations

from typing import TYPE_CHECKING

from lagcli.cli.commands import model_reading, options, static_points_text
from lagcli.cli.commands.static_points_text import PointOptions
from lagcli.cli.terminal import exits
from lagcli.model import settings

if TYPE_CHECKING:
    from lagcli.model.model import Model


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
    asked = static_points_text.PointOptions(output, starts, seed, limit, as_json, quiet)
    asked.require(model)
    read = model_reading.read(model, changes, as_json, verbose)
    model_reading.reported(lambda: carry_out(read, asked), as_json)


def carry_out(model: Model, options: PointOptions) -> None:
    """Find the points of rest and print them. Raises `exits.UsageError`, `exits.Exit`."""
    from lagcli.api import equilibrium as finding

    try:
        found = finding.equilibrium(model, starts=options.starts, seed=options.seed, limit=options.limit)
    except ValueError as error:
        raise exits.UsageError(f"--{error}") from None
    static_points_text.print_report(model, found, options)
