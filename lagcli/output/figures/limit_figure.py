"""The figure of a stiff limit: the force over time, the force against stiffness, the error against 1/k."""

import dataclasses
from collections.abc import Sequence

import numpy as np
from matplotlib import axes, axis, figure, ticker
from numpy.typing import NDArray

from lagcli.output.figures import figure_page, labels

_BLUE, _RED, _GREY, _GREEN = "#0072B2", "#D55E00", "#888888", "#009E73"


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class LimitCurves:
    """The curves of the figure.

    t (T,) and multiplier (T,): of the constrained run; forces: stiffnesses with -k f (T,), softest first, of a ramp one
    without a stiffness; spans (K, 3): k, with the least and the largest -k f of a run; errors (K, 2): k and the error;
    line (K,): the fitted errors; rate: the fit in words.
    """

    constraint: str
    t: NDArray[np.float64]
    multiplier: NDArray[np.float64]
    forces: Sequence[tuple[str, NDArray[np.float64]]]
    spans: NDArray[np.float64]
    errors: NDArray[np.float64]
    line: NDArray[np.float64] | None
    rate: str
    error_name: str


def compose(curves: LimitCurves, title: str, unit: str = "s") -> figure.Figure:
    """The figure of a limit. ``unit``: the label of time."""
    with figure_page.style():
        drawn = figure_page.sheet(labels.shortened(title, labels.TITLE), 4.9)
        panels = drawn.subplot_mosaic([["time", "time"], ["stiffness", "errors"]])
        _over_time(panels["time"], curves, unit)
        _against_stiffness(panels["stiffness"], curves)
        _errors(panels["errors"], curves)
        for panel in drawn.axes:
            panel.tick_params(labelsize=7)
        return drawn


def _over_time(panel: axes.Axes, curves: LimitCurves, unit: str) -> None:
    looks = [(_GREEN, 0.7), (_RED, 0.7)]
    for (name, force), (colour, width) in zip(curves.forces, looks, strict=False):
        panel.plot(curves.t, force, color=colour, linewidth=width, label=name)
    name = f"λ of {labels.shortened(curves.constraint, labels.NAME)}"
    panel.plot(curves.t, curves.multiplier, color=_BLUE, linewidth=1.3, linestyle=(0, (5, 2)), label=name)
    panel.set_title("force of the row", fontsize=8, loc="left")
    panel.set_xlabel(f"t ({unit})" if unit not in ("", "1") else "t", fontsize=8)
    panel.legend(fontsize=7, frameon=False, ncol=3, loc="lower right", bbox_to_anchor=(1.0, 0.98))
    panel.margins(x=0.01)


def _against_stiffness(panel: axes.Axes, curves: LimitCurves) -> None:
    panel.set_xscale("log")
    _plain(panel.xaxis)
    k, low, high = curves.spans.T
    panel.vlines(k, low, high, color=_RED, linewidth=2.2)
    for value in (curves.multiplier.min(), curves.multiplier.max()):
        panel.axhline(value, color=_BLUE, linewidth=0.9, linestyle=(0, (5, 2)))
    panel.set_title("least and largest force, and those of λ (dashed)", fontsize=8, loc="left")
    panel.set_xlabel("stiffness k", fontsize=8)
    panel.margins(x=0.08, y=0.12)


def _errors(panel: axes.Axes, curves: LimitCurves) -> None:
    found = curves.errors[(curves.errors > 0).all(axis=1)]
    panel.set_title(f"{curves.error_name} against 1/k{curves.rate}", fontsize=8, loc="left")
    panel.set_xlabel("1/k", fontsize=8)
    if not len(found):
        panel.text(0.5, 0.5, "no error above rounding", ha="center", fontsize=8, transform=panel.transAxes)
        return
    panel.set_xscale("log")
    panel.set_yscale("log")
    _plain(panel.xaxis)
    _plain(panel.yaxis)
    if curves.line is not None:
        panel.plot(1 / curves.errors[:, 0], curves.line, color=_GREY, linewidth=1.0)
    panel.plot(1 / found[:, 0], found[:, 1], "o", color=_RED, markersize=4)
    panel.margins(0.1)


def _plain(scale: axis.Axis) -> None:
    """Powers of ten as they are typed: texts of this project are never read as markup."""
    scale.set_major_locator(ticker.LogLocator(numticks=6))
    scale.set_major_formatter(ticker.FuncFormatter(lambda value, _: f"{value:.0e}".replace("-", "−")))
    scale.set_minor_formatter(ticker.NullFormatter())
