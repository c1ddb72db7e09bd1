"""`lagcli derive`: the equations of motion of a model on standard output."""

from __future__ import annotations

import shutil
import sys
import time
from typing import Annotated

import typer

from lagcli.cli.commands import completing, options
from lagcli.cli.terminal import exits
from lagcli.model import settings
from lagcli.output.files import formats

# Text is at least and at most so wide on a terminal, and WIDTH where there is none.
NARROW, WIDE, WIDTH = 60, 140, 100
DERIVE_FORMATS = ("text", "latex", "markdown", "html", "json")


@options.command()
def derive(
    model: options.ModelArgument,
    form: Annotated[
        str, typer.Option("--format", metavar="FORMAT", help="text, latex, markdown, html or json")
    ] = "text",
    fragment: Annotated[bool, "with --format latex: the equations alone, aligned, for a paper"] = False,
    solve: Annotated[bool, "lambda and accelerations in closed form, up to four rows"] = False,
    everything: Annotated[
        bool, typer.Option("--all", help="every member of families and every term of sums")
    ] = False,
    values: Annotated[
        str,
        options.named("NAMES", "parameters to put in as numbers, such as 'm,g'; all", completing.parameters),
    ] = "",
    limit: options.LimitOption = settings.LIMIT,
    changes: options.SetOption = None,
    as_json: Annotated[bool, "as --format json"] = False,
    quiet: options.QuietOption = False,
    verbose: options.VerboseOption = False,
) -> None:
    """Print the equations of motion as they are written on paper, each line with its number in the text.

    Constraints, rows, reactions, energies, Newton's and Lagrange's equations, the identity between them verified, and
    the linear system for lambda.
    """
    form = "json" if as_json else form
    if form not in DERIVE_FORMATS:
        raise exits.UsageError(f"--format {form}: the formats are {', '.join(DERIVE_FORMATS)}")
    if fragment and form != "latex":
        raise exits.UsageError("--fragment is of --format latex; the other formats are pages")
    names = [name.strip() for name in values.split(",") if name.strip()]
    read = options.read(model, changes, form == "json")
    began = time.perf_counter()
    from lagcli.api import derive as deriving

    with options.refusals(form == "json", "--values: {}".format):
        page = deriving.derive(read, solve=solve, everything=everything, values=names, limit=limit)
    match form:
        case "latex":
            print(page.latex(fragment))
        case "markdown":
            print(page.markdown())
        case "html":
            print(page.html())
        case "json":
            print(formats.json_line(page.as_json()))
        case _:
            columns = shutil.get_terminal_size().columns - 1
            print(page.text(min(WIDE, max(NARROW, columns)) if sys.stdout.isatty() else WIDTH))
    if verbose:
        exits.print_warnings(() if quiet else read.warnings)
        exits.print_err(f"{read.path}: derived in {time.perf_counter() - began:.3f} s")
