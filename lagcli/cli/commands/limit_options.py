"""`lagcli limit`: its options."""

from __future__ import annotations

from typing import Annotated

import typer

from lagcli.cli.commands import completing, options
from lagcli.cli.requests import model_reading
from lagcli.cli.terminal import exits


@exits.command
def limit(
    model: options.ModelArgument,
    constraint: Annotated[
        str,
        typer.Option(
            "--constraint",
            metavar="NAME",
            help="the holonomic row that becomes a spring",
            autocompletion=completing.holonomic,
        ),
    ],
    stiffness: Annotated[
        str | None,
        typer.Option(metavar="LOW:HIGH", help="stiffnesses, two a decade (1e3:1e5); LOW:HIGH:COUNT"),
    ] = None,
    unprestressed: Annotated[
        bool, typer.Option("--unprestressed", help="start without stretch, not on the slow motion")
    ] = False,
    ramp: Annotated[
        float | None,
        typer.Option("--ramp", metavar="SECONDS", help="one run in which k rises over all of them"),
    ] = None,
    output: Annotated[
        str | None, typer.Option("-o", "--output", metavar="FILE", help="table; - for standard output")
    ] = None,
    plot: Annotated[
        str | None, typer.Option("--plot", metavar="FILE", help="figure of forces and errors: png, svg, pdf")
    ] = None,
    duration: options.RunsDurationOption = None,
    output_step: options.OutputStepOption = None,
    samples: Annotated[int | None, typer.Option(help="number of rows, both ends counted")] = None,
    rtol: options.RunsRtolOption = None,
    atol: options.RunsAtolOption = None,
    max_step: options.RunsMaxStepOption = None,
    assemble: options.AssembleOption = False,
    changes: options.SetOption = None,
    as_json: options.JsonOption = False,
    quiet: options.QuietOption = False,
    verbose: options.VerboseOption = False,
    debug: options.DebugOption = False,
) -> None:
    """Replace a holonomic row f = 0 by the potential k f^2/2 for growing k, and set its force -k f against lambda.

    Runs start on the slow motion, where the spring pulls as the row does, and the error goes as 1/k. Exit 3 where a run
    stops before its end.
    """
    from lagcli.api.runs import run_settings
    from lagcli.cli.actions import limit_command

    model_reading.require_models([model])
    asked = limit_command.LimitOptions(
        constraint, stiffness, unprestressed, ramp, output, plot, as_json, quiet
    )
    asked.require(model)
    read = model_reading.read(model, changes, as_json, verbose)
    given: run_settings.RepeatedRuns = {
        "duration": duration, "output_step": output_step, "samples": samples, "rtol": rtol, "atol": atol,
        "max_step": max_step, "assemble": True if assemble else None,
    }  # fmt: skip
    model_reading.reported(lambda: limit_command.run(read, given, asked), as_json)
