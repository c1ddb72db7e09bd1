"""`lagcli plot`: columns of tables and models in a figure, or in the terminal."""

from __future__ import annotations

import dataclasses
import os
import sys
from typing import TYPE_CHECKING, Annotated, BinaryIO

import typer

from lagcli.cli.commands import completing, options
from lagcli.cli.terminal import console, exits
from lagcli.model.settings import RunSettings
from lagcli.output.files import formats, write_guard

if TYPE_CHECKING:
    from lagcli.api.plot import DrawnRuns
    from lagcli.model.model import Model
    from lagcli.output.figures.compose import ChartChoice

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
@options.with_run_settings()
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
    *,
    run_settings: RunSettings,
    begin: options.FromOption = None,
    changes: options.SetOption = None,
    watch: options.WatchOption = False,
    quiet: options.QuietOption = False,
    debug: options.DebugOption = False,
) -> None:
    """Draw columns of tables and models: over t or another column, as paths, several runs overlaid.

    Without --y and --xy the multipliers. Exit 3 where the run of a model stops before its end: the rows so far are
    drawn; without one no figure is made.
    """
    from lagcli.output.figures import compose

    choice = compose.chosen(y or (), x=x, xy=xy or (), is_log=log, title=title)
    asked = PlotOptions(
        tuple(files), choice, events, run_settings, begin, output, show, tuple(changes or ()), quiet
    )
    asked.require()
    if watch:
        options.follow(
            [*asked.files, *([events] if events is not None else [])], lambda: carry_out(asked), quiet
        )
    carry_out(asked)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class PlotOptions:
    """Options of `plot`: which files, what of them and of models with `changes` (`--set`) is drawn, and where; run,
    begin: the settings of the runs of models and the row that they start from."""

    files: tuple[str, ...]
    choice: ChartChoice
    events: str | None
    run: RunSettings
    begin: str | None
    output: str | None
    show: bool
    changes: tuple[str, ...]
    quiet: bool

    def require(self) -> None:
        """Refuse what cannot be done for these files."""
        options.require_models(list(self.files))
        if self.output is not None:
            write_guard.require_endings((self.output, formats.FIGURES))
        elif not self.show and not sys.stdout.isatty():
            raise exits.UsageError("nothing to draw on: give -o FILE.png (svg, pdf), or --show for text")
        if self.events is not None:
            write_guard.require_endings((self.events, formats.TABLES))
            if not os.path.exists(self.events):
                raise exits.UsageError(f"--events: there is no file {self.events}")
        given = {**self.run, "from": self.begin, "set": self.changes or None}
        given_options = [f"--{name.replace('_', '-')}" for name, value in given.items() if value is not None]
        if given_options and not any(map(_is_model, self.files)):
            raise exits.UsageError(
                f"{given_options[0]} is for a MODEL that is simulated, and there are tables alone"
            )
        if self.output is not None:
            read = [*(("MODEL", name) for name in self.files), ("--events", self.events)]
            write_guard.require(read, ("--output", self.output, formats.FIGURES))


def _is_model(name: str) -> bool:
    return name != "-" and not formats.is_table(name)


def carry_out(asked: PlotOptions) -> None:
    """Read, simulate, draw; nothing is kept, so that it may be called again when a file has changed.

    Raises `exits.UsageError`, `write_guard.WriteError`, `diagnostics.ModelError`, and `exits.Exit` with 3 where a run
    stopped before its end, after its rows have been drawn, if there are any.
    """
    from lagcli.api import plot as plotting

    def source(name: str) -> BinaryIO | str | Model:
        if _is_model(name):
            return options.load(name, list(asked.changes))
        return sys.stdin.buffer if name == "-" else name

    drawn: DrawnRuns | None = None
    sources = map(source, asked.files)
    for step in plotting.steps(sources, asked.choice, asked.events, asked.run, asked.begin):
        if not isinstance(step, str):
            drawn = step
        elif not asked.quiet:
            exits.print_err(f"note: {step}")
    assert drawn is not None
    if drawn.is_empty:
        exits.print_err_all(f"lagcli: {reason}; there is no row to draw" for reason in drawn.stopped)
        raise exits.Exit(exits.STOPPED)
    if asked.output is not None:
        with write_guard.drawing(asked.output):
            from lagcli.output.figures import chart_figure, figure_page

            figure_page.write(asked.output, chart_figure.compose(drawn.chart))
    if asked.show or asked.output is None:
        from lagcli.output.figures import chart_terminal

        columns = console.width() if sys.stdout.isatty() else console.USUAL
        look = chart_terminal.TerminalLook(columns, not console.is_plain(sys.stdout))
        print("\n".join(chart_terminal.lines(drawn.chart, look)))
    if drawn.stopped:
        exits.print_err_all(f"lagcli: {reason}" for reason in drawn.stopped)
        raise exits.Exit(exits.STOPPED)
