"""The table and the figure of `lagcli compare --vakonomic`, and its options."""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Sequence

import numpy as np

from lagcli.cli.terminal import exits
from lagcli.formulations import comparison
from lagcli.formulations.comparison import Comparison, Formulation
from lagcli.model.model import Model
from lagcli.output.files import file_requests, write_guard
from lagcli.output.runs import safe_table
from lagcli.output.runs.safe_table import TablePlan
from lagcli.output.tables import provenance


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class PrinciplesOptions:
    """Options of `compare --vakonomic`: initial multipliers as they were given, and files for table and figure."""

    vakonomic: bool = False
    mu: tuple[str, ...] = ()
    output: str | None = None
    plot: str | None = None

    def require(self, models: list[str], as_json: bool) -> None:
        """Refuse what cannot be done for these MODELs."""
        if not self.vakonomic:
            for option, given in (("--mu", self.mu), ("--output", self.output), ("--plot", self.plot)):
                if given:
                    raise exits.UsageError(f"{option} is of the vakonomic motion; give --vakonomic too")
            return
        if len(models) > 1:
            raise exits.UsageError("--vakonomic compares the two principles of one MODEL")
        file_requests.require_outputs(models[0], self.output, self.plot, as_json)


def initial_multipliers(given: Sequence[str]) -> dict[str, str]:
    """The values of `--mu NAME=VALUE` by their names. Raises `exits.UsageError`."""
    found: dict[str, str] = {}
    for text in given:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not equals or not name:
            raise exits.UsageError(
                f"--mu {text}: write NAME=VALUE, the initial multiplier of a differential row"
            )
        if name in found:
            raise exits.UsageError(f"--mu {name}: given twice")
        found[name] = value
    return found


def write(model: Model, found: Comparison, options: PrinciplesOptions) -> None:
    """The table and the figure that were asked for. Raises `write_guard.WriteError`, `exits.UsageError`."""
    principles = found.principles
    if principles is None:
        return
    vakonomic = found.formulations[-1]
    if options.output is not None:
        plan = TablePlan("--output", None if options.output == "-" else options.output, vakonomic.columns)
        whence = provenance.of(model).as_json() | {"vakonomic": {"mu": dict(principles.mu)}}
        with safe_table.opened(plan, whence) as table:
            table.write(vakonomic.table)
            if vakonomic.stopped:
                saved = table.keep()
                exits.print_err(f"lagcli: the vakonomic motion stopped; {saved}" if saved else "")
            else:
                table.complete()
    if options.plot is not None:
        _draw(model, found, options.plot)


def _draw(model: Model, found: Comparison, path: str) -> None:
    first, other = found.formulations[0], found.formulations[-1]
    with write_guard.drawing(path):
        # matplotlib takes a third of a second to load: only where a figure is asked for.
        from lagcli.output.figures import principles_figure

        tables = (
            principles_figure.MotionTable("d'Alembert", first.columns, first.table),
            principles_figure.MotionTable("vakonomic", other.columns, other.table),
        )
        title = f"{model.title or pathlib.Path(model.path).stem}: two principles"
        shown = _apart(model, first, other)
        principles_figure.draw(path, tables, shown, title, model.units.time)


def _apart(model: Model, first: Formulation, other: Formulation) -> list[str]:
    """Positions in the order of the table, those that differ most of all where they are many."""
    from lagcli.output.figures.principles_figure import MOST

    of = comparison.kinds(model, first.columns)
    shared = [name for name, kind in of.items() if kind == "r" and name in other.columns]
    count = min(len(first.table), len(other.table))

    def gap(name: str) -> float:
        one, two = (run.table[:count, run.columns.index(name)] for run in (first, other))
        return float(np.abs(one - two).max(initial=0.0))

    chosen = set(sorted(shared, key=gap, reverse=True)[:MOST])
    return [name for name in shared if name in chosen]
