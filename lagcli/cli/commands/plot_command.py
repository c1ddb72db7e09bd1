"""`lagcli plot`: columns of tables and models in a figure, or in the terminal."""

from __future__ import annotations

import contextlib
import dataclasses
import os
import pathlib
import sys
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated

import typer

from lagcli.cli.commands import completing, model_reading
from lagcli.cli.commands.options import (
    AssembleOption,
    DebugOption,
    FromOption,
    OutputStepOption,
    QuietOption,
    SetOption,
    WatchOption,
)
from lagcli.cli.terminal import console, exits
from lagcli.model import settings
from lagcli.output.files import file_requests, formats, write_guard

if TYPE_CHECKING:
    from collections.abc import Iterator

    from lagcli.output.charts.chart import ChartData
    from lagcli.output.charts.chart_table import ChartTable
    from lagcli.output.trajectory import Trajectory


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
    from lagcli.cli.terminal import watching

    run = {
        "duration": duration, "output_step": output_step, "samples": samples, "rtol": rtol, "atol": atol,
        "max_step": max_step, "method": method, "assemble": True if assemble else None,
    }  # fmt: skip
    options = PlotOptions(
        tuple(files), tuple(y or ()), x, tuple(xy or ()), events, log, title, output, show,
        tuple(changes or ()), run, begin, quiet,
    )  # fmt: skip
    options.require()
    if watch:
        watching.follow(options.read, lambda: carry_out(options), quiet)
    carry_out(options)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class PlotOptions:
    """Options of `plot`: what is drawn, and where; of models `changes` (`--set`), `run` (the settings) and `begin`."""

    files: tuple[str, ...]
    y: tuple[str, ...] = ()
    x: str | None = None
    xy: tuple[str, ...] = ()
    events: str | None = None
    log: bool = False
    title: str | None = None
    output: str | None = None
    show: bool = False
    changes: tuple[str, ...] = ()
    run: Mapping[str, float | int | str | bool | None] = dataclasses.field(default_factory=dict)
    begin: str | None = None
    quiet: bool = False

    @property
    def read(self) -> tuple[str, ...]:
        """The files that are read, but that of `--from`, which is where a run begins."""
        return (*self.files, *([self.events] if self.events is not None else []))

    @property
    def models(self) -> tuple[str, ...]:
        """The files that are models, by their endings."""
        return tuple(name for name in self.files if name != "-" and not is_table(name))

    @property
    def is_shown(self) -> bool:
        """True if the terminal is drawn on."""
        return self.show or self.output is None

    def require(self) -> None:
        """Refuse what cannot be done for these files."""
        model_reading.require_models(list(self.files))
        file_requests.require_endings((self.output, formats.FIGURES))
        if self.output is None and not self.show and not sys.stdout.isatty():
            raise exits.UsageError("nothing to draw on: give -o FILE.png (svg, pdf), or --show for text")
        if self.events is not None:
            file_requests.require_endings((self.events, formats.TABLES))
            if not os.path.exists(self.events):
                raise exits.UsageError(f"--events: there is no file {self.events}")
        given = {**self.run, "from": self.begin, "set": self.changes or None}
        options = [f"--{name.replace('_', '-')}" for name, value in given.items() if value is not None]
        if not self.models and options:
            raise exits.UsageError(
                f"{options[0]} is for a MODEL that is simulated, and there are tables alone"
            )
        if self.output is not None:
            read = [file for name in self.files for file in file_requests.model_file(name)]
            read += [file_requests.File("--events", self.events)] if self.events is not None else []
            file_requests.require_writable(
                read, [file_requests.File("--output", self.output, is_written=True)]
            )


def is_table(name: str) -> bool:
    """True for the name of a table, by its ending."""
    return pathlib.PurePath(name).suffix.lower().removeprefix(".") in formats.TABLES


def carry_out(options: PlotOptions) -> None:
    """Read, simulate, draw; nothing is kept, so that it may be called again when a file has changed.

    Raises `exits.UsageError`, `write_guard.WriteError`, `diagnostics.ModelError`, and `exits.Exit` with 3 where a run
    stopped before its end, after its rows have been drawn.
    """
    from lagcli.output.charts import compose
    from lagcli.output.tables import read_table

    stopped: list[str] = []
    with contextlib.ExitStack() as stack:
        try:
            tables = [stack.enter_context(_opened(name, options, stopped)) for name in options.files]
            chart = _chart(tables, options)
        except (*read_table.UNREADABLE, compose.UndrawableColumns) as error:
            raise exits.UsageError(str(error)) from None
    if options.output is not None:
        with write_guard.drawing(options.output):
            from lagcli.output.charts import chart_figure

            chart_figure.draw(options.output, chart)
    if options.is_shown:
        _show(chart)
    if stopped:
        exits.print_err_all(f"lagcli: {reason}" for reason in stopped)
        raise exits.Exit(exits.STOPPED)


def _chart(tables: list[ChartTable], options: PlotOptions) -> ChartData:
    from lagcli.api import plot
    from lagcli.output.charts import compose

    choice = compose.chosen(options.y, x=options.x, xy=options.xy, is_log=options.log, title=options.title)
    try:
        return plot.chart(plot.marked(tables, options.events), choice)
    except OSError as error:
        raise exits.UsageError(f"cannot read {error.filename or 'a table'}: {error.strerror}") from None


@contextlib.contextmanager
def _opened(name: str, options: PlotOptions, stopped: list[str]) -> Iterator[ChartTable]:
    """A table, of a model the one that it gives now; why its run stopped, where it did, goes to `stopped`."""
    from lagcli.output.charts import chart_table

    if name == "-":
        with chart_table.of_stream(sys.stdin.buffer, "<stdin>") as table:
            yield table
    elif is_table(name):
        try:
            table = chart_table.of_file(name)
        except OSError as error:
            raise exits.UsageError(f"cannot read {name}: {error.strerror}") from None
        yield table
    else:
        yield chart_table.of_run(_simulated(name, options, stopped), name)


def _simulated(name: str, options: PlotOptions, stopped: list[str]) -> Trajectory:
    """The run of a model with the settings of the options. Raises `exits.UsageError`, `diagnostics.ModelError`."""
    # Tables are drawn without the integrator.
    from lagcli.api import simulate
    from lagcli.api.runs import run_settings, start_row
    from lagcli.output.trajectory import SimulationStopped

    model = model_reading.load(name, list(options.changes))
    if options.begin is not None:
        model = start_row.of_option(model, options.begin)
    try:
        run_settings.chosen(model, options.run)
    except ValueError as error:
        raise exits.UsageError(str(error)) from None
    try:
        # With the rows before and after incidents, so that jumps are upright.
        made = simulate.simulate(model, event_rows=True, **options.run)  # type: ignore[arg-type] # checked just now
    except SimulationStopped as stop:
        stopped.append(stop.reason)
        made = stop.trajectory
    if not options.quiet:
        exits.print_err_all(f"note: {note}" for note in made.notes)
    return made


def _show(chart: ChartData) -> None:
    from lagcli.output.charts import chart_terminal

    columns = console.width() if sys.stdout.isatty() else console.USUAL
    look = chart_terminal.TerminalLook(columns, not console.is_plain(sys.stdout))
    print("\n".join(chart_terminal.lines(chart, look)))
