"""`lagcli plot`: columns of tables and models in a figure, or in the terminal."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING, Annotated, BinaryIO

from lagcli.cli.commands import completing, options
from lagcli.cli.terminal import console, exits
from lagcli.model.settings import RunSettings
from lagcli.output.files import formats, write_guard

if TYPE_CHECKING:
    from lagcli.api.plot import DrawnRuns
    from lagcli.model.model import Model


@options.command()
def plot(
    files: Annotated[
        list[str],
        options.argument(
            "FILE...",
            f"tables ({formats.LISTED}; - for CSV on standard input), or models, to be simulated",
            completing.run_files,
        ),
    ],
    y: Annotated[
        list[str] | None,
        options.named(
            "PATTERNS",
            "columns, such as 'lambda.*,R.a.z', or one made of others, 'pull=abs(lambda.rod)'; again for more axes",
            completing.columns,
        ),
    ] = None,
    x: Annotated[
        str | None, options.named("COLUMN", "the column of the other axis (t)", completing.columns)
    ] = None,
    xy: Annotated[
        list[str] | None,
        options.named("X,Y", "a path with one scale, such as a.x,a.z; repeatable", completing.columns),
    ] = None,
    events: Annotated[str | None, options.file("mark the events of `simulate --events`")] = None,
    log: Annotated[bool, "sizes on a logarithmic scale"] = False,
    title: Annotated[str | None, options.named("TEXT", "in place of the model's")] = None,
    output: Annotated[str | None, options.output("the figure: png, svg, pdf")] = None,
    show: Annotated[bool, "draw in the terminal, which is usual without -o"] = False,
    *,
    run_settings: RunSettings,
    begin: options.FromOption = None,
    changes: options.SetOption = None,
    watch: options.WatchOption = False,
    quiet: options.QuietOption = False,
) -> None:
    """Draw columns of tables and models: over t or another column, as paths, several runs overlaid.

    Without --y and --xy the multipliers. Exit 3 where the run of a model stops before its end: the rows so far are
    drawn; without one no figure is made.
    """
    options.require_models(files)
    if output is None and not show and not sys.stdout.isatty():
        raise exits.UsageError("nothing to draw on: give -o FILE.png (svg, pdf), or --show for text")
    if events is not None:
        write_guard.require_endings((events, formats.TABLES))
        if not os.path.exists(events):
            raise exits.UsageError(f"--events: there is no file {events}")
    models = [name for name in files if name != "-" and not formats.is_table(name)]
    given = {**run_settings, "from": begin, "set": changes or None}
    of_models = [f"--{name.replace('_', '-')}" for name, value in given.items() if value is not None]
    if of_models and not models:
        raise exits.UsageError(f"{of_models[0]} is for a MODEL that is simulated, and there are tables alone")
    if output is not None:
        read = [*(("MODEL", name) for name in files), ("--events", events)]
        write_guard.require(read, ("--output", output, formats.FIGURES))

    def source(name: str) -> BinaryIO | str | Model:
        if name in models:
            return options.load(name, changes)
        return sys.stdin.buffer if name == "-" else name

    def draw() -> None:
        """Read, simulate, draw; nothing is kept, so that it may be called again when a file has changed."""
        from lagcli.api import plot as plotting
        from lagcli.output.figures import compose

        choice = compose.chosen(y or (), x=x, xy=xy or (), is_log=log, title=title)
        drawn: DrawnRuns | None = None
        for step in plotting.steps(map(source, files), choice, events, run_settings, begin):
            if not isinstance(step, str):
                drawn = step
            elif not quiet:
                exits.print_err(f"note: {step}")
        assert drawn is not None
        _show(drawn, output, show)

    if watch:
        options.follow([*files, *([events] if events is not None else [])], draw, quiet)
    draw()


def _show(drawn: DrawnRuns, output: str | None, is_shown: bool) -> None:
    """The chart in a file and in the terminal. Raises `exits.Exit` where a run stopped before its end."""
    if drawn.is_empty:
        exits.print_err_all(f"lagcli: {reason}; there is no row to draw" for reason in drawn.stopped)
        raise exits.Exit(exits.STOPPED)
    if output is not None:
        with write_guard.drawing(output):
            from lagcli.output.figures import chart_figure, figure_page

            figure_page.write(output, chart_figure.compose(drawn.chart))
    if is_shown or output is None:
        from lagcli.output.figures import chart_terminal

        columns = console.width() if sys.stdout.isatty() else console.USUAL
        look = chart_terminal.TerminalLook(columns, not console.is_plain(sys.stdout))
        print("\n".join(chart_terminal.lines(drawn.chart, look)))
    if drawn.stopped:
        exits.print_err_all(f"lagcli: {reason}" for reason in drawn.stopped)
        raise exits.Exit(exits.STOPPED)
