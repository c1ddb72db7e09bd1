"""The figure of a run, `simulate --plot`, and the columns that `--columns` picks."""

from __future__ import annotations

import math
import pathlib

import numpy as np
import numpy.typing as npt

from lagcli.api.runs.simulation_run import SimulationRun
from lagcli.cli.requests.asked_run import SimulateOptions
from lagcli.cli.terminal import exits
from lagcli.output.figures import decimate
from lagcli.output.files import write_guard

Floats = npt.NDArray[np.float64]


def picked(names: tuple[str, ...], options: SimulateOptions, by_name: tuple[str, ...] = ()) -> list[int]:
    """The numbers of the columns to write. Raises `exits.UsageError`."""
    if options.columns is None:
        return list(range(len(names)))
    from lagcli.output.tables import column_choice

    try:
        return column_choice.select(names, options.columns, by_name)
    except column_choice.UnknownColumn as error:
        raise exits.UsageError(f"--columns: {error}") from None


def draw(ready: SimulationRun, options: SimulateOptions, kept: decimate.DecimatedRows) -> None:
    """The figure, where one is asked for."""
    rows = kept.rows()
    if options.plot is not None and len(rows):
        # matplotlib takes a third of a second to load: only where a figure is asked for.
        from lagcli.model import dimension_facts
        from lagcli.output.figures import panels

        names, drawn = _drawn(ready.columns, rows, options, ready.by_name)
        title = ready.model.title or pathlib.Path(ready.model.path).stem
        with write_guard.drawing(options.plot):
            from lagcli.output.figures import figure

            figure.draw(
                pathlib.Path(options.plot),
                names,
                drawn,
                title=title,
                units=ready.model.units,
                facts=panels.PanelFacts(
                    ready.stats.indeterminate,
                    _zeros(ready, rows),
                    dimension_facts.of(ready.model),
                    len(names) < len(ready.columns),
                    kept.marks,
                ),
            )


def late_marks(ready: SimulationRun, options: SimulateOptions) -> str:
    """That the figure of a resumed run marks no incidents of the run before, which are in no file; or nothing."""
    point = ready.resumed
    if options.plot is None or point is None or not point.mark.told.incidents:
        return ""
    t = max(point.mark.origin + point.mark.row, point.mark.told.last or -math.inf)
    return f"marks of incidents in {options.plot} begin after t = {t:.9g}: those before are in no file that goes on"


def _drawn(
    names: tuple[str, ...], rows: Floats, options: SimulateOptions, by_name: tuple[str, ...]
) -> tuple[tuple[str, ...], Floats]:
    """The columns of the figure: those of multipliers and reactions that `--columns` names, all where it names none."""
    if options.columns is None:
        return names, rows
    everything = (*names, *by_name)
    chosen = [everything[i] for i in picked(names, options, by_name)]
    # A reaction of a particle is drawn with all its components.
    groups = {
        name.removesuffix(f".{name[-1]}") for name in chosen if name.startswith("R.") and name[-2] == "."
    }
    kept = [
        i
        for i, name in enumerate(names)
        if name in chosen or (name.startswith("R.") and name.rpartition(".")[0] in groups)
    ]
    kept = [i for i in kept if names[i].startswith(("lambda.", "R."))]
    if not kept:
        if not options.quiet:
            exits.say("note: --columns names no multiplier and no reaction; the figure shows all of them")
        return names, rows
    kept = [names.index("t"), *kept]
    return tuple(names[i] for i in kept), rows[:, kept]


def _zeros(ready: SimulationRun, rows: Floats) -> list[str]:
    """The columns that are zero to rounding."""
    floors = ready.floors()
    floors.take(rows)
    return [name for name, is_zero in zip(ready.columns, floors.zeros(), strict=True) if is_zero]
