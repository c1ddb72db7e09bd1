"""`lagcli check`: its options."""

from __future__ import annotations

from typing import Annotated

import typer

from lagcli.cli.commands import completing, options
from lagcli.cli.terminal import exits
from lagcli.model import settings


@exits.command
def check(
    models: Annotated[
        list[str],
        typer.Argument(
            metavar="MODEL...",
            help="model files; - for standard input",
            autocompletion=completing.model_files,
        ),
    ],
    changes: options.SetOption = None,
    as_json: options.JsonOption = False,
    strict: Annotated[bool, typer.Option("--strict", help="exit 1 on warnings")] = False,
    assemble: options.AssembleOption = False,
    limit: options.LimitOption = settings.LIMIT,
    witness: Annotated[
        str | None,
        typer.Option(
            "--witness",
            metavar="NAME",
            help="a loop that shows a row to be nonholonomic",
            autocompletion=completing.differential,
        ),
    ] = None,
    plot: Annotated[
        str | None, typer.Option("--plot", metavar="FILE", help="figure of that loop: png, svg, pdf")
    ] = None,
    watch: options.WatchOption = False,
    quiet: options.QuietOption = False,
    verbose: options.VerboseOption = False,
    debug: options.DebugOption = False,
) -> None:
    """Classify the constraints, count the degrees of freedom, check the initial values.

    With --json one object for one MODEL; for several a list in the order of the MODELs, each with path and title.
    """
    from lagcli.cli.actions import check_command
    from lagcli.cli.requests import asked_check
    from lagcli.cli.terminal import watching

    asked = asked_check.CheckOptions(strict, assemble, limit, witness, plot, as_json, quiet, verbose)
    asked.require(models)
    if watch:
        watching.follow(models, lambda: check_command.run(models, changes, asked), quiet)
    check_command.run(models, changes, asked)
