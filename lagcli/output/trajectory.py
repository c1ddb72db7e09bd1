"""The result of a run: a table with named columns, and the account of how it was made."""

from __future__ import annotations

import dataclasses
import json
import os
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from lagcli import __version__
from lagcli.errors import diagnostics
from lagcli.model import settings
from lagcli.model.model import Model, Simulation, Vector3
from lagcli.output.tables import incident_table, table_facts
from lagcli.output.tables.incident_table import IncidentTable
from lagcli.output.tables.table_facts import TableFacts
from lagcli.simulation.global_error.accuracy import Accuracy
from lagcli.start.assembly_moves import Moves

if TYPE_CHECKING:
    from lagcli.output.figures.sheet import NotebookFigure

Floats = npt.NDArray[np.float64]

SHOWN = 12  # names of columns in a repr: two or three lines of a terminal


@dataclasses.dataclass(frozen=True, slots=True)
class Provenance:
    """The origin of a table; equal runs have equal ones.

    version: of lagcli; sha256: of the bytes of the model file; parameters: all values; set: the changes of `--set`
    as they were given; method, rtol, atol: of the run, atol None where it follows the sizes of the motion; facts:
    title, units and dimensions of the model.
    """

    version: str
    sha256: str
    parameters: dict[str, float | Vector3]
    set: dict[str, str]
    method: str
    rtol: float
    atol: float | None
    facts: TableFacts = table_facts.NOTHING

    def as_json(self) -> dict[str, Any]:
        """The object `provenance` of `--stats` and of tables."""
        plain = dataclasses.asdict(dataclasses.replace(self, facts=table_facts.NOTHING))
        del plain["facts"]
        return plain | self.facts.as_json()


def provenance(model: Model) -> Provenance:
    """The provenance of a run of a model with its settings."""
    chosen = model.simulation
    return Provenance(
        version=__version__,
        sha256=model.sha256,
        parameters={parameter.name: parameter.value for parameter in model.parameters},
        set=dict(model.changes),
        method=settings.method_name(chosen),
        rtol=chosen.rtol,
        atol=chosen.atol,
        facts=table_facts.of_model(model),
    )


@dataclasses.dataclass(frozen=True, slots=True)
class Stopped:
    """Why a run ended before its end: the time reached, a sentence, and its code for `lagcli explain`."""

    t: float
    reason: str
    code: str


# The codes of a run that a signal ended, and of one whose rows could not be written.
INTERRUPTED, NOT_WRITTEN = "interrupted", "not-written"


@dataclasses.dataclass(slots=True)
class Outcome:
    """The outcome of a run so far: the number of its rows, the time of the last one, and why it stopped."""

    rows: int = 0
    t_end: float | None = None
    stopped: Stopped | None = None


@dataclasses.dataclass(frozen=True, slots=True)
class Stats:
    """The account of a run, the object of `--stats`.

    steps: accepted ones; evaluations: of the right-hand side; seconds of wall time; position_drift and
    velocity_drift: largest |f_i| / |B_i| and |B_i v + b_i| / |B_i| over all rows written, the first also over |g_j|
    / |dg_j| of the first integrals that are held, g_j being the integral less its value at the start;
    energy_imbalance: largest deviation from the energy balance over all rows, as a part of the energies exchanged,
    or None where the work within a step was not found; indeterminate: rows whose multipliers are not unique;
    singular_times: times of singular configurations that were passed; stopped: why the run ended before its end;
    ended_by: the name of the event that ended it; rows: how many there are up to t_end, the
    time of the last one; provenance: model, program and settings behind it; accuracy: the estimate of the errors,
    where it was asked for; assembled: what assembly changed in the start, where it was asked for; rtol and atol:
    the tolerances, atol None where it is a part of the sizes of the motion; impacts, releases, accumulations:
    numbers of such, by contact; largest_penetration: the largest -g over all rows, in units of g.
    """

    steps: int
    rejected: int
    evaluations: int
    compile_seconds: float
    solve_seconds: float
    method: str
    position_drift: float
    velocity_drift: float
    energy_imbalance: float | None
    indeterminate: tuple[str, ...] = ()
    singular_times: tuple[float, ...] = ()
    stopped: Stopped | None = None
    ended_by: str | None = None
    rows: int = 0
    t_end: float | None = None
    provenance: Provenance | None = None
    accuracy: Accuracy | None = None
    assembled: Moves | None = None
    rtol: float = Simulation().rtol
    atol: float | None = None
    impacts: int = 0
    releases: int = 0
    accumulations: int = 0
    largest_penetration: float = 0.0

    def as_json(self) -> dict[str, Any]:
        """The object written by `--stats`."""
        account = dataclasses.asdict(
            dataclasses.replace(self, accuracy=None, assembled=None, provenance=None)
        )
        del account["accuracy"], account["assembled"]
        if self.provenance is not None:
            account["provenance"] = self.provenance.as_json()
        if self.assembled is not None:
            account["assembled"] = self.assembled.as_json()
        return account if self.accuracy is None else {**account, **self.accuracy.as_json()}


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

    def __setitem__(self, column: str, values: Floats) -> None:
        raise TypeError("a trajectory is not to be changed: copy it with dict(run)")

    def __delitem__(self, column: str) -> None:
        raise TypeError("a trajectory is not to be changed: copy it with dict(run)")

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
        names = ", ".join(self.columns[:SHOWN]) + (", ..." if len(self.columns) > SHOWN else "")
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
        dimension = "t" if "t" in self else "row"
        units = self.units
        found = {name: (dimension, values, {"units": units[name]}) for name, values in self.items()}
        coordinates = {"t": found.pop("t")} if "t" in found else {}
        # Files of the library hold no attributes that are objects.
        told = {"title": self.facts.title, "provenance": json.dumps(self.origin)}
        return xarray.Dataset(found, coords=coordinates, attrs=told)

    @property
    def units(self) -> dict[str, str]:
        """The labels of the units of all columns, empty where they are not known."""
        # What is only computed with needs no words.
        from lagcli.output.charts import column_words

        words = column_words.ColumnWords(self.columns, self.facts)
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
        told = self.stats.provenance.facts if self.stats.provenance is not None else table_facts.NOTHING
        zeros = self.zeros
        return dataclasses.replace(told, zeros=zeros or frozenset(), is_judged=zeros is not None)

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
        from lagcli.output.charts import chart_figure, chart_table, compose

        choice = compose.chosen(y, x=x, xy=xy, is_log=log, title=title)
        drawn = compose.chart([chart_table.of_run(self)], choice)
        if path is not None:
            chart_figure.draw(path, drawn)
        return chart_figure.compose(drawn)

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
        places = [i for i, column in enumerate(self.columns) if column.rpartition(".")[0] == name]
        if not places:
            groups = dict.fromkeys(column.rpartition(".")[0] for column in self.columns)
            hint = diagnostics.nearest(name, [*self.columns, *filter(None, groups)])
            raise KeyError(f"there are no columns `{name}`" + (f"; {hint}" if hint else ""))
        return self.rows[:, places]


class SimulationStopped(Exception):
    """The integration ended before its end; `trajectory` holds the complete rows so far, `t` the time reached.

    `stats` is the account of the rows there are, `code` the word for `lagcli explain`.
    """

    def __init__(self, reason: str, t: float, trajectory: Trajectory) -> None:
        super().__init__(reason)
        self.reason, self.t, self.trajectory = reason, t, trajectory

    @property
    def stats(self) -> Stats:
        """The account, whose `stopped` says the same as the exception."""
        return self.trajectory.stats

    @property
    def code(self) -> str:
        """The code of the reason, for `lagcli explain`."""
        return self.stats.stopped.code if self.stats.stopped is not None else ""
