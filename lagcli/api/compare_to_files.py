"""`lagcli compare`: a comparison, and the table and the figure of the vakonomic motion in it."""

from __future__ import annotations

import pathlib
from collections.abc import Mapping, Sequence

import numpy as np

from lagcli.api import compare
from lagcli.formulations import comparison
from lagcli.formulations.comparison import Comparison, Formulation
from lagcli.model.model import Model
from lagcli.output.files import write_guard
from lagcli.output.tables import provenance
from lagcli.running import safe_table
from lagcli.running.safe_table import TablePlan


def compare_to_files(
    models: Sequence[Model], asked: Mapping[str, object], output: str | None, plot: str | None
) -> tuple[Comparison, list[str]]:
    """The comparison of one model or two, and lines to print about its table, if any.

    asked: keywords of `compare`; output: `-` for standard output. Raises what `compare` raises, `WriteError`,
    `BadRequest`.
    """
    found = compare.compare(*models, **asked)  # type: ignore[arg-type]
    lines = []
    if found.principles is not None and output is not None:
        vakonomic = found.formulations[-1]
        whence = provenance.of(models[0]).as_json() | {"vakonomic": {"mu": dict(found.principles.mu)}}
        plan, is_partial = TablePlan.of_option(output, vakonomic.columns), bool(vakonomic.stopped)
        saved = safe_table.write(plan, whence, vakonomic.table, is_partial)
        if is_partial:
            lines.append(f"lagcli: the vakonomic motion stopped; {saved}" if saved else "")
    if found.principles is not None and plot is not None:
        _draw(models[0], found, plot)
    return found, lines


def _draw(model: Model, found: Comparison, path: str) -> None:
    first, other = found.formulations[0], found.formulations[-1]
    with write_guard.drawing(path):
        # matplotlib takes a third of a second to load: only where a figure is asked for.
        from lagcli.output.figures import figure_page, principles_figure

        tables = (
            principles_figure.MotionTable("d'Alembert", first.columns, first.table),
            principles_figure.MotionTable("vakonomic", other.columns, other.table),
        )
        title = f"{model.title or pathlib.Path(model.path).stem}: two principles"
        shown = _apart(model, first, other)
        figure_page.write(path, principles_figure.compose(tables, shown, title, model.units.time))


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
