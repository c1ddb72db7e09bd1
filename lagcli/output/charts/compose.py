"""Columns of tables to a chart: which panels there are, which curves are in them, and the notes about them."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterable, Iterator, Sequence
from pathlib import PurePath

import numpy as np
from numpy.typing import NDArray

from lagcli import doubles
from lagcli.errors import diagnostics
from lagcli.output.charts import chart_table
from lagcli.output.charts.chart_table import ChartTable, Series
from lagcli.output.figures import labels, panels
from lagcli.output.figures.chart import (
    MOST_KEYS,
    ChartCurve,
    ChartData,
    ChartPanel,
    IncidentDots,
    LegendKey,
    incident_marks,
)
from lagcli.output.figures.labels import COMPARABLE, OPEN, ColumnTexts
from lagcli.output.tables import table_format

Floats = NDArray[np.float64]

MOST_PANELS = 24  # on one page, an inch each
# Columns that share axes only while their values are of like size: their units may differ.
MOST_APART = 8
MOST_LISTED = 6  # names in a note
# Below it, in whatever unit, forces may be rounding: where no model tells, that is said.
# `tests/unit/test_drawing_thresholds.py::test_forces_that_may_be_rounding_are_noted` fails at 1e-12 and 1e-14.
SUSPECT = 1e-13


class UndrawableColumns(ValueError):
    """The tables have no such columns, or too many for one chart."""


@dataclasses.dataclass(frozen=True, slots=True)
class ChartChoice:
    """The columns of a chart.

    y: patterns separated by commas, each entry for axes of its own; x: the column of the other axis, None for `t`; xy:
    pairs `a.x,a.z` for axes with one scale; is_log: sizes on a logarithmic scale; title: None for that of the model.
    """

    y: tuple[str, ...] = ()
    x: str | None = None
    xy: tuple[str, ...] = ()
    is_log: bool = False
    title: str | None = None


def chosen(
    y: str | Sequence[str] = (),
    *,
    x: str | None = None,
    xy: str | Sequence[str] = (),
    is_log: bool = False,
    title: str | None = None,
) -> ChartChoice:
    """The choice of a caller, who may give one text where there are several."""
    groups, pairs = ((one,) if isinstance(one, str) else tuple(one) for one in (y, xy))
    return ChartChoice(tuple(filter(None, groups)), x, tuple(filter(None, pairs)), is_log, title)


def chart(tables: Sequence[ChartTable], choice: ChartChoice) -> ChartData:
    """The chart of some columns of tables, which are overlaid.

    Raises `UndrawableColumns`, and what the tables raise.
    """
    if choice.is_log and choice.xy:
        raise UndrawableColumns("--log is for columns over an axis; --xy has one scale for both directions")
    plan = _Plan(tables, choice)
    drawn = (*plan.over_axis(), *plan.pairs())
    if len(drawn) > MOST_PANELS:
        raise UndrawableColumns(
            f"these columns need {len(drawn)} panels, and {MOST_PANELS} are readable: name fewer"
        )
    incidents = tables[0].incidents
    is_common = plan.x == "t" and all(table.incidents is incidents for table in tables)
    titles = {choice.title}
    if choice.title is None:
        titles = {table.facts.title or PurePath(table.name).name for table in tables}
    title = titles.pop() if len(titles) == 1 else ""
    return ChartData(title or "", drawn, incidents if is_common else ())


class _Plan:
    """The panels of a chart, made as their columns are read."""

    def __init__(self, tables: Sequence[ChartTable], choice: ChartChoice) -> None:
        self._tables, self._choice = tables, choice
        self._columns = list(dict.fromkeys(name for table in tables for name in table.columns))
        self._words = [ColumnTexts(table.columns, table.facts) for table in tables]
        self._names = labels.distinguishing(
            [table.name for table in tables], [table.origin for table in tables]
        )
        self.x = self._axis()

    def _axis(self) -> str | None:
        """The column of the axis; None for the number of the row."""
        wanted = self._choice.x
        if wanted is None:
            return "t" if all("t" in table.columns for table in self._tables) else None
        for table in self._tables:
            if wanted not in table.columns:
                hint = diagnostics.nearest(wanted, table.columns)
                raise UndrawableColumns(
                    f"--x: {table.name} has no column `{wanted}`" + (f"; {hint}" if hint else "")
                )
        return wanted

    def _selected(self, patterns: str) -> list[str]:
        try:
            indices = table_format.select(self._columns, patterns)
        except table_format.UnknownColumn as error:
            raise UndrawableColumns(f"--y: {error}") from None
        return [self._columns[index] for index in indices]

    def _groups(self) -> list[list[str]]:
        """The columns of the panels over the axis, in their order."""
        if self._choice.y:
            chosen = [self._selected(patterns) for patterns in self._choice.y]
        elif self._choice.xy:
            return []
        else:
            rest = [name for name in self._columns if name != self.x]
            chosen = [[name for name in rest if name.startswith("lambda.")] or rest]
        if not any(chosen):
            raise UndrawableColumns("there is no column to draw")
        return [group for names in chosen for group in self._of_one_kind(names)]

    def _of_one_kind(self, names: Sequence[str]) -> Iterable[list[str]]:
        """Columns of one kind and unit."""
        groups: dict[tuple[str, str], list[str]] = {}
        for name in names:
            words = self._words_for(name)
            groups.setdefault((words.kind(name), words.unit(name)), []).append(name)
        return groups.values()

    def _words_for(self, name: str) -> ColumnTexts:
        """The words of the first table that has a column."""
        pairs = zip(self._words, self._tables, strict=True)
        return next(words for words, table in pairs if name in table.columns)

    def over_axis(self) -> Iterator[ChartPanel]:
        """The panels of columns over the axis."""
        groups = self._groups()
        wanted = list(dict.fromkeys(itertools.chain(*groups)))
        if not wanted:
            return
        series = chart_table.over(self._tables, self.x, wanted, self._choice.is_log)
        spans = [table.span for table in series.tables if table.span is not None]
        limits = (min(low for low, _ in spans), max(high for _, high in spans)) if spans else (0.0, 0.0)
        for names in groups:
            for part in self._parts(names, series):
                yield self._panel(part, series, limits if series.is_time else None)

    def _parts(self, names: list[str], series: chart_table.SeriesSet) -> list[list[str]]:
        """Columns that share axes: all, or each alone where sizes or runs are too many to be told apart."""
        words = self._words[0]
        kind = words.kind(names[0])
        is_open = kind in OPEN or (kind == "multiplier" and "unit of" in words.unit(names[0]))
        runs = len(self._tables)
        sizes = [size for size in map(series.largest, names) if size > 0]
        is_apart = is_open and len(names) <= MOST_APART and not panels.are_of_like_size(sizes)
        is_crowded = runs > 1 and len(names) > 1 and (runs > len(DASHED) or len(names) > len(DASHED))
        return [[name] for name in names] if (is_apart and not self._choice.is_log) or is_crowded else [names]

    def _panel(
        self, names: list[str], series: chart_table.SeriesSet, limits: tuple[float, float] | None
    ) -> ChartPanel:
        words = self._words_for(names[0])
        zeros = set() if self._choice.is_log else self._zero_columns(names, words.kind(names[0]), series)
        shown = [
            (run, index, curve if (run, name) not in zeros else curve.as_zero())
            for run in range(len(self._tables))
            for index, name in enumerate(names)
            if (curve := series.find(run, name)) is not None
        ]
        is_family = len(shown) > MOST_KEYS and (len(self._tables) == 1 or len(names) == 1)
        label = words.axis(names)
        return ChartPanel(
            "time" if series.is_time else "plane",
            words.axis([self.x]) if self.x is not None else "row",
            " ".join(filter(None, ("size of", label))) if self._choice.is_log else label or _listed(names),
            *self._curves(names, shown, is_family),
            is_family=is_family,
            is_log=self._choice.is_log,
            limits=limits,
            dots=() if series.is_time else self._dots((self.x or "", names[0])),
            notes=tuple(self._notes(names, words.kind(names[0]), series, zeros)),
        ).drawable()

    def _curves(
        self, names: Sequence[str], shown: Sequence[tuple[int, int, Series]], is_family: bool
    ) -> tuple[tuple[ChartCurve, ...], tuple[LegendKey, ...]]:
        """The curves of a panel and its legend: colours tell columns apart, dashes runs where there are several."""
        runs, curves = len(self._tables), []
        for run, index, one in shown:
            one_of_each = runs == 1 or len(names) == 1
            look = (index if runs == 1 else run,) * 2 if one_of_each else (index, run)
            label = names[index] if runs == 1 else self._names[run]
            curves.append(ChartCurve(label, one.x, one.y, *look))
        if is_family or (len(shown) <= 1 and runs == 1):
            return tuple(curves), ()
        if runs == 1 or len(names) == 1:
            return tuple(curves), tuple(LegendKey(c.label, c.colour, c.dash) for c in curves)
        keys = [LegendKey(name, index, 0) for index, name in enumerate(names)]
        return tuple(curves), (*keys, *(LegendKey(name, None, run) for run, name in enumerate(self._names)))

    def _zero_columns(
        self, names: Sequence[str], kind: str, series: chart_table.SeriesSet
    ) -> set[tuple[int, str]]:
        """The columns, with their tables, that are zero to rounding, but not exactly zero."""
        floor = doubles.VALUE * max(map(series.largest, names)) if kind in COMPARABLE else 0.0
        return {
            (run, name)
            for run, table in enumerate(self._tables)
            for name in names
            if (one := series.find(run, name)) is not None
            and one.largest > 0
            and (name in table.facts.zeros or one.largest <= floor)
        }

    def _notes(
        self, names: Sequence[str], kind: str, series: chart_table.SeriesSet, zeros: set[tuple[int, str]]
    ) -> Iterator[str]:
        every = {
            name: [s for run in range(len(self._tables)) if (s := series.find(run, name))] for name in names
        }
        rounded = [name for name in names if any((run, name) in zeros for run in range(len(self._tables)))]
        if rounded:
            yield f"zero to rounding: {_listed(rounded)}"
        nothing = [name for name in names if every[name] and all(one.largest == 0 for one in every[name])]
        if nothing and not self._choice.is_log:
            yield f"zero throughout: {_listed(nothing)}"
        if self._choice.is_log:
            yield from _log_notes({name: found for name, found in every.items() if found})
        largest = max(map(series.largest, names))
        judged = all(table.facts.is_judged for table in self._tables)
        if not judged and kind in ("multiplier", "constraint force") and 0 < largest < SUSPECT and not zeros:
            yield (
                f"no value is larger than {largest:.1e}: these may be zero to rounding, which a plot of the model"
                " decides"
            )
        # Outputs have any unit, and no run knows the sums they come from; of tables of others nothing is presumed.
        has_units = all(table.facts.units is not None for table in self._tables)
        if has_units and kind == "other" and not self._choice.is_log and 0 < largest < SUSPECT:
            yield f"no value is larger than {largest:.1e}: these may be zero to rounding"
        for name in names:
            lacking = [t.name for t in self._tables if name not in t.columns]
            if lacking:
                yield f"no column {name} in {_listed(lacking)}"

    def pairs(self) -> Iterator[ChartPanel]:
        """The panels of --xy; pairs of the same components share axes."""
        found: dict[tuple[str, str], list[tuple[str, str]]] = {}
        for text in self._choice.xy:
            names = self._pair(text)
            members = (names[0].rpartition(".")[2], names[1].rpartition(".")[2])
            found.setdefault(members if "." in names[0] and "." in names[1] else names, []).append(names)
        for pairs in found.values():
            if len(self._tables) * len(pairs) > MOST_KEYS * 3:
                raise UndrawableColumns(
                    f"{len(self._tables) * len(pairs)} curves on one pair of axes cannot be told apart"
                )
            yield self._plane(pairs)

    def _pair(self, text: str) -> tuple[str, str]:
        names = [part.strip() for part in text.split(",")]
        if len(names) != 2:
            raise UndrawableColumns(f"--xy {text}: write two columns, such as a.x,a.z")
        for name in names:
            if not any(name in table.columns for table in self._tables):
                hint = diagnostics.nearest(name, self._columns)
                raise UndrawableColumns(f"--xy: there is no column `{name}`" + (f"; {hint}" if hint else ""))
        return names[0], names[1]

    def _plane(self, pairs: Sequence[tuple[str, str]]) -> ChartPanel:
        curves: list[ChartCurve] = []
        for run, table in enumerate(self._tables):
            for index, pair in enumerate(pairs):
                if set(pair) <= set(table.columns):
                    x, y = chart_table.path(table, pair)
                    label = ", ".join(part for part in (_pair_name(pair), self._names[run]) if part)
                    label = self._names[run] if len(pairs) == 1 and self._names[run] else label
                    number = run * len(pairs) + index
                    curves.append(ChartCurve(label, x, y, number, number))
        words = self._words[0]
        keys = tuple(LegendKey(c.label, c.colour, c.dash) for c in curves) if len(curves) > 1 else ()
        x_label, y_label = (_component(words, [pair[k] for pair in pairs]) for k in (0, 1))
        dots = tuple(dot for pair in pairs for dot in self._dots(pair))
        return ChartPanel("equal", x_label, y_label, tuple(curves), keys, dots=dots).drawable()

    def _dots(self, pair: tuple[str, str]) -> tuple[IncidentDots, ...]:
        """The points of incidents on a path."""
        (table, *others) = self._tables
        if others or not table.incidents or not {"t", *pair} <= set(table.columns):
            return ()
        t, x, y = table.take(["t", *pair]).T
        if not len(t):
            return ()
        marks = incident_marks(table.incidents, (float(t[0]), float(t[-1])))
        return tuple(
            IncidentDots(mark.number, np.interp(mark.times, t, x), np.interp(mark.times, t, y))
            for mark in marks
        )


DASHED = range(6)  # dashes that differ, and columns and runs that one panel holds together


def _log_notes(found: dict[str, list[Series]]) -> Iterator[str]:
    """Remarks on what a logarithmic scale cannot show."""
    negative = [name for name, every in found.items() if any(one.has_negatives for one in every)]
    if negative:
        yield f"sizes are drawn; negative values occur in {_listed(negative)}"
    zeros = {name: sum(one.zeros for one in every) for name, every in found.items()}
    rows = {name: sum(one.rows for one in every) for name, every in found.items()}
    nothing = [name for name in found if zeros[name] == rows[name]]
    if nothing:
        yield f"exactly zero throughout, not drawn: {_listed(nothing)}"
    some = [f"{name} ({zeros[name]} of {rows[name]})" for name in found if 0 < zeros[name] < rows[name]]
    if some:
        yield f"gaps where values are exactly zero: {_listed(some)}"


def _listed(names: Sequence[str]) -> str:
    more = len(names) - MOST_LISTED
    return ", ".join(names[:MOST_LISTED]) + (f" and {more} others" if more > 0 else "")


def _pair_name(pair: tuple[str, str]) -> str:
    """`a` of a.x and a.z; `a.x, b.z` of columns of different particles."""
    stems = {name.rpartition(".")[0] for name in pair}
    return stems.pop() if len(stems) == 1 and "" not in stems else ", ".join(pair)


def _component(words: ColumnTexts, names: Sequence[str]) -> str:
    if len(set(names)) == 1:
        return words.axis(names[:1])
    return labels.with_unit(names[0].rpartition(".")[2], words.unit(names[0]))
