"""`lagcli compare`: its options."""

from __future__ import annotations

from typing import Annotated

import typer

from lagcli.cli.commands import completing, options
from lagcli.cli.requests import model_reading
from lagcli.cli.terminal import exits

OtherArgument = Annotated[
    str | None,
    typer.Argument(
        metavar="[OTHER]",
        help="a second model, compared on shared columns",
        autocompletion=completing.model_files,
    ),
]
MuOption = Annotated[
    list[str] | None,
    typer.Option(
        "--mu",
        metavar="NAME=VALUE",
        help="initial μ of a differential row (0); repeatable",
        autocompletion=completing.multipliers,
    ),
]
ComparedOption = Annotated[
    str | None,
    typer.Option(
        metavar="PATTERNS",
        help="columns to compare, such as 'a.*,R.*'",
        autocompletion=completing.columns,
    ),
]


@exits.command
def compare(
    model: options.ModelArgument,
    other: OtherArgument = None,
    duration: options.RunsDurationOption = None,
    output_step: options.OutputStepOption = None,
    samples: Annotated[int | None, typer.Option(help="number of rows, both ends counted (101)")] = None,
    rtol: options.RunsRtolOption = None,
    atol: options.RunsAtolOption = None,
    max_step: options.RunsMaxStepOption = None,
    assemble: options.AssembleOption = False,
    columns: ComparedOption = None,
    tolerance: Annotated[
        float | None,
        typer.Option(help="largest difference that passes, as a part of the largest value (1e-8)"),
    ] = None,
    vakonomic: Annotated[
        bool, typer.Option("--vakonomic", help="also the motion of the other principle, with multipliers μ")
    ] = False,
    mu: MuOption = None,
    output: Annotated[
        str | None,
        typer.Option("-o", "--output", metavar="FILE", help="table of the vakonomic motion; - for stdout"),
    ] = None,
    plot: Annotated[
        str | None, typer.Option("--plot", metavar="FILE", help="figure of the two motions: png, svg, pdf")
    ] = None,
    changes: options.SetOption = None,
    as_json: options.JsonOption = False,
    quiet: options.QuietOption = False,
    verbose: options.VerboseOption = False,
    debug: options.DebugOption = False,
) -> None:
    """Run a model in every formulation that fits, or two models, and show to how many digits they agree.

    Newton with multipliers, Lagrange with multipliers, reduced by the null space; with --vakonomic also the motion that
    makes the action stationary among those that satisfy the rows, which in general is another one. Exit 1 where
    formulations disagree, 3 where a run stops before its end.
    """
    from lagcli.api.runs import run_settings
    from lagcli.cli.actions import compare_command
    from lagcli.cli.files import principles_output

    paths = [model] if other is None else [model, other]
    model_reading.require_models(paths)
    principles = principles_output.PrinciplesOptions(vakonomic, tuple(mu or ()), output, plot)
    principles.require(paths, as_json)
    read = model_reading.reported(lambda: [model_reading.load(path, changes) for path in paths], as_json)
    given: run_settings.RepeatedRuns = {
        "duration": duration, "output_step": output_step, "samples": samples, "rtol": rtol, "atol": atol,
        "max_step": max_step, "assemble": True if assemble else None,
    }  # fmt: skip
    asked = compare_command.CompareOptions(columns, tolerance, as_json, quiet, principles)
    if verbose:
        exits.print_err_all(warning.render() for one in read for warning in one.warnings)
    second = read[1] if other is not None else None
    model_reading.reported(lambda: compare_command.run(read[0], second, given, asked), as_json)
