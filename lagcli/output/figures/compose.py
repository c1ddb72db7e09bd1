"""Columns of tables to a chart: which panels there are, which curves are in them, and the notes about them."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterable, Iterator, Sequence
from pathlib import PurePath

import numpy as np

from lagcli import doubles
from lagcli.errors import diagnostics
from lagcli.output.figures import chart as chart_data
from lagcli.output.figures import chart_table, labels, panels
from lagcli.output.figures.chart import MOST_KEYS, ChartCurve, ChartData, ChartPanel, LegendKey, Span
from lagcli.output.figures.chart_table import ChartTable
from lagcli.output.figures.labels import COMPARABLE, OPEN, ColumnTexts
from lagcli.output.tables import table_format

MOST_PANELS = 24  # on one page, an inch each
# Columns that share axes only while their values are of like size: their units may differ.
MOST_APART = 8
MOST_DASHED = 6  # dashes that differ, and columns and runs that one panel holds together
# Below it, in whatever unit, forces may be rounding: where no model tells, that is said.
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
    """The chart of columns of tables, which are overlaid. Raises `UndrawableColumns`, and what the tables raise."""
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
        # The column of the axis; None for the number of the row
        self.x = choice.x
        if self.x is None and all("t" in table.columns for table in tables):
            self.x = "t"
        for table in tables:
            if choice.x is not None and choice.x not in table.columns:
                hint = _hint(choice.x, table.columns)
                raise UndrawableColumns(f"--x: {table.name} has no column `{choice.x}`{hint}")

    def _words_for(self, name: str) -> ColumnTexts:
        """The words of the first table that has a column."""
        pairs = zip(self._words, self._tables, strict=True)
        return next(words for words, table in pairs if name in table.columns)

    def over_axis(self) -> Iterator[ChartPanel]:
        """The panels of columns over the axis, in their order: those of one kind and unit are together."""
        chosen: list[list[str]] = []
        for patterns in self._choice.y:
            try:
                indices = table_format.select(self._columns, patterns)
            except table_format.UnknownColumn as error:
                raise UndrawableColumns(f"--y: {error}") from None
            chosen.append([self._columns[index] for index in indices])
        if not chosen and not self._choice.xy:
            rest = [name for name in self._columns if name != self.x]
            chosen.append([name for name in rest if name.startswith("lambda.")] or rest)
        wanted = list(dict.fromkeys(itertools.chain(*chosen)))
        if chosen and not wanted:
            raise UndrawableColumns("there is no column to draw")
        series = chart_table.over(self._tables, self.x, wanted, self._choice.is_log)
        ends = series.ends or [(0.0, 0.0)]
        limits = min(low for low, _ in ends), max(high for _, high in ends)
        words, runs = self._words[0], len(self._tables)
        for columns in chosen:
            groups: dict[tuple[str, str], list[str]] = {}
            for name in columns:
                own = self._words_for(name)
                groups.setdefault((own.kind(name), own.unit(name)), []).append(name)
            for names in groups.values():
                # Columns share axes, but where sizes or runs are too many to be told apart.
                kind = words.kind(names[0])
                is_open = kind in OPEN or (kind == "multiplier" and "unit of" in words.unit(names[0]))
                sizes = [size for size in map(series.largest, names) if size > 0]
                is_apart = is_open and len(names) <= MOST_APART and not panels.are_of_like_size(sizes)
                is_crowded = runs > 1 and len(names) > 1 and max(runs, len(names)) > MOST_DASHED
                is_alone = (is_apart and not self._choice.is_log) or is_crowded
                for part in [[name] for name in names] if is_alone else [names]:
                    yield self._panel(part, series, limits if series.is_time else None)

    def _panel(self, names: list[str], series: chart_table.SeriesSet, limits: Span | None) -> ChartPanel:
        words, is_log, runs = self._words_for(names[0]), self._choice.is_log, len(self._tables)
        kind = words.kind(names[0])
        floor = doubles.VALUE * max(map(series.largest, names)) if kind in COMPARABLE else 0.0
        rounded: set[str] = set()  # zero to rounding in a table, but not exactly zero
        curves = []
        for run, table in enumerate(self._tables):
            for index, name in enumerate(names):
                one = series.curves[run].get(name)
                if one is None:
                    continue
                y = one.y
                if not is_log and one.largest > 0 and (name in table.facts.zeros or one.largest <= floor):
                    rounded.add(name)
                    y = np.where(np.isnan(y), np.nan, 0.0)
                # Colours tell columns apart, dashes runs where there are several.
                look = (index, run) if runs > 1 and len(names) > 1 else (index if runs == 1 else run,) * 2
                curves.append(ChartCurve(name if runs == 1 else self._names[run], one.x, y, *look))
        is_family = len(curves) > MOST_KEYS and (runs == 1 or len(names) == 1)
        keys: tuple[LegendKey, ...] = ()
        if not is_family and (len(curves) > 1 or runs > 1):
            keys = _keys(curves)
            if runs > 1 and len(names) > 1:
                of_columns = [LegendKey(name, index, 0) for index, name in enumerate(names)]
                keys = (*of_columns, *(LegendKey(name, None, run) for run, name in enumerate(self._names)))
        label = words.axis(names)
        return ChartPanel(
            "time" if series.is_time else "plane",
            words.axis([self.x]) if self.x is not None else "row",
            " ".join(filter(None, ("size of", label))) if is_log else label or diagnostics.first_of(names),
            tuple(curves),
            keys,
            is_family=is_family,
            is_log=is_log,
            limits=limits,
            dots=() if series.is_time else self._dots((self.x or "", names[0])),
            notes=tuple(self._notes(names, kind, series, rounded)),
        ).drawable()

    def _notes(
        self, names: Sequence[str], kind: str, series: chart_table.SeriesSet, rounded: set[str]
    ) -> Iterator[str]:
        every, is_log = {name: found for name in names if (found := series.of(name))}, self._choice.is_log
        told = {"zero to rounding: ": [name for name in names if name in rounded]}
        if is_log:  # what a logarithmic scale cannot show
            zeros = {name: sum(one.zeros for one in found) for name, found in every.items()}
            rows = {name: sum(one.rows for one in found) for name, found in every.items()}
            told["sizes are drawn; negative values occur in "] = [
                name for name, found in every.items() if any(one.has_negatives for one in found)
            ]
            told["exactly zero throughout, not drawn: "] = [n for n in every if zeros[n] == rows[n]]
            told["gaps where values are exactly zero: "] = [
                f"{name} ({zeros[name]} of {rows[name]})" for name in every if 0 < zeros[name] < rows[name]
            ]
        else:
            told["zero throughout: "] = [
                n for n, found in every.items() if not any(one.largest for one in found)
            ]
        yield from (text + diagnostics.first_of(found) for text, found in told.items() if found)
        largest = max(map(series.largest, names))
        if 0 < largest < SUSPECT:
            small = f"no value is larger than {largest:.1e}: these may be zero to rounding"
            judged = all(table.facts.is_judged for table in self._tables)
            if not judged and kind in ("multiplier", "constraint force") and not rounded:
                yield f"{small}, which a plot of the model decides"
            # Outputs have any unit, and no run knows the sums they come from; of tables of others nothing is presumed.
            has_units = all(table.facts.units is not None for table in self._tables)
            if has_units and kind == "other" and not is_log:
                yield small
        for name in names:
            lacking = [t.name for t in self._tables if name not in t.columns]
            if lacking:
                yield f"no column {name} in {diagnostics.first_of(lacking)}"

    def pairs(self) -> Iterator[ChartPanel]:
        """The panels of --xy; pairs of the same components share axes."""
        found: dict[tuple[str, str], list[tuple[str, str]]] = {}
        for text in self._choice.xy:
            names = [part.strip() for part in text.split(",")]
            if len(names) != 2:
                raise UndrawableColumns(f"--xy {text}: write two columns, such as a.x,a.z")
            for name in names:
                if name not in self._columns:
                    raise UndrawableColumns(f"--xy: there is no column `{name}`{_hint(name, self._columns)}")
            x, y = names
            members = (x.rpartition(".")[2], y.rpartition(".")[2])
            found.setdefault(members if "." in x and "." in y else (x, y), []).append((x, y))
        for pairs in found.values():
            if len(self._tables) * len(pairs) > MOST_KEYS * 3:
                raise UndrawableColumns(
                    f"{len(self._tables) * len(pairs)} curves on one pair of axes cannot be told apart"
                )
            curves: list[ChartCurve] = []
            for run, table in enumerate(self._tables):
                for index, pair in enumerate(pairs):
                    if not set(pair) <= set(table.columns):
                        continue
                    # `a` of a.x and a.z; `a.x, b.z` of columns of different particles
                    stems = {name.rpartition(".")[0] for name in pair}
                    label = stems.pop() if len(stems) == 1 and "" not in stems else ", ".join(pair)
                    if self._names[run]:
                        label = self._names[run] if len(pairs) == 1 else f"{label}, {self._names[run]}"
                    number = run * len(pairs) + index
                    curves.append(ChartCurve(label, *chart_table.path(table, pair), number, number))
            words = self._words[0]
            x_label, y_label = (
                words.axis(names[:1])
                if len(set(names)) == 1
                else labels.with_unit(names[0].rpartition(".")[2], words.unit(names[0]))
                for names in zip(*pairs, strict=True)
            )
            keys = _keys(curves) if len(curves) > 1 else ()
            dots = tuple(dot for pair in pairs for dot in self._dots(pair))
            yield ChartPanel("equal", x_label, y_label, tuple(curves), keys, dots=dots).drawable()

    def _dots(self, pair: tuple[str, str]) -> tuple[chart_data.IncidentDots, ...]:
        """The points of incidents on a path."""
        (table, *others) = self._tables
        if others or not table.incidents or not {"t", *pair} <= set(table.columns):
            return ()
        t, x, y = table.take(["t", *pair]).T
        if not len(t):
            return ()
        marks = chart_data.incident_marks(table.incidents, (float(t[0]), float(t[-1])))
        return tuple(
            chart_data.IncidentDots(mark.number, np.interp(mark.times, t, x), np.interp(mark.times, t, y))
            for mark in marks
        )


def _keys(curves: Sequence[ChartCurve]) -> tuple[LegendKey, ...]:
    return tuple(LegendKey(c.label, c.colour, c.dash) for c in curves)


def _hint(word: str, known: Iterable[str]) -> str:
    hint = diagnostics.nearest(word, known)
    return f"; {hint}" if hint else ""
