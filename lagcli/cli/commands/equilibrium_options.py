"""`lagcli equilibrium`: its options."""

from __future__ import annotations

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
def equilibrium(
    model: ModelArgument,
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
    """Find the points of rest: with zero velocities and accelerations the equations of motion hold at every t.

    With lambda, R, the effective potential and the type by the bordered Hessian. Exit 4 where none is found.
    """
    from lagcli.cli import equilibrium_command, preflight

    options = preflight.PointOptions(output, starts, seed, limit, as_json, quiet)
    options.require(model)
    read = model_reading.reported(lambda: model_reading.load(model, changes), as_json)
    if verbose:
        exits.say_all(warning.render() for warning in read.warnings)
    model_reading.reported(lambda: equilibrium_command.run(read, options), as_json)
