"""`lagcli plot`: columns of tables and models in a figure, or in the terminal."""

from __future__ import annotations

import contextlib
import sys
from typing import TYPE_CHECKING

from lagcli.cli.requests import model_reading
from lagcli.cli.requests.asked_plot import PlotOptions, is_table
from lagcli.cli.terminal import console, exits
from lagcli.output.charts import chart_table, compose
from lagcli.output.charts.chart import ChartData
from lagcli.output.charts.chart_table import ChartTable
from lagcli.output.files import formats, write_guard
from lagcli.output.tables import read_table
from lagcli.output.tables.table_format import MissingExtra

if TYPE_CHECKING:
    from collections.abc import Iterator

    from lagcli.output.trajectory import Trajectory

FAULTS = (formats.UnknownFormat, MissingExtra, read_table.UnreadableTable, compose.UndrawableColumns)


def run(options: PlotOptions) -> None:
    """Read, simulate, draw; nothing is kept, so that it may be called again when a file has changed.

    Raises `exits.UsageError`, `write_guard.WriteError`, `diagnostics.ModelError`, and `exits.Exit` with 3 where a run
    stopped before its end, after its rows have been drawn.
    """
    stopped: list[str] = []
    with contextlib.ExitStack() as stack:
        try:
            tables = [stack.enter_context(_opened(name, options, stopped)) for name in options.files]
            chart = _chart(tables, options)
        except FAULTS as error:
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

    choice = compose.chosen(options.y, x=options.x, xy=options.xy, is_log=options.log, title=options.title)
    try:
        return plot.chart(plot.marked(tables, options.events), choice)
    except OSError as error:
        raise exits.UsageError(f"cannot read {error.filename or 'a table'}: {error.strerror}") from None


@contextlib.contextmanager
def _opened(name: str, options: PlotOptions, stopped: list[str]) -> Iterator[ChartTable]:
    """A table, of a model the one that it gives now; why its run stopped, where it did, goes to `stopped`."""
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
