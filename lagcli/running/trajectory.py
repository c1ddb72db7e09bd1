"""The result of a run: a table with named columns, and the account of how it was made."""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import os
import pathlib
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from lagcli.arrays import Floats
from lagcli.errors import diagnostics
from lagcli.output.figures.chart import DecimatedRows
from lagcli.output.files import atomic_file
from lagcli.output.tables import incident_table, provenance
from lagcli.output.tables.incident_table import IncidentTable
from lagcli.output.tables.provenance import TableFacts
from lagcli.running.run_account import Stats
from lagcli.simulation.run_state import run_stop

if TYPE_CHECKING:
    from lagcli.output.figures.figure_page import NotebookFigure
    from lagcli.running.simulation_run import SimulationRun


class Trajectory(dict[str, Floats]):
    """The table of a run: a mapping from the names of its columns to arrays (T,), in the order of the table.

    columns: their names; rows: all as one array (T, len(columns)), the first column `t`; stats: the account of the
    run; notes: sentences about first integrals that were not enforced all the time; events: its incidents, impacts,
    contacts, releases and declared events, a sequence that is a mapping of columns too; zeros: those that are zero to
    rounding, or how to find them. It is not to be changed.
    """

    def __init__(
        self,
        columns: tuple[str, ...],
        rows: Floats,
        stats: Stats,
        notes: tuple[str, ...] = (),
        events: IncidentTable = incident_table.NONE,
        zeros: Callable[[], frozenset[str]] | frozenset[str] | None = None,
    ) -> None:
        super().__init__(zip(columns, rows.T, strict=True))
        self.columns, self.rows, self.stats, self.notes = columns, rows, stats, notes
        self.events, self._zeros = events, zeros

    def __missing__(self, column: str) -> Floats:
        hint = diagnostics.nearest(column, self.columns)
        raise KeyError(f"there is no column `{column}`" + (f"; {hint}" if hint else ""))

    def _refused(self, *given: object) -> NoReturn:
        raise TypeError("a trajectory is not to be changed: copy it with dict(run)")

    __setitem__ = __delitem__ = _refused
    __eq__ = object.__eq__  # two runs are never compared column by column
    __ne__ = object.__ne__
    __hash__ = object.__hash__  # type: ignore[assignment] # it is not to be changed

    def __reduce__(self) -> tuple[type[Trajectory], tuple[object, ...]]:
        return Trajectory, (self.columns, self.rows, self.stats, self.notes, self.events, self.zeros)

    def __repr__(self) -> str:
        count = len(self.rows)
        times = (
            f", t = {self.rows[0, 0]:g} to {self.rows[-1, 0]:g}" if count and "t" in self.columns[:1] else ""
        )
        names = ", ".join(self.columns[: diagnostics.MAX_LISTED])
        names += ", ..." if len(self.columns) > diagnostics.MAX_LISTED else ""
        return f"<Trajectory: {count} rows of {len(self.columns)} columns{times}: {names}>"

    def to_pandas(self) -> Any:
        """The table as a `pandas.DataFrame` with the column `t` as its index; `attrs` holds `units` by column and
        `provenance`. Raises `ImportError` without pandas."""
        try:
            import pandas
        except ModuleNotFoundError as error:
            raise ImportError("to_pandas() needs pandas: pip install pandas") from error
        frame = pandas.DataFrame(self.rows, columns=list(self.columns))
        frame = frame.set_index("t") if "t" in self else frame
        frame.attrs = {"units": self.units, "provenance": self.origin}
        return frame

    def to_xarray(self) -> Any:
        """The table as an `xarray.Dataset` over `t`, a variable for each column with the attribute `units`; attributes
        of the set are `title` and `provenance`, in JSON. Raises `ImportError` without it."""
        try:
            import xarray
        except ModuleNotFoundError as error:
            raise ImportError("to_xarray() needs xarray: pip install xarray") from error
        import json

        dimension = "t" if "t" in self else "row"
        units = self.units
        found = {name: (dimension, values, {"units": units[name]}) for name, values in self.items()}
        coordinates = {"t": found.pop("t")} if "t" in found else {}
        # Files of the library hold no attributes that are objects.
        attributes = {"title": self.facts.title, "provenance": json.dumps(self.origin)}
        return xarray.Dataset(found, coords=coordinates, attrs=attributes)

    @property
    def units(self) -> dict[str, str]:
        """The labels of the units of all columns, empty where they are not known."""
        # What is only computed with needs no words.
        from lagcli.output.figures import labels

        words = labels.ColumnTexts(self.columns, self.facts)
        return {name: words.unit(name) for name in self.columns}

    def _repr_html_(self) -> str:
        from lagcli.model import notebook_html

        units, rows = self.units, []
        for name, values in self.items():
            finite = values[np.isfinite(values)]
            ends = (
                [f"{value:.6g}" for value in (finite.min(), finite.max(), values[-1])]
                if finite.size
                else [""] * 3
            )
            rows.append((name, units[name], *ends))
        headers = ("column", "unit", "smallest", "largest", "last")
        title = self.facts.title or "Run"
        count = f"{len(self.rows)} rows, {self.stats.steps} steps, {len(self.events)} incidents"
        return notebook_html.page(
            title, notebook_html.sentences([count, *self.notes]), notebook_html.table(headers, rows)
        )

    @property
    def t(self) -> Floats:
        """The times (T,)."""
        return self["t"]

    @property
    def zeros(self) -> frozenset[str] | None:
        """The columns that are zero to rounding, but not exactly; None where nobody has looked."""
        if callable(self._zeros):
            self._zeros = self._zeros()
        return self._zeros

    @property
    def facts(self) -> TableFacts:
        """The title, the units and the dimensions of the model, as far as they are known."""
        facts = self.stats.provenance.facts if self.stats.provenance is not None else provenance.NO_FACTS
        zeros = self.zeros
        return dataclasses.replace(facts, zeros=zeros or frozenset(), is_judged=zeros is not None)

    @property
    def origin(self) -> dict[str, object] | None:
        """The provenance as tables hold it; None where it is not known."""
        return self.stats.provenance.as_json() if self.stats.provenance is not None else None

    @property
    def incident_times(self) -> list[tuple[float, str]]:
        """The times of the incidents with their kinds."""
        return [(float(t), kind) for t, kind in zip(self.events.t, self.events.kinds, strict=True)]

    def plot(
        self,
        y: str | Sequence[str] = (),
        *,
        x: str | None = None,
        xy: str | Sequence[str] = (),
        log: bool = False,
        title: str | None = None,
        path: str | os.PathLike[str] | None = None,
    ) -> NotebookFigure:
        """Draw columns as `lagcli plot` does and return a `matplotlib.figure.Figure`, which a notebook shows.

        `y`: patterns separated by commas, `"lambda.*,R.a.z"`, each text of a list on axes of its own, the multipliers
        where nothing is said; `x`: the column of the other axis, `t` where nothing is said; `xy`: pairs `"a.x,a.z"`
        with one scale; `log`: sizes on a logarithmic scale; `path`: a file to write too, png, svg or pdf.
        Raises `ValueError` for columns there are not, `OSError`.
        """
        # matplotlib is loaded where a figure is drawn.
        from lagcli.output.figures import chart_figure, chart_table, compose, figure_page

        choice = compose.chosen(y, x=x, xy=xy, is_log=log, title=title)
        figure = chart_figure.compose(compose.chart([chart_table.of_run(self)], choice))
        if path is not None:
            figure_page.write(path, figure)
        return figure

    @property
    def digits(self) -> dict[str, float | None]:
        """The number of right digits of `r`, `v`, `lambda` and `R` at the last row, of the largest value of each so
        far; None where there is nothing but zeros. Raises `ValueError` where the run was not asked for them."""
        if self.stats.accuracy is None:
            raise ValueError("the digits are not known: simulate with digits=True")
        return self.stats.accuracy.digits

    def multiplier(self, constraint: str) -> Floats:
        """lambda of a constraint, (T,); of a vector equation or a rigid body (T, rows)."""
        return self._group(f"lambda.{constraint}")

    def reaction(self, name: str) -> Floats:
        """R of a particle, (T, 3); of a generalized coordinate (T,)."""
        return self._group(f"R.{name}")

    def _group(self, name: str) -> Floats:
        if name in self.columns:
            return self[name]
        indices = [i for i, column in enumerate(self.columns) if column.rpartition(".")[0] == name]
        if not indices:
            groups = dict.fromkeys(column.rpartition(".")[0] for column in self.columns)
            hint = diagnostics.nearest(name, [*self.columns, *filter(None, groups)])
            raise KeyError(f"there are no columns `{name}`" + (f"; {hint}" if hint else ""))
        return self.rows[:, indices]


class SimulationStopped(Exception):
    """The integration ended before its end; `trajectory` holds the complete rows so far, `t` the time reached.

    `stats` is the account of the rows there are, `code` the word for `lagcli explain`.
    """

    def __init__(self, reason: str, t: float, trajectory: Trajectory) -> None:
        super().__init__(reason)
        self.reason, self.t, self.trajectory = reason, t, trajectory

    def __reduce__(self) -> tuple[type[SimulationStopped], tuple[object, ...]]:
        return type(self), (self.reason, self.t, self.trajectory)

    @property
    def stats(self) -> Stats:
        """The account, whose `stopped` says the same as the exception."""
        return self.trajectory.stats

    @property
    def code(self) -> str:
        """The code of the reason, for `lagcli explain`."""
        return self.stats.stopped.code if self.stats.stopped is not None else ""


def in_memory(
    run: SimulationRun, columns: str, checkpoint: str | os.PathLike[str] | None, began: float
) -> Trajectory:
    """The table of a run, made since the time `began` of `time.perf_counter`.

    columns: patterns; checkpoint: a file to keep the state of the run in. Raises `SimulationStopped` with the table so
    far where the integration cannot go on, `table_format.UnknownColumn`, OSError, where another run keeps its state in
    that file too.
    """
    # The command chooses its columns by itself.
    from lagcli.output.tables import table_format

    everything = (*run.columns, *run.by_name)
    picked = table_format.select(run.columns, columns, run.by_name)
    # What is zero to rounding is known from all columns.
    has_all_columns = picked[: len(run.columns)] == list(range(len(run.columns)))
    blocks, looked_at = [np.zeros((0, len(picked)))], DecimatedRows()
    incidents = [run.incident_columns.table([])]
    stop: run_stop.Stop | None = None
    with contextlib.ExitStack() as stack:
        keeper = None
        if checkpoint is not None:
            from lagcli.running.run_tables import CheckpointWriter  # most runs keep none

            stack.enter_context(atomic_file.FileLock(pathlib.Path(checkpoint)))
            keeper = CheckpointWriter(checkpoint)
            stack.callback(keeper.write)
        try:
            for block in run.blocks():
                blocks.append(run.taken(block, picked))
                if not has_all_columns:
                    looked_at.add(block)
                if run.incidents:
                    incidents.append(run.incident_columns.table(run.incidents))
                if keeper is not None:
                    keeper.take(run.checkpoint())
        except run_stop.RunStop as stopped:
            stop = stopped.stop
    rows = np.concatenate(blocks)
    blocks.clear()  # freeing memory takes its time too
    # What is left of the wall time went into the rows: taken together, chosen, kept.
    stats = run.stats
    seconds = time.perf_counter() - began - stats.compile_seconds
    stats = dataclasses.replace(stats, solve_seconds=seconds)
    find_floors, of_run = run.floors, run.columns

    def zeros() -> frozenset[str]:
        floors = find_floors()
        floors.take(rows[:, : len(of_run)] if has_all_columns else looked_at.rows())
        return frozenset(itertools.compress(of_run, floors.zeros()))

    names = tuple(everything[i] for i in picked)
    result = Trajectory(names, rows, stats, run.notes, incident_table.joined(incidents), zeros)
    if stop is not None:
        raise SimulationStopped(stop.reason, stop.t, result)
    return result
