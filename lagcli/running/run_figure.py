"""The figure of a run, `simulate --plot`."""

from __future__ import annotations

import pathlib

import numpy as np
import numpy.typing as npt

from lagcli.model import dimension_facts
from lagcli.output.figures import panels
from lagcli.output.figures.chart import DecimatedRows
from lagcli.output.files import write_guard
from lagcli.running.simulation_run import SimulationRun

Floats = npt.NDArray[np.float64]

# Said where the columns that are written name nothing that a figure shows.
ALL_SHOWN = "--columns names no multiplier and no reaction; the figure shows all of them"


def columns(names: tuple[str, ...], chosen: tuple[str, ...] | None) -> tuple[list[int], str]:
    """The columns that are drawn, by their numbers, and what there is to note about them, or nothing.

    chosen: the columns that are written, None for all: of multipliers and reactions those are drawn, and where they
    name none all.
    """
    everything = list(range(len(names)))
    if chosen is None:
        return everything, ""
    # A reaction of a particle is drawn with all its components.
    groups = {
        name.removesuffix(f".{name[-1]}") for name in chosen if name.startswith("R.") and name[-2] == "."
    }
    needed = [
        i
        for i, name in enumerate(names)
        if name.startswith(("lambda.", "R."))
        and (name in chosen or (name.startswith("R.") and name.rpartition(".")[0] in groups))
    ]
    return ([names.index("t"), *needed], "") if needed else (everything, ALL_SHOWN)


def draw(path: str, run: SimulationRun, decimated: DecimatedRows, picked: list[int]) -> None:
    """Draw columns of the rows of a run into a file. Raises `write_guard.WriteError`."""
    rows = decimated.rows()
    with write_guard.drawing(path):
        # matplotlib takes a third of a second to load.
        from lagcli.output.charts import chart_figure
        from lagcli.output.figures import figure_page

        drawn = chart_figure.compose_run(
            tuple(run.columns[i] for i in picked),
            rows[:, picked],
            title=run.model.title or pathlib.Path(run.model.path).stem,
            units=run.model.units,
            facts=panels.PanelFacts(
                run.stats.indeterminate,
                _zeros(run, rows),
                dimension_facts.of(run.model),
                len(picked) < len(run.columns),
                decimated.marks,
            ),
        )
        figure_page.write(path, drawn)


def _zeros(run: SimulationRun, rows: Floats) -> list[str]:
    """The columns that are zero to rounding."""
    floors = run.floors()
    floors.take(rows)
    return [name for name, is_zero in zip(run.columns, floors.zeros(), strict=True) if is_zero]
