"""`lagcli modes`: its options."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from lagcli.cli.commands import options
from lagcli.cli.requests import model_reading
from lagcli.cli.terminal import exits
from lagcli.model import settings

if TYPE_CHECKING:
    from lagcli.api import find_modes


@exits.command
def modes(
    model: options.ModelArgument,
    plot: Annotated[
        str | None, typer.Option("--plot", metavar="FILE", help="figure of the shapes: png, svg, pdf")
    ] = None,
    about: Annotated[
        str, typer.Option(metavar="WHAT", help="start, equilibrium, or the one that fits: auto")
    ] = "auto",
    lowest: Annotated[
        int | None,
        typer.Option(metavar="N", help="how many modes of a model of more than 600 coordinates (20)"),
    ] = None,
    animate: Annotated[
        str | None,
        typer.Option("--animate", metavar="FILE", help="the modes as a page (.html) that shows them swing"),
    ] = None,
    assemble: options.AssembleOption = False,
    limit: options.LimitOption = settings.LIMIT,
    changes: options.SetOption = None,
    as_json: options.JsonOption = False,
    quiet: options.QuietOption = False,
    verbose: options.VerboseOption = False,
    debug: options.DebugOption = False,
) -> None:
    """Linearize about the start, if that is an equilibrium or a steady motion, else about the nearest equilibrium, and
    print frequencies, shapes and whether it is stable.

    Exit 4 where there is no equilibrium to be found.
    """
    from lagcli.cli.actions import modes_command

    asked = modes_command.ModesOptions(plot, animate, as_json, quiet)
    asked.require(model)
    read = model_reading.read(model, changes, as_json, verbose)
    given: find_modes.ModesSettings = {
        "about": about, "assemble": True if assemble else None, "limit": limit,
        "lowest": lowest,
    }  # fmt: skip
    model_reading.reported(lambda: modes_command.run(read, given, asked), as_json)
