"""`lagcli limit`: its options."""

from __future__ import annotations

from typing import Annotated

import typer

from lagcli.cli import completing, exits, model_reading
from lagcli.cli.options import (
    AssembleOption,
    DebugOption,
    JsonOption,
    ModelArgument,
    OutputStepOption,
    QuietOption,
    SetOption,
    VerboseOption,
)


@exits.command
def limit(
    model: ModelArgument,
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
    duration: Annotated[float | None, typer.Option(help="length of the runs")] = None,
    output_step: OutputStepOption = None,
    samples: Annotated[int | None, typer.Option(help="number of rows, both ends counted")] = None,
    rtol: Annotated[float | None, typer.Option(help="relative tolerance of the runs")] = None,
    atol: Annotated[float | None, typer.Option(help="absolute tolerance of the runs")] = None,
    max_step: Annotated[
        float | None, typer.Option("--max-step", help="no step of the runs is longer")
    ] = None,
    assemble: AssembleOption = False,
    changes: SetOption = None,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
    debug: DebugOption = False,
) -> None:
    """Replace a holonomic row f = 0 by the potential k f^2/2 for growing k, and set its force -k f against lambda.

    Runs start on the slow motion, where the spring pulls as the row does, and the error goes as 1/k. Exit 3 where a run
    stops before its end.
    """
    from lagcli.cli import limit_command, preflight

    preflight.require_models([model])
    options = preflight.LimitOptions(constraint, stiffness, unprestressed, ramp, output, plot, as_json, quiet)
    options.require(model)
    read = model_reading.reported(lambda: model_reading.load(model, changes), as_json)
    given: preflight.RepeatedRuns = {
        "duration": duration, "output_step": output_step, "samples": samples, "rtol": rtol, "atol": atol,
        "max_step": max_step, "assemble": True if assemble else None,
    }  # fmt: skip
    if verbose:
        exits.say_all(warning.render() for warning in read.warnings)
    model_reading.reported(lambda: limit_command.run(read, given, options), as_json)
