"""`lagcli equilibrium`: the points of rest of a model."""

from __future__ import annotations

from lagcli.cli.commands import model_reading, options, static_points_text
from lagcli.cli.terminal import exits
from lagcli.model import settings
from lagcli.output.files import write_guard


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
    from lagcli.api import static_points

    write_guard.require_outputs(model, output, None, as_json)
    read = model_reading.read(model, changes, as_json, verbose)
    with model_reading.refusals(as_json, "--{}".format):
        found = static_points.equilibrium(read, starts=starts, seed=seed, limit=limit)
    static_points_text.print_report(read, found, output, as_json, quiet)
