"""`lagcli.plot`: columns of runs, tables and models, overlaid in one figure."""

from __future__ import annotations

import contextlib
import dataclasses
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from lagcli.api import reductions
from lagcli.api import run_settings as model_settings
from lagcli.api.load import Path
from lagcli.api.simulate import as_far, simulate
from lagcli.arrays import Floats
from lagcli.expression.tree import ExpressionError
from lagcli.model.model import Model
from lagcli.output.figures import chart_table, compose
from lagcli.output.figures.chart import ChartData
from lagcli.output.figures.chart_table import ChartTable
from lagcli.output.figures.compose import ChartChoice, UndrawableColumns
from lagcli.output.files import formats
from lagcli.output.files.write_guard import BadRequest
from lagcli.output.tables import incident_table, table_format
from lagcli.running.trajectory import Trajectory

if TYPE_CHECKING:
    from lagcli.output.figures.figure_page import NotebookFigure

_NAME = re.compile(r"[^\W\d]\w*")


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
    from lagcli.output.figures import chart_figure, figure_page

    if not runs:
        raise ValueError("there is nothing to plot: give a run, a table or a model")
    choice = compose.chosen(y, x=x, xy=xy, is_log=log, title=title)
    tables = []
    for run in runs:
        if isinstance(run, Trajectory):
            tables.append(chart_table.of_run(run))
        elif isinstance(run, Model):
            tables.append(chart_table.of_run(simulate(run, event_rows=True), run.path))
        elif formats.is_table(run):
            tables.append(chart_table.of_file(run))
        else:
            tables.append(chart_table.of_run(simulate(run, event_rows=True), os.fspath(run)))
    figure = chart_figure.compose(chart(tables, choice, events))
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
                    tables.append(chart_table.of_file(source))
                else:
                    tables.append(stack.enter_context(chart_table.of_stream(source, "<stdin>")))
            drawn = chart(tables, choice, events)
        except OSError as error:
            raise BadRequest(f"cannot read {error.filename or 'a table'}: {error.strerror}") from None
        except (*table_format.UNREADABLE, UndrawableColumns) as error:
            raise BadRequest(str(error)) from None
    yield DrawnRuns(drawn, stopped, bool(stopped) and all(table.length == 0 for table in tables))


def chart(tables: Sequence[ChartTable], choice: ChartChoice, events: Path | None = None) -> ChartData:
    """The chart of columns of tables and of those that the choice defines, `NAME=EXPR` in `y` and `x`; events: a file
    of incidents in place of the tables' own.

    A table that has not all columns of an expression goes without. Raises `UndrawableColumns`, and as
    `incident_table.read`.
    """
    if events is not None:
        read = incident_table.read(events)
        incidents = [(float(t), kind) for t, kind in zip(read.t, read.kinds, strict=True)]
        tables = [dataclasses.replace(table, incidents=incidents) for table in tables]
    names = {}
    for option, text in (*(("--y", y) for y in choice.y), *((("--x", choice.x),) if choice.x else ())):
        if "=" not in text:
            continue
        name, _, written = (part.strip() for part in text.partition("="))
        if not _NAME.fullmatch(name) or not written:
            raise UndrawableColumns(
                f"{option} {text}: write NAME=EXPR, a name of letters and digits, such as 'pull=abs(lambda.rod)'"
            )
        names[text] = name
        failed: list[ExpressionError] = []
        defined = []
        for table in tables:
            if name in table.columns:
                owner = table.name or "the table"
                raise UndrawableColumns(f"{option}: {owner} has a column `{name}` of its own")
            try:
                defined.append(_defined(table, name, text.partition("=")[2]))
            except ExpressionError as error:
                failed.append(error)
                defined.append(table)
        if len(failed) == len(tables) or any(error.code != "unknown-name" for error in failed):
            hint = f"; {failed[0].hint}" if failed[0].hint else ""
            raise UndrawableColumns(f"{option} {name}: {failed[0].message}{hint}")
        tables = defined
    y = tuple(names.get(text, text) for text in choice.y)
    return compose.chart(tables, dataclasses.replace(choice, y=y, x=names.get(choice.x or "", choice.x)))


def _defined(table: ChartTable, name: str, text: str) -> ChartTable:
    """A table with the values of an expression at its rows as a column. Raises `ExpressionError`."""
    # The parameters that the provenance of the table has: numbers, and vectors as the language has them.
    given = table.origin.get("parameters") if table.origin is not None else None
    parameters: dict[str, object] = {}
    for key, value in given.items() if isinstance(given, Mapping) else ():
        parts = value if isinstance(value, (list, tuple)) else [value]
        if all(isinstance(part, (int, float)) and not isinstance(part, bool) for part in parts):
            numbers = tuple(map(float, parts))
            if len(numbers) == (3 if isinstance(value, (list, tuple)) else 1):
                parameters[key] = numbers if len(numbers) == 3 else numbers[0]
    used = reductions.columns_in(text, table.columns)
    # Names and functions are judged before any number is read.
    reductions.at_rows(text, {known: np.ones(2) for known in table.columns}, np.array([0.0, 1.0]), parameters)
    needed = list(dict.fromkeys([*used, *(["t"] if "t" in table.columns else [])])) or list(table.columns[:1])

    def take(names: Sequence[str]) -> Floats:
        if name not in names:
            return table.take(names)
        others = list(dict.fromkeys([*(other for other in names if other != name), *needed]))
        rows = dict(zip(others, table.take(others).T, strict=True))
        count = len(rows[others[0]])
        t = rows["t"] if "t" in rows else np.arange(float(count))
        values = (
            reductions.at_rows(text, {known: rows[known] for known in needed}, t, parameters) if count else t
        )
        return np.column_stack([values if one == name else rows[one] for one in names])

    return dataclasses.replace(table, columns=(*table.columns, name), take=take)
