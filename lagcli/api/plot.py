"""`lagcli.plot`: columns of runs, tables and models, overlaid in one figure."""

from __future__ import annotations

import contextlib
import dataclasses
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, BinaryIO

from lagcli.api import defined_columns
from lagcli.api.models.load import Path
from lagcli.api.runs import run_settings as model_settings
from lagcli.api.simulate import as_far, simulate
from lagcli.model.model import Model
from lagcli.output.charts import chart_table, compose
from lagcli.output.charts.chart_table import ChartTable
from lagcli.output.charts.compose import ChartChoice
from lagcli.output.figures.chart import ChartData
from lagcli.output.files import formats
from lagcli.output.files.write_guard import BadRequest
from lagcli.output.tables import incident_table, table_format
from lagcli.running.trajectory import Trajectory

if TYPE_CHECKING:
    from lagcli.output.figures.figure_page import NotebookFigure


def plot(
    *runs: Trajectory | Model | Path,
    y: str | Sequence[str] = (),
    x: str | None = None,
    xy: str | Sequence[str] = (),
    log: bool = False,
    events: Path | None = None,
    title: str | None = None,
    path: Path | None = None,
) -> NotebookFigure:
    """Draw columns of runs, of tables in files, or of models, which are simulated with their own settings.

    `y`: patterns separated by commas, `"lambda.*,R.a.z"`, or an expression of columns with a name, `"pull=abs(R.a.z)"`,
    each text of a list on axes of its own, the multipliers where nothing is said; `x`: the column of the other axis, or
    such an expression, `t` where nothing is said; `xy`: pairs `"a.x,a.z"` with one
    scale; `log`: sizes on a logarithmic scale; `events`: the table of incidents that are marked; `path`: a file to
    write, png, svg or pdf. Returns a `matplotlib.figure.Figure`, which a notebook shows.
    Raises `ModelError`, `ValueError` for columns and tables that cannot be drawn, `OSError`, `SimulationStopped`.
    """
    # Other functions draw no charts.
    from lagcli.output.charts import chart_figure, compose
    from lagcli.output.figures import figure_page

    if not runs:
        raise ValueError("there is nothing to plot: give a run, a table or a model")
    choice = compose.chosen(y, x=x, xy=xy, is_log=log, title=title)
    figure = chart_figure.compose(chart(marked([_table(run) for run in runs], events), choice))
    if path is not None:
        figure_page.write(path, figure)
    return figure


@dataclasses.dataclass(frozen=True, slots=True)
class DrawnRuns:
    """A chart, and why the runs in it stopped before their ends; is_empty: none of them has a row."""

    chart: ChartData
    stopped: list[str]
    is_empty: bool


def steps(
    sources: Iterable[BinaryIO | str | Model],
    choice: ChartChoice,
    events: str | None,
    run_settings: Mapping[str, object],
    begin: str | None,
) -> Iterator[str | DrawnRuns]:
    """Read tables, on a stream as CSV or in files, and simulate models: yields notes on runs, and last the chart.

    run_settings, begin: the settings of the runs of models and the row that they start from. Raises `BadRequest`,
    worded for the options of the command, and `ModelError`.
    """

    tables: list[ChartTable] = []
    stopped: list[str] = []
    with contextlib.ExitStack() as stack:
        try:
            for source in sources:
                if isinstance(source, Model):
                    # With the rows before and after incidents, so that jumps are upright.
                    model = model_settings.of_options(source, run_settings, begin)
                    run, reason = as_far(model, event_rows=True)
                    stopped += [reason] if reason else []
                    yield from run.notes
                    tables.append(chart_table.of_run(run, source.path))
                elif isinstance(source, str):
                    with _reading():
                        tables.append(chart_table.of_file(source))
                else:
                    tables.append(stack.enter_context(chart_table.of_stream(source, "<stdin>")))
            with _reading():
                drawn = chart(marked(tables, events), choice)
        except (*table_format.UNREADABLE, compose.UndrawableColumns) as error:
            raise BadRequest(str(error)) from None
    yield DrawnRuns(drawn, stopped, bool(stopped) and all(table.length == 0 for table in tables))


@contextlib.contextmanager
def _reading() -> Iterator[None]:
    """Surround what reads tables. Raises `BadRequest` for what the system refuses."""
    try:
        yield
    except OSError as error:
        raise BadRequest(f"cannot read {error.filename or 'a table'}: {error.strerror}") from None


def chart(tables: Sequence[ChartTable], choice: ChartChoice) -> ChartData:
    """The chart of columns of tables, and of those that the choice defines. Raises `compose.UndrawableColumns`."""

    return compose.chart(*defined_columns.added(tables, choice))


def marked(tables: Sequence[ChartTable], events: Path | None) -> Sequence[ChartTable]:
    """The tables with the incidents of a file in place of their own. Raises as `incident_table.read`."""
    if events is None:
        return tables

    found = incident_table.read(events)
    incidents = [(float(t), kind) for t, kind in zip(found.t, found.kinds, strict=True)]
    return [dataclasses.replace(table, incidents=incidents) for table in tables]


def _table(run: Trajectory | Model | Path) -> ChartTable:

    if isinstance(run, Trajectory):
        return chart_table.of_run(run)
    if isinstance(run, Model):
        return chart_table.of_run(simulate(run, event_rows=True), run.path)
    if formats.is_table(run):
        return chart_table.of_file(run)
    return chart_table.of_run(simulate(run, event_rows=True), os.fspath(run))
