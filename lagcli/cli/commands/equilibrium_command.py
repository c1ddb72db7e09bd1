"""`lagcli equilibrium`: the points of rest of a model."""

from __future__ import annotations

from typing import TYPE_CHECKING

from lagcli.cli.commands import options, static_points_text
from lagcli.cli.terminal import exits
from lagcli.model import settings

if TYPE_CHECKING:
    from lagcli.model.model import Model
    from lagcli.statics.static_report import StaticReport


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

    def find(read: Model) -> StaticReport:
        from lagcli.api import equilibrium as finding

        return finding.equilibrium(read, starts=starts, seed=seed, limit=limit)

    asked = static_points_text.PointOptions(output, as_json, quiet)
    static_points_text.answer(model, changes, verbose, asked, find)
