"""`lagcli simulate`: its options."""

from __future__ import annotations

from typing import Annotated

import typer

from lagcli.cli.commands import completing, options
from lagcli.cli.requests import model_reading
from lagcli.cli.terminal import exits
from lagcli.model import settings


@exits.command
def simulate(
    model: options.ModelArgument,
    output: options.OutputOption = None,
    plot: Annotated[
        str | None, typer.Option("--plot", metavar="FILE", help="figure of lambda and R: png, svg, pdf")
    ] = None,
    duration: Annotated[float | None, typer.Option(help="length of the run")] = None,
    output_step: options.OutputStepOption = None,
    samples: Annotated[int | None, typer.Option(help="number of rows, both ends counted")] = None,
    rtol: Annotated[float | None, typer.Option(help="relative tolerance")] = None,
    atol: Annotated[float | None, typer.Option(help="absolute tolerance")] = None,
    max_step: Annotated[
        float | None, typer.Option("--max-step", help="no step is longer: for forces that steps may miss")
    ] = None,
    method: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help=" or ".join(settings.METHODS),
            autocompletion=completing.methods,
        ),
    ] = None,
    assemble: options.AssembleOption = False,
    columns: options.ColumnsOption = None,
    events: options.EventsOption = None,
    event_rows: options.EventRowsOption = False,
    stats: Annotated[str | None, typer.Option(metavar="FILE", help="the account of the run as JSON")] = None,
    checkpoint: options.CheckpointOption = None,
    resume: options.ResumeOption = None,
    begin: options.FromOption = None,
    digits: options.DigitsOption = False,
    limit: options.LimitOption = settings.LIMIT,
    changes: options.SetOption = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="errors, and the account if stdout is free, as JSON on stdout")
    ] = False,
    quiet: options.QuietOption = False,
    verbose: options.VerboseOption = False,
    debug: options.DebugOption = False,
) -> None:
    """Integrate m a = F + sum lambda_i B_i and write t, r, v, lambda, R, energy as a table.

    CSV on standard output without -o and --plot. Exit 3 where the integration stops before its end: the rows
    so far are in FILE.partial, and FILE is as it was.
    """
    from lagcli.api import simulate_to_files
    from lagcli.cli.actions import simulate_command
    from lagcli.output.runs import run_request

    asked = run_request.RunRequest(
        output, plot, stats, columns, as_json, quiet, verbose,
        checkpoint, resume, limit, digits, events, event_rows,
    )  # fmt: skip
    asked.require(model)
    read = model_reading.read(model, changes, as_json)
    given = {
        "duration": duration, "output_step": output_step, "samples": samples, "rtol": rtol, "atol": atol,
        "max_step": max_step, "method": method, "assemble": True if assemble else None,
    }  # fmt: skip
    written = model_reading.reported(lambda: simulate_to_files.begin(read, given, asked, begin), as_json)
    simulate_command.run(written, asked)
