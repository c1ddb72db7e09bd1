"""The start of a group of rows to 50 digits, from the decimals and expressions of the file; where it was moved onto its
holonomic rows, or lies on them to the digits it was written with, the point of them nearest to what is written."""

from __future__ import annotations

import dataclasses
import decimal
from collections.abc import Mapping
from fractions import Fraction
from functools import cached_property

from lagcli import doubles
from lagcli.analysis.classification.case import Case, CoupledGroup
from lagcli.linear import independent_rows
from lagcli.linear.metric import Metric
from lagcli.linear.metric_rows import LocalRows, MetricRows
from lagcli.pfaffian import special_points, translate
from lagcli.pfaffian.exact import enclosure
from lagcli.pfaffian.forms import notation
from lagcli.pfaffian.forms.form import PfaffianBlock
from lagcli.pfaffian.special_points import Expression, Symbol
from lagcli.start import initial
from lagcli.start.initial import State

Digits = dict[Symbol, Fraction]

# What is written, evaluated in doubles, differs from it by some roundings.
ROUNDING = 4 * doubles.EPS


class ExactStart:
    """The consistent start of a case, for the coordinates of one group; block: that group as it is declared."""

    def __init__(
        self, case: Case, group: CoupledGroup, block: PfaffianBlock, translation: translate.Translation
    ) -> None:
        self._case, self._group, self._block, self._translation = case, group, block, translation
        self._names = case.system.model.coordinate_names
        self._numbers = {name: k for k, name in enumerate(self._names)}
        self._declared = initial.declared(case.system)

    @cached_property
    def point(self) -> special_points.SpecialPoint:
        """The start; without digits where its rows have none, as at a singular point of theirs."""
        begin, size = self._case.begin, initial.size(self._case.begin.q)
        constants = {**self._translation.values, notation.TIME: notation.exact(begin.t)}
        known = {x: enclosure.fraction(value) for x, value in constants.items()}
        moving = [x for x in self._block.variables if x != notation.TIME]
        origin = {}
        for x in moving:  # what was written, or where that was changed the decimal of its double
            value, double = self._translation.written(x), float(self._declared.q[self._numbers[x.name]])
            number = float(value) if value is not None and value.is_comparable else None
            if number is None or abs(number - double) > ROUNDING * max(1.0, abs(number)):
                value = notation.exact(double)
            origin[x] = enclosure.fraction(value)
        here = dict(origin)
        for x in moving:
            k = self._numbers[x.name]
            if abs(begin.q[k] - self._declared.q[k]) > doubles.ZERO * size:
                here[x] = Fraction(repr(float(begin.q[k])))
        there = dataclasses.replace(self.doubles(begin), digits={**known, **here})
        if all(special_points.is_nothing(f, [there]) for f in self._block.surface):
            return there
        on = self._on_surface(here, origin, constants)
        if on is None:
            return self.doubles(begin)
        sizes = {x: size for x, value in on.items() if value != origin[x]}
        return dataclasses.replace(there, digits={**known, **here, **on}, sizes=sizes)

    def doubles(self, state: State) -> special_points.SpecialPoint:
        """A state in symbols, in doubles alone."""
        return special_points.point(self._names, state.q, state.t, self._translation.numbers)

    def reached(self, state: State) -> special_points.SpecialPoint:
        """A state that motions were followed to: its coordinates are off by a part of the size of the start."""
        size = initial.size(self._case.begin.q)
        moving = (x for x in self._block.variables if x != notation.TIME)
        return dataclasses.replace(self.doubles(state), sizes=dict.fromkeys(moving, size))

    def decimal(self, expression: Expression) -> decimal.Decimal:
        """The value at the start in fifty digits, 0 where these leave nothing. Raises `enclosure.NoValueError`."""
        if self.point.digits is None:
            raise enclosure.NoValueError
        is_nothing = expression == 0 or special_points.is_nothing(expression, [self.point])
        return decimal.Decimal(0) if is_nothing else enclosure.decimal_of(expression, self.point.digits)

    def _on_surface(
        self, here: Digits, origin: Digits, constants: Mapping[Symbol, Expression]
    ) -> Digits | None:
        """The coordinates of the surface at its point nearest to the declared start."""
        numeric, begin = self._case.numeric, self._case.begin
        B = numeric.holonomic(begin.t, begin.q, begin.p)[1][list(self._group.holonomic), :]
        follow = independent_rows.redundant(MetricRows(B, Metric.unit(begin.q.size)))
        surface = [
            f.xreplace(constants)
            for f, is_redundant in zip(self._block.surface, follow, strict=True)
            if not is_redundant
        ]
        if not surface:
            return None
        touched = set().union(*(f.free_symbols for f in surface))
        moving = [x for x in here if x in touched]
        # The inertia of these at the declared start, and of those that it couples to them, which follow; of a model
        # without it unit masses.
        start = self._declared
        M = self._case.numeric.inertia(start.t, start.q, start.v, start.p)
        coupled = LocalRows(M)
        among = [self._numbers[x.name] for x in moving]
        for k in among:  # it grows
            others = coupled.column[(coupled.row == k) & (coupled.values != 0)].tolist()
            among += [i for i in others if i not in among]
        inertia = [[Fraction(repr(float(M[i, k]))) for k in among] for i in among]
        if not all(inertia[i][i] for i in range(len(among))):
            inertia = [[Fraction(int(i == k)) for k in among] for i in among]
        begun, written = {x: here[x] for x in moving}, {x: origin[x] for x in moving}
        found = enclosure.nearest(begun, written, surface, inertia)
        return None if found is None else dict(found)
