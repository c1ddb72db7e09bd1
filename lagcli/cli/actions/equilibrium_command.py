"""`lagcli equilibrium`: the points of rest of a model."""

from __future__ import annotations

from lagcli.api import equilibrium
from lagcli.cli.actions import static_points_command
from lagcli.cli.actions.static_points_command import PointOptions
from lagcli.cli.terminal import exits
from lagcli.model.model import Model


def run(model: Model, options: PointOptions) -> None:
    """Find the points of rest and print them. Raises `exits.UsageError`, `exits.Exit`."""
    try:
        found = equilibrium.equilibrium(model, starts=options.starts, seed=options.seed, limit=options.limit)
    except ValueError as error:
        raise exits.UsageError(f"--{error}") from None
    static_points_command.print_report(model, found, options)
