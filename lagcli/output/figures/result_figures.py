"""Figures of results on one page each: an audit, modes, a stiff limit, two motions side by side."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib import axes, axis, figure, ticker

from lagcli.arrays import Complex, Floats
from lagcli.output.figures import figure_page, labels
from lagcli.output.figures.figure_page import BLUE, GREEN, GREY, RED

if TYPE_CHECKING:
    from lagcli.auditing.checks.audit_report import Audit
    from lagcli.linearization.linear_modes import Modes


STRIP, PANEL = 0.62, 1.75  # inches of one check, and of a row of panels
FLOOR = 1e-9  # what is below that part of its limit is drawn there
MOST_PANELS, COLUMNS = 12, 3  # modes of one page, and in one line of it
MOST_BARS = 12  # coordinates of a mode: more are drawn as a line
MOST_COLUMNS = 4  # of two motions that are drawn


def audit(found: Audit, unit: str = "s") -> figure.Figure:
    """An audit: one strip for each check over time, as a part of its limit, on a logarithmic scale."""
    checks = [check for check in found.checks if check.entries and (check.law or check.verdict == "fail")]
    with figure_page.style():
        verdict = found.conclusion.partition(".")[0].partition(":")[0].partition(",")[0]
        title = f"Audit of {labels.shortened(found.title or found.path, labels.NAME)}: {verdict}"
        drawn = figure_page.sheet(title, 1.1 + STRIP * len(checks))
        strips = drawn.subplots(len(checks), 1, sharex=True, squeeze=False)[:, 0]
        for strip, check in zip(strips, checks, strict=True):
            colour = {"fail": RED, "pass": BLUE}.get(check.verdict, GREY)
            strip.set_yscale("log")
            strip.axhline(1.0, color=GREY, linewidth=0.8, linestyle=(0, (4, 3)))
            if check.curve:
                t, part = np.array(check.curve).T
                # Not a number: a gap between the stretches of a check that looks at windows.
                part = np.clip(np.where(np.isposinf(part), 1e12, part), FLOOR, 1e12)
                marker = "o" if len(t) == 1 else None
                strip.plot(t, part, color=colour, linewidth=0.9, marker=marker, markersize=3)
            highest = max(30.0, *(3 * part for _, part in check.curve if np.isfinite(part)), 30.0)
            strip.set_ylim(FLOOR / 3, highest)
            strip.set_yticks([1e-8, 1e-4, 1.0], ["1e−8", "1e−4", "1"])
            strip.tick_params(labelsize=6)
            label = check.name if check.verdict == "pass" else f"{check.name}\n({check.verdict})"
            strip.set_ylabel(label, fontsize=7, rotation=0, ha="right", va="center", color=colour, labelpad=8)
            strip.set_xlim(found.start, found.end if found.end > found.start else found.start + 1)
        strips[-1].set_xlabel(
            f"t ({labels.shortened(unit, labels.UNIT)})     (each curve: worst value as a part of its limit, dashed)",
            fontsize=8,
        )
        return drawn


def modes(found: Modes, title: str) -> figure.Figure:
    """Modes: each shape over the coordinates, or of particles over the particles."""
    # The shapes that are drawn: of two that are conjugate one, zeros last where not all find room
    frequencies = found.frequencies
    if frequencies is not None:
        every = list(range(min(len(found.shapes), len(frequencies))))
        every.sort(key=lambda k: frequencies[k] == 0)
    else:
        every = [k for k, z in enumerate(found.eigenvalues[: len(found.shapes)]) if z.imag >= 0]
        every.sort(key=lambda k: found.eigenvalues[k] == 0)
    shown = sorted(every[:MOST_PANELS])
    rows = max(1, -(-len(shown) // COLUMNS))
    about = {"equilibrium": "an equilibrium", "steady": "a steady motion", "periodic": "a periodic motion"}
    verdict = {True: "stable", False: "unstable", None: "stability not decided"}[found.stable]
    unit = labels.shortened(found.units.time, labels.UNIT) if found.units else "s"
    are_particles = all(name[-2:] in (".x", ".y", ".z") for name in found.coordinates)
    with figure_page.style():
        name = labels.shortened(title, labels.NAME)
        drawn = figure_page.sheet(f"{name}: modes about {about[found.about]}, {verdict}", 0.9 + PANEL * rows)
        plots = drawn.subplots(rows, COLUMNS, squeeze=False, sharey=True)
        for plot, k in zip(plots.flat, shown, strict=False):
            if frequencies is not None:
                heading = f"ω = {frequencies[k]:.6g}/{unit}"
            else:
                z = found.eigenvalues[k]
                value = f"s = {z.real:.5g} ± {z.imag:.5g}i" if z.imag else f"s = {z.real:.6g}"
                heading = f"{value} (1/{unit})".replace("-", "−")
            plot.set_title(heading, fontsize=8)
            plot.set_ylim(-1.2, 1.6)
            plot.set_yticks([-1, 0, 1])
            plot.axhline(0.0, color=GREY, linewidth=0.6, zorder=0)
            plot.tick_params(labelsize=7)
            (_particles if are_particles else _bars)(plot, found.coordinates, found.shapes[k])
        for plot in list(plots.flat)[len(shown) :]:
            plot.set_visible(False)
        return drawn


def _particles(plot: axes.Axes, coordinates: Sequence[str], shape: Complex) -> None:
    """x, y and z over the particles, with a mark at each where they are few; imaginary parts dashed."""
    names = [name[:-2] for name in coordinates[::3]]
    numbers = np.arange(1, len(names) + 1)
    mark = "o" if len(names) <= 40 else None
    for number, (letter, colour) in enumerate(zip("xyz", (BLUE, RED, GREEN), strict=True)):
        own = shape[number::3]
        for part, style in ((own.real, "-"), (own.imag, (0, (3, 2)))):
            if np.any(part):
                (line,) = plot.plot(numbers, part, color=colour, linestyle=style, label=letter, marker=mark)
                line.set(markersize=2.5, linewidth=1.2)
    if len(names) <= MOST_BARS:
        plot.set_xticks(numbers, [labels.shortened(name, 10) for name in names], fontsize=6)
    plot.set_xlim(0.5, len(names) + 0.5)
    plot.legend(fontsize=6, frameon=False, loc="upper right", handlelength=1.2, borderpad=0.1)


def _bars(plot: axes.Axes, coordinates: Sequence[str], shape: Complex) -> None:
    """A bar for each coordinate, beside it a lighter one of the imaginary part."""
    numbers = np.arange(1, shape.size + 1)
    has_both = bool(np.any(shape.imag))
    if shape.size > MOST_BARS:
        plot.plot(numbers, shape.real, color=BLUE, linewidth=1.2)
        if has_both:
            plot.plot(numbers, shape.imag, color=RED, linewidth=1.2, linestyle=(0, (3, 2)))
        return
    width = 0.38 if has_both else 0.6
    plot.bar(numbers - (width / 2 if has_both else 0.0), shape.real, width, color=BLUE)
    if has_both:
        plot.bar(numbers + width / 2, shape.imag, width, color="#8FC1E3")
    plot.set_xticks(numbers, [labels.shortened(name, 10) for name in coordinates], fontsize=7)
    plot.set_xlim(0.4, shape.size + 0.6)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class LimitCurves:
    """The curves of the figure of a limit.

    t (T,) and multiplier (T,): of the constrained run; forces: -k f (T,) by stiffnesses, softest first; spans (K, 3):
    k, with the least and the largest -k f; errors (K, 2): k and the error; line (K,): the fitted errors; rate: the fit
    in words.
    """

    constraint: str
    t: Floats
    multiplier: Floats
    forces: Sequence[tuple[str, Floats]]
    spans: Floats
    errors: Floats
    line: Floats | None
    rate: str
    error_name: str


def limit(curves: LimitCurves, title: str, unit: str = "s") -> figure.Figure:
    """A stiff limit: the force over time, the force against stiffness, the error against 1/k. ``unit``: of time."""
    with figure_page.style():
        drawn = figure_page.sheet(labels.shortened(title, labels.TITLE), 4.9)
        panels = drawn.subplot_mosaic([["time", "time"], ["stiffness", "errors"]])
        for panel in drawn.axes:
            panel.tick_params(labelsize=7)

        panel = panels["time"]
        for (name, force), colour in zip(curves.forces, (GREEN, RED), strict=False):
            panel.plot(curves.t, force, color=colour, linewidth=0.7, label=name)
        name = f"λ of {labels.shortened(curves.constraint, labels.NAME)}"
        panel.plot(curves.t, curves.multiplier, color=BLUE, linewidth=1.3, linestyle=(0, (5, 2)), label=name)
        panel.set_title("force of the row", fontsize=8, loc="left")
        panel.set_xlabel(_time(unit), fontsize=8)
        panel.legend(fontsize=7, frameon=False, ncol=3, loc="lower right", bbox_to_anchor=(1.0, 0.98))
        panel.margins(x=0.01)

        panel = panels["stiffness"]
        panel.set_xscale("log")
        _plain(panel.xaxis)
        k, low, high = curves.spans.T
        panel.vlines(k, low, high, color=RED, linewidth=2.2)
        for value in (curves.multiplier.min(), curves.multiplier.max()):
            panel.axhline(value, color=BLUE, linewidth=0.9, linestyle=(0, (5, 2)))
        panel.set_title("least and largest force, and those of λ (dashed)", fontsize=8, loc="left")
        panel.set_xlabel("stiffness k", fontsize=8)
        panel.margins(x=0.08, y=0.12)

        panel = panels["errors"]
        panel.set_title(f"{curves.error_name} against 1/k{curves.rate}", fontsize=8, loc="left")
        panel.set_xlabel("1/k", fontsize=8)
        found = curves.errors[(curves.errors > 0).all(axis=1)]
        if not len(found):
            words = "no error above rounding"
            panel.text(0.5, 0.5, words, ha="center", fontsize=8, transform=panel.transAxes)
            return drawn
        panel.set_xscale("log")
        panel.set_yscale("log")
        _plain(panel.xaxis)
        _plain(panel.yaxis)
        if curves.line is not None:
            panel.plot(1 / curves.errors[:, 0], curves.line, color=GREY, linewidth=1.0)
        panel.plot(1 / found[:, 0], found[:, 1], "o", color=RED, markersize=4)
        panel.margins(0.1)
        return drawn


def _plain(scale: axis.Axis) -> None:
    """Powers of ten as they are typed: texts of this project are never read as markup."""
    scale.set_major_locator(ticker.LogLocator(numticks=6))
    scale.set_major_formatter(ticker.FuncFormatter(lambda value, _: f"{value:.0e}".replace("-", "−")))
    scale.set_minor_formatter(ticker.NullFormatter())


def _time(unit: str) -> str:
    return f"t ({unit})" if unit not in ("", "1") else "t"


def motions(
    tables: Mapping[str, Mapping[str, Floats]], shown: Sequence[str], title: str, unit: str = "s"
) -> figure.Figure:
    """Two motions side by side, by their names and columns (T,): the columns ``shown``, of which the first
    ``MOST_COLUMNS`` are drawn, over time, and the columns ``mu.*`` of the second. ``unit``: the label of time."""
    names, (_, second) = list(shown)[:MOST_COLUMNS], tables.values()
    mu = [name for name in second if name.startswith("mu.")]
    count = len(names) + bool(mu)
    lines = -(-count // 2)
    with figure_page.style():
        drawn = figure_page.sheet(labels.shortened(title, labels.TITLE), 0.95 + PANEL * lines)
        panels = drawn.subplots(lines, 2 if count > 1 else 1, sharex=True, squeeze=False).ravel()
        for panel, name in zip(panels, names, strict=False):
            for (label, table), colour, dash in zip(
                tables.items(), (BLUE, RED), ("-", (0, (5, 2))), strict=True
            ):
                panel.plot(table["t"], table[name], color=colour, linestyle=dash, linewidth=1.2, label=label)
            panel.set_title(labels.shortened(name, labels.NAME), fontsize=8, loc="left")
        handles = panels[0].get_legend_handles_labels()
        drawn.legend(*handles, loc="outside lower center", ncol=2, fontsize=8, frameon=False)
        if mu:
            panel = panels[len(names)]
            short = [labels.shortened(name.removeprefix("mu."), labels.NAME) for name in mu]
            colours = figure_page.COLOURS[2:]
            for name, label, colour in zip(mu, short, itertools.cycle(colours), strict=False):
                panel.plot(second["t"], second[name], color=colour, linewidth=1.0, label=label)
            panel.set_title("μ of the rows" if len(mu) > 1 else f"μ of {short[0]}", fontsize=8, loc="left")
            if 1 < len(mu) <= len(colours):
                panel.legend(fontsize=7, frameon=False)
        for panel in panels[:count]:
            panel.tick_params(labelsize=7)
            panel.margins(x=0.01)
        for panel in panels[count:]:
            panel.set_visible(False)
        for panel in panels[max(0, count - 2) : count]:
            panel.set_xlabel(_time(unit), fontsize=8)
            panel.tick_params(labelbottom=True)
        return drawn
