"""`lagcli animate`: its options."""

from __future__ import annotations

from typing import Annotated

import typer

from lagcli.cli.commands import completing
from lagcli.cli.commands.options import (
    AssembleOption,
    DebugOption,
    FromOption,
    OutputStepOption,
    QuietOption,
    SetOption,
    VerboseOption,
)
from lagcli.cli.terminal import exits
from lagcli.model import settings


@exits.command
def animate(
    source: Annotated[
        str,
        typer.Argument(
            metavar="MODEL|FILE",
            help="a model, which is simulated, or a table of a run",
            autocompletion=completing.run_files,
        ),
    ],
    output: Annotated[
        str | None,
        typer.Option("-o", "--output", metavar="FILE", help="page: .html; film: .gif, .mp4; - for stdout"),
    ] = None,
    model: Annotated[
        str | None,
        typer.Option(
            "--model",
            metavar="MODEL",
            help="of a table: for masses, forces, rods and surfaces",
            autocompletion=completing.model_files,
        ),
    ] = None,
    duration: Annotated[float | None, typer.Option(help="length of the run")] = None,
    output_step: OutputStepOption = None,
    samples: Annotated[int | None, typer.Option(help="number of rows, both ends counted")] = None,
    rtol: Annotated[float | None, typer.Option(help="relative tolerance")] = None,
    atol: Annotated[float | None, typer.Option(help="absolute tolerance")] = None,
    max_step: Annotated[float | None, typer.Option("--max-step", help="no step is longer")] = None,
    method: Annotated[str | None, typer.Option(metavar="NAME", help=" or ".join(settings.METHODS))] = None,
    assemble: AssembleOption = False,
    begin: FromOption = None,
    changes: SetOption = None,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
    debug: DebugOption = False,
) -> None:
    """Write the motion as one page that needs nothing else: particles, rods, surfaces, R and F, lambda beside it.

    The page on standard output without -o. A model is simulated with its own settings. Exit 3 where the run stops
    before its end: the page of what there is stands in FILE.partial, and FILE is as it was.
    """
    from lagcli.cli.actions import animate_command

    given: animate_command.AnimatedRun = {
        "duration": duration, "output_step": output_step, "samples": samples, "rtol": rtol, "atol": atol,
        "max_step": max_step, "method": method, "assemble": True if assemble else None, "begin": begin,
    }  # fmt: skip
    options = animate_command.AnimateOptions(source, output, model, tuple(changes or ()), quiet, verbose)
    options.require(given)
    animate_command.run(options, given)
