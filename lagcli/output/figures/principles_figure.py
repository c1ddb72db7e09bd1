"""The figure of two motions side by side, each column over time, with the multipliers of one of them."""

import dataclasses
import os
from collections.abc import Sequence

import numpy as np
from matplotlib import axes, figure
from matplotlib.backends import backend_agg
from numpy.typing import NDArray

from lagcli.output.figures import figure_page, labels

_COLOURS = ("#009E73", "#CC79A7", "#E69F00", "#56B4E9")
_BLUE, _RED = "#0072B2", "#D55E00"
_HEIGHT = 1.75  # inches of a row of panels
MOST = 4  # columns that are drawn


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class MotionTable:
    """A table (T, columns), the time first, with the name of what it is of."""

    name: str
    columns: Sequence[str]
    rows: NDArray[np.float64]

    def of(self, column: str) -> NDArray[np.float64]:
        """A column (T,)."""
        return self.rows[:, list(self.columns).index(column)]


def draw(
    path: str | os.PathLike[str],
    motions: tuple[MotionTable, MotionTable],
    shown: Sequence[str],
    title: str,
    unit: str = "s",
) -> None:
    """Draw the columns ``shown`` of two motions, and the columns ``mu.*`` of the second, to ``path``.

    The first ``MOST`` columns are drawn. Written aside and moved into place. Raises ``formats.UnknownFormat``, OSError.
    """
    figure_page.draw(path, lambda: compose(motions, shown, title, unit))


def compose(
    motions: tuple[MotionTable, MotionTable], shown: Sequence[str], title: str, unit: str = "s"
) -> figure.Figure:
    """The figure that ``draw`` writes."""
    first, second = motions
    names = list(shown)[:MOST]
    mu = [name for name in second.columns if name.startswith("mu.")]
    count = len(names) + bool(mu)
    lines = -(-count // 2)
    with figure_page.style():
        height = 0.95 + _HEIGHT * lines
        drawn = figure.Figure(figsize=(7.2, height), dpi=200)
        backend_agg.FigureCanvasAgg(drawn)
        drawn.suptitle(
            labels.shortened(title, labels.TITLE), fontsize=10, fontweight="bold", y=1 - 0.08 / height
        )
        panels = drawn.subplots(lines, 2 if count > 1 else 1, sharex=True, squeeze=False).ravel()
        drawn.subplots_adjust(
            left=0.09, right=0.97, bottom=0.45 / height, top=1 - 0.62 / height, wspace=0.24, hspace=0.28
        )
        for panel, name in zip(panels, names, strict=False):
            panel.plot(first.rows[:, 0], first.of(name), color=_BLUE, linewidth=1.2, label=first.name)
            look = (0, (5, 2))
            panel.plot(
                second.rows[:, 0],
                second.of(name),
                color=_RED,
                linewidth=1.2,
                linestyle=look,
                label=second.name,
            )
            _finish(panel, labels.shortened(name, labels.NAME))
        drawn.legend(
            *panels[0].get_legend_handles_labels(), loc="upper center", ncol=2, fontsize=8, frameon=False,
            bbox_to_anchor=(0.5, 1 - 0.22 / height),
        )  # fmt: skip
        if mu:
            _multipliers(panels[len(names)], second, mu)
        for panel in panels[count:]:
            panel.set_visible(False)
        for panel in panels[max(0, count - 2) : count]:
            panel.set_xlabel(f"t ({unit})" if unit not in ("", "1") else "t", fontsize=8)
            panel.tick_params(labelbottom=True)
        return drawn


def _multipliers(panel: axes.Axes, motion: MotionTable, mu: Sequence[str]) -> None:
    for index, name in enumerate(mu):
        label = labels.shortened(name.removeprefix("mu."), labels.NAME)
        colour = _COLOURS[index % len(_COLOURS)]
        panel.plot(motion.rows[:, 0], motion.of(name), color=colour, linewidth=1.0, label=label)
    many = len(mu) > len(_COLOURS)
    _finish(panel, "μ of the rows" if len(mu) > 1 else f"μ of {labels.shortened(mu[0][3:], labels.NAME)}")
    if len(mu) > 1 and not many:
        panel.legend(fontsize=7, frameon=False)


def _finish(panel: axes.Axes, title: str) -> None:
    panel.set_title(title, fontsize=8, loc="left")
    panel.tick_params(labelsize=7)
    panel.margins(x=0.01)
