"""The figure of a witness: the loop in two of the coordinates that come back, and the coordinate that moves."""

import itertools

import numpy as np
from matplotlib import axes, figure

from lagcli.analysis.holonomy import witness
from lagcli.arrays import Floats
from lagcli.output.figures import figure_page, labels
from lagcli.output.figures.figure_page import BLUE, GREY, INK, RED

WHITE = {"facecolor": "white", "edgecolor": "none", "pad": 1.0}
NEAR = 0.07  # of the width of a plot: numbers closer than this would overlap


def compose(found: witness.Witness) -> figure.Figure:
    """The figure of a witness."""
    with figure_page.style():
        back = ", ".join(found.back) if len(found.back) <= 5 else f"{', '.join(found.back[:4])}, ..."
        how = "over equal times" if found.is_timed else f"around a closed loop in {back}"
        row, coordinate = (labels.shortened(name, labels.NAME) for name in (found.row, found.coordinate))
        title = f"{row}: {coordinate} moves by {found.amount:.6g} {how}".replace("-", "−")
        drawn = figure_page.sheet(title, 3.4)
        left, right = drawn.subplots(1, 2)
        if found.is_timed:
            _times(left, found, _widest(found)[0])
            _times(right, found, found.along(found.coordinate))
        else:
            _loop(left, found)
            # The coordinate over the moves; the gap between its ends is the amount
            path, p = found.paths[0], found.along(found.coordinate)
            values = path.points[:, p]
            moves = np.linspace(0, len(path.corners) - 1, len(values))
            for edge in range(len(path.corners)):
                right.axvline(edge, color="#dddddd", linewidth=0.6, zorder=0)
            right.plot(moves, values, color=RED, linewidth=1.4)
            _gap(right, moves[-1], values[0], values[-1], found.amount)
            right.axhline(values[0], color=GREY, linewidth=0.6, linestyle=(0, (3, 3)))
            edges = np.arange(len(path.corners) - 1)
            right.set_xticks(edges + 0.5, [f"{k + 1}" for k in edges])
            right.set_xlabel("move", fontsize=9)
            right.set_ylabel(labels.shortened(found.coordinate, labels.NAME), fontsize=9)
        for plot in (left, right):
            plot.tick_params(labelsize=8)
            plot.margins(0.12)
        return drawn


def _widest(found: witness.Witness) -> list[int]:
    """Indices of the coordinates that come back, those a person moves first, then by how far they go."""
    points = np.concatenate([path.points for path in found.paths])
    reach = np.ptp(points, axis=0)
    indices = [found.along(name) for name in found.back]
    return sorted(indices, key=lambda i: (found.names[i] not in found.free or reach[i] < 1e-9, -reach[i]))


def _loop(plot: axes.Axes, found: witness.Witness) -> None:
    """The loop with its corners numbered in the order they are passed."""
    i, j, *_ = [*_widest(found), found.names.index("t")]
    path = found.paths[0]
    x, y = path.points[:, i], path.points[:, j]
    plot.plot(x, y, color=BLUE, linewidth=1.4)
    extent = np.array([np.ptp(x), np.ptp(y)])
    extent[extent == 0] = 1.0
    seen: list[Floats] = []
    for number, (before, after) in enumerate(itertools.pairwise(path.corners), 1):
        a, b = before[[i, j]], after[[i, j]]
        if np.abs(b - a).max() < 1e-9:
            continue
        halfway = (2 * number - 1) * (len(path.points) - 1) // (2 * (len(path.corners) - 1))
        middle = path.points[halfway, [i, j]]
        plot.annotate("", xy=middle + 0.02 * (b - a), xytext=middle - 0.02 * (b - a),
                      arrowprops={"arrowstyle": "-|>", "color": BLUE})  # fmt: skip
        # Moves along the same line are numbered beside each other.
        beside = sum(np.abs((middle - other) / extent).max() < NEAR for other in seen)
        seen.append(middle)
        offset = (5 + 10 * beside, 4)
        plot.annotate(f"{number}", tuple(middle), offset, textcoords="offset points", fontsize=8)
    plot.plot(*path.corners[0][[i, j]], "o", color=INK, markersize=4)
    plot.set_xlabel(labels.shortened(found.names[i], labels.NAME), fontsize=9)
    plot.set_ylabel(labels.shortened(found.names[j], labels.NAME), fontsize=9)


def _times(plot: axes.Axes, found: witness.Witness, index: int) -> None:
    """One coordinate over time on both paths."""
    ends: list[Floats] = []
    for path, colour, style in zip(found.paths, (RED, BLUE), ("-", (0, (5, 2))), strict=True):
        plot.plot(path.points[:, -1], path.points[:, index], color=colour, linestyle=style, linewidth=1.4)
        ends.append(path.points[-1])
    if found.names[index] == found.coordinate:
        _gap(plot, ends[0][-1], ends[1][index], ends[0][index], found.amount)
    plot.set_xlabel("t", fontsize=9)
    plot.set_ylabel(labels.shortened(found.names[index], labels.NAME), fontsize=9)


def _gap(plot: axes.Axes, x: float, low: float, high: float, amount: float) -> None:
    plot.annotate("", xy=(x, high), xytext=(x, low), arrowprops={"arrowstyle": "<->", "color": INK})
    text = f"{amount:.6g}".replace("-", "−")
    middle = (x, (low + high) / 2)
    plot.annotate(text, middle, (-5, 0), textcoords="offset points", ha="right", bbox=WHITE, fontsize=9)
