"""`lagcli modes`: how it swings about an equilibrium or a steady motion, and whether it stays."""

from __future__ import annotations

import math
import pathlib
from typing import TYPE_CHECKING, Annotated

import typer

from lagcli import doubles
from lagcli.cli.commands import model_reading, options
from lagcli.cli.terminal import console, exits
from lagcli.model import settings
from lagcli.output.files import formats, write_guard

if TYPE_CHECKING:
    from lagcli.linearization.linear_modes import Modes
    from lagcli.model.model import Model


MOST_MODES, MOST_COORDINATES = 60, 8  # what fits a screen; --json has all
VERDICTS = {True: "stable", False: "unstable", None: "not decided"}


@exits.command
def modes(
    model: options.ModelArgument,
    plot: Annotated[
        str | None, typer.Option("--plot", metavar="FILE", help="figure of the shapes: png, svg, pdf")
    ] = None,
    about: Annotated[
        str, typer.Option(metavar="WHAT", help="start, equilibrium, or the one that fits: auto")
    ] = "auto",
    lowest: Annotated[
        int | None,
        typer.Option(metavar="N", help="how many modes of a model of more than 600 coordinates (20)"),
    ] = None,
    animate: Annotated[
        str | None,
        typer.Option("--animate", metavar="FILE", help="the modes as a page (.html) that shows them swing"),
    ] = None,
    assemble: options.AssembleOption = False,
    limit: options.LimitOption = settings.LIMIT,
    changes: options.SetOption = None,
    as_json: options.JsonOption = False,
    quiet: options.QuietOption = False,
    verbose: options.VerboseOption = False,
    debug: options.DebugOption = False,
) -> None:
    """Linearize about the start, if that is an equilibrium or a steady motion, else, where it is at rest, about the
    nearest equilibrium, and print frequencies, shapes and whether it is stable.

    Exit 4 where the start moves otherwise, and where there is no equilibrium to be found.
    """
    model_reading.require_models([model])
    page, figure = ("--animate", animate, ("html",)), ("--plot", plot, formats.FIGURES)
    write_guard.require([("MODEL", model)], page, figure)
    read = model_reading.read(model, changes, as_json, verbose)
    from lagcli.api import find_modes

    with model_reading.refusals(as_json), model_reading.stops():
        try:
            found = find_modes.modes(
                read, about=about, assemble=True if assemble else None, limit=limit, lowest=lowest
            )
        except find_modes.NoEquilibriumError as error:
            exits.print_err(f"lagcli: {error}")
            raise exits.Exit(exits.UNDECIDED) from None
    if plot is not None:
        # matplotlib takes a third of a second to load: only where a figure is asked for.
        with write_guard.drawing(plot):
            from lagcli.output.figures import figure_page, modes_figure

            title = read.title or pathlib.Path(read.path).stem
            figure_page.write(plot, modes_figure.compose(found, title))
    if animate is not None:
        _animate(found, read, animate)
    if as_json:
        print(formats.json_line(found.as_json()))
    elif plot is None and animate is None:
        _print_report(found)
    exits.print_notes(found.notes, quiet)


def _animate(found: Modes, model: Model, path: str) -> None:
    # Other answers draw no scene.
    from lagcli.api import animate_modes
    from lagcli.output.animation import page
    from lagcli.output.animation.builder import NothingToShow

    try:
        scene = animate_modes.of_modes(model, found)
    except NothingToShow as error:
        raise exits.UsageError(f"--animate: {error}") from None
    with write_guard.writing(path):
        page.write(pathlib.Path(path), scene)


def _print_report(found: Modes) -> None:
    """The modes as a table, then the verdict."""
    if not found.count:
        console.paragraph(f"{VERDICTS[found.stable]}: {found.reason}", "    ")
        console.paragraph(_reference_text(found), "    ")
        return
    unit = found.units.time if found.units else "s"
    headers, rows = _multipliers(found) if found.multipliers is not None else _modes(found, unit)
    console.table(headers, rows, {})
    hidden = (
        max(map(len, (found.shapes, found.multipliers if found.multipliers is not None else ()))) - MOST_MODES
    )
    print()
    if hidden > 0:
        console.paragraph(f"{hidden} more are given with --json", "    ")
    verdict = f"{VERDICTS[found.stable]}: {found.reason}"
    console.paragraph(verdict, "    ")
    console.paragraph(_reference_text(found), "    ")


def _reference_text(found: Modes) -> str:
    """The first columns of the state about which the equations are linear."""
    size = max((abs(value) for value in found.at.values()), default=0.0)
    state = {name: value if abs(value) > doubles.VALUE * size else 0.0 for name, value in found.at.items()}
    named = [f"{name} = {value:.6g}" for name, value in state.items()]
    more = f" and {len(named) - MOST_COORDINATES} more" if len(named) > MOST_COORDINATES else ""
    return f"linearized at {', '.join(named[:MOST_COORDINATES])}{more}"


def _modes(found: Modes, unit: str) -> tuple[list[str], list[list[str]]]:
    """A line for each frequency, or else for each eigenvalue, of two that are conjugate one."""
    if found.frequencies is not None:
        headers = ["", f"ω (1/{unit})", f"period ({unit})", "shape"]
        rows = [
            [
                str(k + 1),
                f"{w:.10g}",
                f"{2 * math.pi / w:.6g}" if w else "",
                _shape(found, k) if k < len(found.shapes) else "",
            ]
            for k, w in enumerate(found.frequencies[:MOST_MODES])
        ]
        return headers, rows
    headers = ["", f"real part (1/{unit})", f"imaginary part (1/{unit})", "shape"]
    rows = []
    for k, z in enumerate(found.eigenvalues[:MOST_MODES]):
        if z.imag >= 0:
            sign = "±" if z.imag else ""
            rows.append(
                [str(len(rows) + 1), f"{z.real + 0.0:.10g}", f"{sign}{abs(z.imag):.10g}", _shape(found, k)]
            )
    return headers, rows


def _multipliers(found: Modes) -> tuple[list[str], list[list[str]]]:
    assert found.multipliers is not None
    headers = ["", "real part", "imaginary part", "size"]
    rows = [
        [str(k + 1), f"{z.real:.10g}", f"{z.imag:.10g}", f"{abs(z):.10g}"]
        for k, z in enumerate(found.multipliers[:MOST_MODES])
    ]
    return headers, rows


def _shape(found: Modes, k: int) -> str:
    """The largest entries of a shape by name."""
    import numpy as np

    shape = found.shapes[k]
    order = np.argsort(-np.abs(shape).round(9), kind="stable")
    largest = sorted(int(i) for i in order[:MOST_COORDINATES] if shape[i])
    words = [f"{found.coordinates[i]} {_entry(complex(shape[i]))}" for i in largest]
    more = int(np.count_nonzero(shape)) - len(largest)
    return ", ".join(words) + (f" and {more} more" if more > 0 else "")


def _entry(z: complex) -> str:
    if not z.imag:
        return f"{z.real:.4g}"
    return f"{z.real:.4g}{z.imag:+.4g}i" if z.real else f"{z.imag:.4g}i"
