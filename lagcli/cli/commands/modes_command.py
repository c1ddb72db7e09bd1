"""`lagcli modes`: how it swings about an equilibrium or a steady motion, and whether it stays."""

from __future__ import annotations

import math
import pathlib
from typing import TYPE_CHECKING, Annotated

from lagcli import doubles
from lagcli.cli.commands import options
from lagcli.cli.terminal import console, exits
from lagcli.model import settings
from lagcli.output.files import formats, write_guard

if TYPE_CHECKING:
    from lagcli.linearization.linear_modes import Modes

MOST_MODES, MOST_COORDINATES = 60, 8  # what fits a screen; --json has all
VERDICTS = {True: "stable", False: "unstable", None: "not decided"}


@options.command()
def modes(
    model: options.ModelArgument,
    plot: Annotated[str | None, options.file("figure of the shapes: png, svg, pdf")] = None,
    about: Annotated[str, options.named("WHAT", "start, equilibrium, or the one that fits: auto")] = "auto",
    lowest: Annotated[
        int | None, options.named("N", "how many modes of a model of more than 600 coordinates (20)")
    ] = None,
    animate: Annotated[str | None, options.file("the modes as a page (.html) that shows them swing")] = None,
    assemble: options.AssembleOption = False,
    limit: options.LimitOption = settings.LIMIT,
    changes: options.SetOption = None,
    as_json: options.JsonOption = False,
    quiet: options.QuietOption = False,
    verbose: options.VerboseOption = False,
) -> None:
    """Linearize about the start, if that is an equilibrium or a steady motion, else, where it is at rest, about the
    nearest equilibrium, and print frequencies, shapes and whether it is stable.

    Exit 4 where the start moves otherwise, and where there is no equilibrium to be found.
    """
    options.require_models([model])
    outputs = ("--animate", animate, ("html",)), ("--plot", plot, formats.FIGURES)
    write_guard.require([("MODEL", model)], *outputs)
    read = options.read(model, changes, as_json, verbose)
    from lagcli.api import find_modes

    with options.refusals(as_json), options.stops():
        try:
            moved = True if assemble else None
            found = find_modes.modes(read, about=about, assemble=moved, limit=limit, lowest=lowest)
        except find_modes.NoEquilibriumError as error:
            exits.print_err(f"lagcli: {error}")
            raise exits.Exit(exits.UNDECIDED) from None
    if plot is not None:
        # matplotlib takes a third of a second to load: only where a figure is asked for.
        with write_guard.drawing(plot):
            from lagcli.output.figures import figure_page, result_figures

            title = read.title or pathlib.Path(read.path).stem
            figure_page.write(plot, result_figures.modes(found, title))
    if animate is not None:
        # Other answers draw no scene.
        from lagcli.api import animate as animating
        from lagcli.output.animation import page
        from lagcli.output.animation.builder import NothingToShow

        try:
            scene = animating.of_modes(read, found)
        except NothingToShow as error:
            raise exits.UsageError(f"--animate: {error}") from None
        with write_guard.writing(animate):
            page.write(pathlib.Path(animate), scene)
    if as_json:
        print(formats.json_line(found.as_json()))
    elif plot is None and animate is None:
        _print_report(found)
    exits.print_notes(found.notes, quiet)


def _print_report(found: Modes) -> None:
    """The modes as a table, then the verdict and the state about which the equations are linear."""
    if found.count:
        # A line for each multiplier, frequency, or else for each eigenvalue, of two that are conjugate one
        unit, rows = found.units.time if found.units else "s", []
        if found.multipliers is not None:
            headers = ["", "real part", "imaginary part", "size"]
            for k, z in enumerate(found.multipliers[:MOST_MODES], 1):
                rows.append([str(k), f"{z.real:.10g}", f"{z.imag:.10g}", f"{abs(z):.10g}"])
        elif found.frequencies is not None:
            headers = ["", f"ω (1/{unit})", f"period ({unit})", "shape"]
            for k, w in enumerate(found.frequencies[:MOST_MODES]):
                period, shape = f"{2 * math.pi / w:.6g}" if w else "", _shape(found, k)
                rows.append([str(k + 1), f"{w:.10g}", period, shape])
        else:
            headers = ["", f"real part (1/{unit})", f"imaginary part (1/{unit})", "shape"]
            for k, z in enumerate(found.eigenvalues[:MOST_MODES]):
                if z.imag >= 0:
                    imaginary = f"{'±' if z.imag else ''}{abs(z.imag):.10g}"
                    rows.append([str(len(rows) + 1), f"{z.real + 0.0:.10g}", imaginary, _shape(found, k)])
        console.table(headers, rows, {})
        count = max(len(found.shapes), 0 if found.multipliers is None else len(found.multipliers))
        print()
        if count > MOST_MODES:
            console.paragraph(f"{count - MOST_MODES} more are given with --json")
    console.paragraph(f"{VERDICTS[found.stable]}: {found.reason}")
    size = max((abs(value) for value in found.at.values()), default=0.0)
    state = {name: value if abs(value) > doubles.VALUE * size else 0.0 for name, value in found.at.items()}
    named = [f"{name} = {value:.6g}" for name, value in state.items()]
    more = f" and {len(named) - MOST_COORDINATES} more" if len(named) > MOST_COORDINATES else ""
    console.paragraph(f"linearized at {', '.join(named[:MOST_COORDINATES])}{more}")


def _shape(found: Modes, k: int) -> str:
    """The largest entries of a shape by name; nothing where it is not known."""
    import numpy as np

    if k >= len(found.shapes):
        return ""
    shape = found.shapes[k]
    order = np.argsort(-np.abs(shape).round(9), kind="stable")
    largest = sorted(int(i) for i in order[:MOST_COORDINATES] if shape[i])
    words = []
    for i in largest:
        z = complex(shape[i])
        entry = f"{z.real:.4g}" if z.real or not z.imag else ""
        if z.imag:
            entry += f"{z.imag:+.4g}i" if z.real else f"{z.imag:.4g}i"
        words.append(f"{found.coordinates[i]} {entry}")
    more = int(np.count_nonzero(shape)) - len(largest)
    return ", ".join(words) + (f" and {more} more" if more > 0 else "")
