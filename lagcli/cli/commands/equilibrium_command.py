"""`lagcli equilibrium`: the points of rest of a model."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from lagcli.cli.commands import options
from lagcli.cli.terminal import console, exits
from lagcli.model import settings
from lagcli.output.files import formats, write_guard

if TYPE_CHECKING:
    from lagcli.model.model import Model
    from lagcli.statics.static_report import StaticReport


@options.command()
def equilibrium(
    model: options.ModelArgument,
    output: options.PointsOption = None,
    starts: options.StartsOption = 32,
    seed: options.SeedOption = 0,
    limit: options.LimitOption = settings.LIMIT,
    changes: options.SetOption = None,
    as_json: options.JsonOption = False,
    quiet: options.QuietOption = False,
    verbose: options.VerboseOption = False,
) -> None:
    """Find the points of rest: with zero velocities and accelerations the equations of motion hold at every t.

    With lambda, R, the effective potential and the type by the bordered Hessian. Exit 4 where none is found.
    """
    from lagcli.api import static_points

    write_guard.require_outputs(model, output, None, as_json)
    read = options.read(model, changes, as_json, verbose)
    with options.refusals(as_json, "--{}".format):
        found = static_points.equilibrium(read, starts=starts, seed=seed, limit=limit)
    print_report(read, found, output, as_json, quiet)


MOST_COLUMNS, MOST_ROWS = 12, 60  # what fits a screen; -o has all


def print_report(model: Model, found: StaticReport, output: str | None, as_json: bool, quiet: bool) -> None:
    """Write the points where they are asked for. Raises `exits.Exit` with 4 where there are none."""
    if output is not None and found.points:
        from lagcli.output.tables import provenance, sinks

        numbers, types = found.table()
        target = sys.stdout.buffer if output == "-" else output
        name = "standard output" if output == "-" else output
        whence = provenance.of(model).as_json()
        with (
            write_guard.writing(name),
            sinks.open_sink(target, (*found.columns, "type"), whence, ("type",)) as sink,
        ):
            sink.write(numbers, [types])
    if as_json:
        print(formats.json_line(found.as_json()))
    elif output != "-" and found.points:
        first = found.points[0]
        names = [*first.at, *(f"lambda.{name}" for name in first.multipliers)]
        shown = names[:MOST_COLUMNS]
        rows = []
        for number, point in enumerate(found.points[:MOST_ROWS]):
            values = [*point.at.values(), *point.multipliers.values()][: len(shown)]
            kind = point.type or "-"
            if point.dimension:
                kind += f", continuum of dimension {point.dimension}"
            index = "-" if point.index is None else str(point.index)
            value = "-" if point.value is None else _entry(point.value)
            rows.append([str(number), value, kind, index, *map(_entry, values), f"{point.residual:.1e}"])
        console.table(["", found.called, "type", "index", *shown, "residual"], rows, {})
        if len(names) > len(shown) or len(found.points) > MOST_ROWS:
            console.paragraph("more columns and rows are given with --json and -o FILE")
        count, starts = console.counted(len(found.points), "point"), console.counted(found.starts, "start")
        proved = "; it is proved that there are no others" if found.complete else "; there may be others"
        console.paragraph(f"{count} from {starts}{proved}")
    exits.print_notes(found.notes, quiet)
    if not found.points:
        best = ""
        if found.complete:
            best = "; it is proved that there is none"
        elif found.best_residual is not None and found.best_residual != float("inf"):
            best = f"; the least residual met is {found.best_residual:.6g}"
        what = "stationary point" if found.called == "value" else "point of rest"
        exits.print_err(f"lagcli: no {what} was found from {console.counted(found.starts, 'start')}{best}")
        raise exits.Exit(exits.UNDECIDED)


def _entry(value: float) -> str:
    return "0" if abs(value) < 1e-14 else f"{value:.9g}"
