"""`lagcli derive`: its options."""

from __future__ import annotations

import time
from typing import Annotated

import typer

from lagcli.cli.commands import completing, options
from lagcli.cli.requests import model_reading
from lagcli.cli.terminal import exits
from lagcli.model import settings


@exits.command
def derive(
    model: options.ModelArgument,
    form: Annotated[
        str, typer.Option("--format", metavar="FORMAT", help="text, latex, markdown, html or json")
    ] = "text",
    fragment: Annotated[
        bool,
        typer.Option("--fragment", help="with --format latex: the equations alone, aligned, for a paper"),
    ] = False,
    solve: Annotated[
        bool, typer.Option("--solve", help="lambda and accelerations in closed form, up to four rows")
    ] = False,
    everything: Annotated[
        bool, typer.Option("--all", help="every member of families and every term of sums")
    ] = False,
    values: Annotated[
        str,
        typer.Option(
            metavar="NAMES",
            help="parameters to put in as numbers, such as 'm,g'; all",
            autocompletion=completing.parameters,
        ),
    ] = "",
    limit: options.LimitOption = settings.LIMIT,
    changes: options.SetOption = None,
    as_json: Annotated[bool, typer.Option("--json", help="as --format json")] = False,
    quiet: options.QuietOption = False,
    verbose: options.VerboseOption = False,
    debug: options.DebugOption = False,
) -> None:
    """Print the equations of motion as they are written on paper, each line with its number in the text.

    Constraints, rows, reactions, energies, Newton's and Lagrange's equations, the identity between them verified, and
    the linear system for lambda.
    """
    from lagcli.cli.actions import derive_command

    form = "json" if as_json else form
    asked = derive_command.DeriveOptions(form, fragment, solve, everything, values, limit)
    asked.require()
    read = model_reading.read(model, changes, form == "json")
    began = time.perf_counter()
    page = model_reading.reported(lambda: derive_command.derived(read, asked), form == "json")
    derive_command.write(page, form, fragment)
    if not quiet:
        exits.print_err_all(warning.render() for warning in (read.warnings if verbose else ()))
    if verbose:
        exits.print_err(f"{read.path}: derived in {time.perf_counter() - began:.3f} s")
