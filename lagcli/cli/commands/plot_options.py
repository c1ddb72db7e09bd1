"""`lagcli plot`: its options."""

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
    WatchOption,
)
from lagcli.cli.terminal import exits
from lagcli.model import settings
from lagcli.output.files import formats

FilesArgument = Annotated[
    list[str],
    typer.Argument(
        metavar="FILE...",
        help=f"tables ({formats.LISTED}; - for CSV on standard input), or models, to be simulated",
        autocompletion=completing.run_files,
    ),
]
YOption = Annotated[
    list[str] | None,
    typer.Option(
        "--y",
        metavar="PATTERNS",
        help="columns, such as 'lambda.*,R.a.z', or one made of others, 'pull=abs(lambda.rod)'; again for more axes",
        autocompletion=completing.columns,
    ),
]
XOption = Annotated[
    str | None,
    typer.Option(
        "--x", metavar="COLUMN", help="the column of the other axis (t)", autocompletion=completing.columns
    ),
]
PathOption = Annotated[
    list[str] | None,
    typer.Option(
        "--xy",
        metavar="X,Y",
        help="a path with one scale, such as a.x,a.z; repeatable",
        autocompletion=completing.columns,
    ),
]


@exits.command
def plot(
    files: FilesArgument,
    y: YOption = None,
    x: XOption = None,
    xy: PathOption = None,
    events: Annotated[
        str | None,
        typer.Option("--events", metavar="FILE", help="mark the events of `simulate --events`"),
    ] = None,
    log: Annotated[bool, typer.Option("--log", help="sizes on a logarithmic scale")] = False,
    title: Annotated[
        str | None, typer.Option("--title", metavar="TEXT", help="in place of the model's")
    ] = None,
    output: Annotated[
        str | None, typer.Option("-o", "--output", metavar="FILE", help="the figure: png, svg, pdf")
    ] = None,
    show: Annotated[
        bool, typer.Option("--show", help="draw in the terminal, which is usual without -o")
    ] = False,
    duration: Annotated[float | None, typer.Option(help="length of the run of a model")] = None,
    output_step: OutputStepOption = None,
    samples: Annotated[int | None, typer.Option(help="number of its rows, both ends counted")] = None,
    rtol: Annotated[float | None, typer.Option(help="its relative tolerance")] = None,
    atol: Annotated[float | None, typer.Option(help="its absolute tolerance")] = None,
    max_step: Annotated[float | None, typer.Option("--max-step", help="no step of it is longer")] = None,
    method: Annotated[str | None, typer.Option(metavar="NAME", help=" or ".join(settings.METHODS))] = None,
    assemble: AssembleOption = False,
    begin: FromOption = None,
    changes: SetOption = None,
    watch: WatchOption = False,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> None:
    """Draw columns of tables and models: over t or another column, as paths, several runs overlaid.

    Without --y and --xy the multipliers. Exit 3 where the run of a model stops before its end: the rows so far are
    drawn.
    """
    from lagcli.cli.actions import plot_command
    from lagcli.cli.requests import asked_plot
    from lagcli.cli.terminal import watching

    run = {
        "duration": duration, "output_step": output_step, "samples": samples, "rtol": rtol, "atol": atol,
        "max_step": max_step, "method": method, "assemble": True if assemble else None,
    }  # fmt: skip
    options = asked_plot.PlotOptions(
        tuple(files), tuple(y or ()), x, tuple(xy or ()), events, log, title, output, show,
        tuple(changes or ()), run, begin, quiet,
    )  # fmt: skip
    options.require()
    if watch:
        watching.follow(options.read, lambda: plot_command.run(options), quiet)
    plot_command.run(options)
