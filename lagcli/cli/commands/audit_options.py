"""`lagcli audit`: its options."""

from __future__ import annotations

from typing import Annotated

import typer

from lagcli.cli.commands import options
from lagcli.cli.requests import model_reading
from lagcli.cli.terminal import exits
from lagcli.output.files import formats


@exits.command
def audit(
    model: options.ModelArgument,
    run: Annotated[
        str | None,
        typer.Option("--run", metavar="FILE", help=f"a table: {formats.LISTED}; else a new run"),
    ] = None,
    events: Annotated[
        str | None,
        typer.Option("--events", metavar="FILE", help="the events of that run, of `simulate --events`"),
    ] = None,
    plot: Annotated[
        str | None, typer.Option("--plot", metavar="FILE", help="figure of the checks: png, svg, pdf")
    ] = None,
    duration: Annotated[float | None, typer.Option(help="length of the new run")] = None,
    samples: Annotated[int | None, typer.Option(help="number of rows of the new run")] = None,
    rtol: Annotated[float | None, typer.Option(help="relative tolerance of the run")] = None,
    atol: Annotated[float | None, typer.Option(help="absolute tolerance of the run")] = None,
    max_step: Annotated[
        float | None, typer.Option("--max-step", help="no step of the new run is longer")
    ] = None,
    assemble: options.AssembleOption = False,
    digits: Annotated[
        bool, typer.Option("--digits", help="how many digits of the table are right, from the run repeated")
    ] = False,
    changes: options.SetOption = None,
    as_json: options.JsonOption = False,
    quiet: options.QuietOption = False,
    verbose: options.VerboseOption = False,
    debug: options.DebugOption = False,
) -> None:
    """Check a table of t, r, v, lambda, R against the laws of the model, without the functions of the solver.

    Exit 1 where a check fails, 3 where the new run stops before its end.
    """
    from lagcli.cli.actions import audit_command

    has_rows = duration is not None or samples is not None
    asked = audit_command.AuditOptions(run, events, plot, digits, as_json, quiet, verbose, has_rows)
    asked.require(model)
    read = model_reading.read(model, changes, as_json)
    given: audit_command.AuditedRun = {
        "duration": duration, "samples": samples, "rtol": rtol, "atol": atol,
        "max_step": max_step, "assemble": True if assemble else None,
    }  # fmt: skip
    model_reading.reported(lambda: audit_command.run(read, given, asked), as_json)
