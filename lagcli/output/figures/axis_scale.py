"""The scale of an axis: its range, its ticks and their texts."""

import dataclasses
from collections.abc import Iterable

import numpy as np
from matplotlib import axes, ticker
from numpy.typing import NDArray

from lagcli.output.figures.chart import LARGEST


@dataclasses.dataclass(frozen=True, slots=True)
class Scale:
    """The range of an axis with its ticks and their texts."""

    limits: tuple[float, float]
    values: tuple[float, ...]
    texts: tuple[str, ...]


def value_scale(curves: Iterable[NDArray[np.float64]], floor: float, most: int) -> Scale:
    """The scale of the values of curves, not so fine that round-off about a constant looks like a motion.

    floor: what is not larger is drawn as zero.
    """
    finite = [curve[np.isfinite(curve)] for curve in curves]
    values = np.concatenate([*finite, np.zeros(0)])
    low, high = (float(values.min()), float(values.max())) if values.size else (0.0, 0.0)
    largest = max(abs(low), abs(high))
    if largest <= max(floor, 1e-280):
        return Scale((-1.0, 1.0), (0.0,), ("0",))
    half = 1.08 * max(high / 2 - low / 2, 5e-4 * largest)
    middle = high / 2 + low / 2
    return scale_of(middle - half, middle + half, most)


def scale_of(low: float, high: float, most: int) -> Scale:
    """A scale with about ``most`` ticks, each told apart from the next by its text."""
    low, high = max(low, -LARGEST), min(high, LARGEST)
    found = ticker.MaxNLocator(nbins=most, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high)
    step = float(found[1] - found[0])
    values = [0.0 if abs(value) < 1e-9 * step else float(value) for value in found if low <= value <= high]
    values = values or [low, high]  # the ends of all doubles have no round numbers between
    digits = max(6, int(np.log10(max(abs(low), abs(high)) / step)) + 3)
    texts = [f"{value:.{digits}g}" for value in values]
    if not any("e" in text for text in texts):
        decimals = max(len(text.partition(".")[2]) for text in texts)
        texts = [f"{value:.{decimals}f}" for value in values]
    texts = [number_text(text) for text in texts]
    return Scale((low, high), tuple(values), tuple(texts))


def number_text(text: str) -> str:
    """A number as text with a minus sign and a short exponent."""
    mantissa, _, exponent = text.partition("e")
    power = f"e{int(exponent)}" if exponent else ""
    return (mantissa + power).replace("-", "−")


def ticks(plot: axes.Axes, times: Scale, scale: Scale, size: float, *, times_named: bool) -> None:
    """Put two scales on axes, and a line at zero."""
    plot.set_xlim(*times.limits)
    plot.set_ylim(*scale.limits)
    plot.set_xticks(times.values, times.texts if times_named else [""] * len(times.values), fontsize=size)
    plot.set_yticks(scale.values, scale.texts, fontsize=size)
    if scale.limits[0] < 0 < scale.limits[1]:
        plot.axhline(0, color="#cccccc", linewidth=0.6, zorder=0)
