"""The figure of two motions side by side, each column over time, with the multipliers of one of them."""

import dataclasses
from collections.abc import Sequence

import numpy as np
from matplotlib import axes, figure
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


def compose(
    motions: tuple[MotionTable, MotionTable], shown: Sequence[str], title: str, unit: str = "s"
) -> figure.Figure:
    """The figure of the columns ``shown`` of two motions, of which the first ``MOST`` are drawn, and of the columns
    ``mu.*`` of the second. ``unit``: the label of time."""
    first, second = motions
    names = list(shown)[:MOST]
    mu = [name for name in second.columns if name.startswith("mu.")]
    count = len(names) + bool(mu)
    lines = -(-count // 2)
    with figure_page.style():
        drawn = figure_page.sheet(labels.shortened(title, labels.TITLE), 0.95 + _HEIGHT * lines)
        panels = drawn.subplots(lines, 2 if count > 1 else 1, sharex=True, squeeze=False).ravel()
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
            *panels[0].get_legend_handles_labels(),
            loc="outside lower center",
            ncol=2,
            fontsize=8,
            frameon=False,
        )
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
