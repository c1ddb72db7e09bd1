"""The figure of modes: each shape over the coordinates, or of particles over the particles."""

import numpy as np
from matplotlib import axes, figure
from numpy.typing import NDArray

from lagcli.linearization.linear_modes import Modes
from lagcli.output.figures import figure_page, labels

MOST_PANELS, COLUMNS = 12, 3  # of one page, and in one line of it
# More bars than these are drawn as a line.
MOST_BARS = 12
ABOUT = {"equilibrium": "an equilibrium", "steady": "a steady motion", "periodic": "a periodic motion"}
_COLOURS = ("#0072B2", "#D55E00", "#009E73")
_HEIGHT = 1.75  # inches of a row of panels


def compose(found: Modes, title: str) -> figure.Figure:
    """The figure of modes."""
    # The shapes that are drawn: of two that are conjugate one, zeros last where not all find room
    if found.frequencies is not None:
        every = list(range(min(len(found.shapes), len(found.frequencies))))
        every.sort(key=lambda k: found.frequencies is not None and found.frequencies[k] == 0)
    else:
        every = [k for k, z in enumerate(found.eigenvalues[: len(found.shapes)]) if z.imag >= 0]
        every.sort(key=lambda k: found.eigenvalues[k] == 0)
    shown = sorted(every[:MOST_PANELS])
    rows = max(1, -(-len(shown) // COLUMNS))
    with figure_page.style():
        name = labels.shortened(title, labels.NAME)
        verdict = {True: "stable", False: "unstable", None: "stability not decided"}[found.stable]
        drawn = figure_page.sheet(
            f"{name}: modes about {ABOUT[found.about]}, {verdict}", 0.9 + _HEIGHT * rows
        )
        plots = drawn.subplots(rows, COLUMNS, squeeze=False, sharey=True)
        for plot, k in zip(plots.flat, shown, strict=False):
            plot.set_title(_heading(found, k), fontsize=8)
            plot.set_ylim(-1.2, 1.6)
            plot.set_yticks([-1, 0, 1])
            plot.axhline(0.0, color="#888888", linewidth=0.6, zorder=0)
            plot.tick_params(labelsize=7)
            shape = found.shapes[k]
            if all(name[-2:] in (".x", ".y", ".z") for name in found.coordinates):
                _particles(plot, found, shape)
            else:
                _bars(plot, found, shape)
        for plot in list(plots.flat)[len(shown) :]:
            plot.set_visible(False)
        return drawn


def _heading(found: Modes, k: int) -> str:
    unit = labels.shortened(found.units.time, labels.UNIT) if found.units else "s"
    if found.frequencies is not None:
        return f"ω = {found.frequencies[k]:.6g}/{unit}"
    z = found.eigenvalues[k]
    text = f"s = {z.real:.5g} ± {z.imag:.5g}i" if z.imag else f"s = {z.real:.6g}"
    return f"{text} (1/{unit})".replace("-", "−")


def _particles(plot: axes.Axes, found: Modes, shape: NDArray[np.complex128]) -> None:
    """x, y and z over the particles, with a mark at each where they are few; imaginary parts dashed."""
    names = [name[:-2] for name in found.coordinates[::3]]
    numbers = np.arange(1, len(names) + 1)
    mark = "o" if len(names) <= 40 else None
    for axis, colour in enumerate(_COLOURS):
        own = shape[axis::3]
        for part, style in ((own.real, "-"), (own.imag, (0, (3, 2)))):
            if np.any(part):
                plot.plot(
                    numbers, part, color=colour, linestyle=style, marker=mark, markersize=2.5, linewidth=1.2,
                    label="xyz"[axis],
                )  # fmt: skip
    if len(names) <= MOST_BARS:
        plot.set_xticks(numbers, [labels.shortened(name, 10) for name in names], fontsize=6)
    plot.set_xlim(0.5, len(names) + 0.5)
    plot.legend(fontsize=6, frameon=False, loc="upper right", handlelength=1.2, borderpad=0.1)


def _bars(plot: axes.Axes, found: Modes, shape: NDArray[np.complex128]) -> None:
    """A bar for each coordinate, beside it a lighter one of the imaginary part."""
    numbers = np.arange(1, shape.size + 1)
    if shape.size > MOST_BARS:
        plot.plot(numbers, shape.real, color=_COLOURS[0], linewidth=1.2)
        if np.any(shape.imag):
            plot.plot(numbers, shape.imag, color=_COLOURS[1], linewidth=1.2, linestyle=(0, (3, 2)))
        return
    has_both = bool(np.any(shape.imag))
    width = 0.38 if has_both else 0.6
    plot.bar(numbers - (width / 2 if has_both else 0.0), shape.real, width, color=_COLOURS[0])
    if has_both:
        plot.bar(numbers + width / 2, shape.imag, width, color="#8FC1E3")
    plot.set_xticks(numbers, [labels.shortened(name, 10) for name in found.coordinates], fontsize=7)
    plot.set_xlim(0.4, shape.size + 0.6)
