"""The search for the derived flag: at which point, with which brackets, and what they say of the rows (D.3).

Doubles name the rows that seem to depend on rows before them. Along a field of the kernel of the others such a row
vanishes in all digits; along a field on which one of the others is one it shows that other's weight.
"""

from __future__ import annotations

import contextlib
import dataclasses
import decimal
import math
from collections.abc import Sequence
from decimal import Decimal

import numpy as np

from lagcli.analysis.numeric_flag import bracket_values, spans
from lagcli.analysis.numeric_flag.bracket_values import BracketValues, Exact, Growth
from lagcli.analysis.numeric_flag.evaluation_point import EvaluationPoint
from lagcli.analysis.numeric_flag.flag_points import Points
from lagcli.analysis.numeric_flag.spans import Limits, unit
from lagcli.compiled.row_block import RowBlock
from lagcli.equations.system import System
from lagcli.linear import decompositions
from lagcli.start.initial import State

CONDITION = "a combination of the rows says g dt = 0, and the condition g = 0 was not found in closed form"
SIDES_DIFFER = "the start lies, to nine digits, on a kink (abs, sign, min, max), whose sides may differ"
# What a start that was declared in decimals shows where it lies on a special point.
AT_START = Limits(Decimal("1e-11"), Decimal("1e-11"))
# The limits that are tried: numbers as they are written, as doubles, and at last as those of a start that was rounded,
# off the point that it lies on.
ROUNDED = Limits(Decimal("1e-10"), Decimal("1e-6"))
ATTEMPTS: tuple[tuple[bool, Limits | None], ...] = ((True, None), (False, None), (True, ROUNDED))
# Constants of the rows are doubles: what is smaller is their rounding.
WEIGHT_ROUNDOFF = Decimal("1e-13")
# Weights that come from doubles, with all that nearly dependent rows lose, are none or larger than this.
ROUGH_SURE = Decimal("1e-5")
SEED = 20063
NEARLY = "whether rows depend on each other or only nearly do is not certain"


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class NumericFlag:
    """The derived flag of m differential rows on the surface of those they came with.

    dimension: of the kernel D at generic points, over coordinates and, with `has_time`, time. extra: dimensions of I,
    I', ... beyond the df, to zero or to the first that repeats; growth: dim D grows by these, (0, ...). inside (m,):
    which rows lie in I^(oo). contradiction: a multiple of dt lies in the rows. special: ranks or growth at the start
    are not those nearby (None: brackets were too large to look there). states: of the orbit, the start first. on_piece:
    abs, min, max or sign switch in the rows, so that the flag is that of the start's side. digits: the precision of the
    proof; error: the largest value that counted as zero, least: the smallest that did not, both relative to the size of
    their terms. Where not `is_certain`, `reason` says why, and of extra, growth and inside what is not known is empty.
    """

    has_time: bool
    dimension: int | None = None
    extra: tuple[int, ...] = ()
    growth: tuple[int, ...] = ()
    inside: tuple[bool, ...] = ()
    contradiction: bool = False
    special: bool | None = False
    states: tuple[State, ...] = ()
    on_piece: bool = False
    is_certain: bool = False
    reason: str = ""
    digits: int = 16
    error: float = 0.0
    least: float = math.inf


def flag(system: System, begin: State, rows: Sequence[int], deadline: float = math.inf) -> NumericFlag:
    """The flag of the differential ones among `rows`, indices of rows of the system, the others holonomic.

    begin: a start on the surface; the flag is that of the motions from it. deadline: of `progress.after`, at
    which the search is given up.
    """
    block = RowBlock(system, sorted(rows))
    nothing = NumericFlag(block.has_time)
    try:
        with decimal.localcontext(prec=bracket_values.DIGITS):
            return _found(nothing, Points(block, system, begin, deadline), deadline)
    except spans.Undecided as why:
        return dataclasses.replace(nothing, reason=str(why))


def _found(nothing: NumericFlag, points: Points, deadline: float) -> NumericFlag:
    """The flag; `nothing` holds what is known without a search."""
    start, generic = points.start, points.generic()
    if generic.all.value is None or generic.surface.value is None:
        raise spans.Undecided("no gap in the singular values of the constraint rows decides their rank")
    known = dataclasses.replace(
        nothing,
        dimension=generic.dimension,
        contradiction=generic.still.high < generic.all.low,
        special=start.ranks != generic.ranks,
        states=tuple(points.state(point) for point in points.visited),
        is_certain=True,
    )
    if start.surface.low < generic.surface.low:
        raise spans.Undecided("the surface is singular at the start, and its branches may differ")
    if known.contradiction:
        return dataclasses.replace(known, is_certain=False, reason=CONDITION)
    if generic.first == len(generic.differential):
        if not points.both_sides_turn():
            raise spans.Undecided(SIDES_DIFFER)
        # Brackets of two fields, in doubles, certainly show that no combination stays.
        m = len(generic.differential)
        are_independent = generic.all.low == generic.rows.count
        exact = None if are_independent else bracket_values.in_digits(generic, is_decimal=True)
        return dataclasses.replace(
            known,
            extra=(m, 0) if m else (0,),
            growth=(0, m) if m else (0,),
            inside=tuple(not any(weights) for weights in _weights(generic, exact)),
            special=known.special or start.first != m,
            least=float(generic.turning[m - 1]) if m else math.inf,
        )
    if len(points.visited) == 1 and generic.dimension > 1:  # one field has no brackets
        raise spans.Undecided("no other point of the surface was found, and the start may be special")
    for is_decimal, limits in ATTEMPTS:
        try:
            given = BracketValues(generic, deadline, is_decimal, limits)
            found = _searched(known, start, given)
            if not found.is_certain or not found.extra[-1] or not points.has_switches:
                return found
            if generic.block.has_kinks:  # combinations that stay on one side of these
                raise spans.Undecided(SIDES_DIFFER)
            return dataclasses.replace(found, on_piece=True)
        except spans.AmbiguousRank as why:
            failed = why
    raise failed


def _searched(known: NumericFlag, start: EvaluationPoint, given: BracketValues) -> NumericFlag:
    """The flag by brackets."""
    point = given.point
    grown = bracket_values.grown(given) if point.dimension > 1 else Growth(given.span())
    result = dataclasses.replace(
        known,
        growth=grown.ranks,
        inside=tuple(not grown.span.touches(w) for w in _weights(point, given.exact)),
        digits=given.digits,
        error=float(grown.span.error),
        least=float(grown.span.least),
    )
    if point.dimension > 1 and not result.special:
        there: Growth | None = None
        with contextlib.suppress(spans.Undecided):
            there = bracket_values.grown(given.at(start, AT_START), len(grown.levels))
        if there is not None and there.ranks > grown.ranks:
            raise spans.Undecided("brackets have a lower rank at the point that was taken than at the start")
        result = dataclasses.replace(result, special=None if there is None else there.ranks != grown.ranks)
    try:
        extra, span = bracket_values.derived(given, grown)
    except spans.AmbiguousRank:
        raise
    except spans.Undecided as why:
        return dataclasses.replace(result, is_certain=False, reason=str(why))
    error, least = max(result.error, float(span.error)), min(result.least, float(span.least))
    return dataclasses.replace(result, extra=extra, error=error, least=least)


def _weights(point: EvaluationPoint, exact: Exact | None) -> list[list[Decimal]]:
    """The differential rows (m,) at a point as combinations of the independent ones among them. What holonomic rows add
    does not matter. Raises `spans.Undecided` where a row only nearly depends on others."""
    differential, s = point.differential, len(point.block.holonomic)
    m = len(point.block.differential)
    found = {row: unit(len(differential), k) for k, row in enumerate(differential)}
    others = [i for i in range(s + m) if i not in set(point.independent)]
    if others and exact is not None:
        # A row that does not vanish on the kernel of the independent ones depends on them only nearly.
        u = np.random.default_rng(SEED).integers(-(10**6), 10**6, point.block.size).tolist()
        rest = exact.rows_along(u, [Decimal(0)] * len(differential)).relative
        if any(rest[i] > WEIGHT_ROUNDOFF for i in others):
            raise spans.Undecided(NEARLY)
        found |= {i - s: [] for i in others if i >= s}
        for k in range(len(differential)):
            along = exact.rows_along([0] * point.block.size, unit(len(differential), k))
            for i in others:
                weight = Decimal(0) if along.relative[i] <= WEIGHT_ROUNDOFF else along.values[i]
                if i >= s:
                    found[i - s].append(weight)
                elif weight:
                    raise spans.Undecided(NEARLY)
    for i in others if exact is None else ():
        if i < s:
            continue
        # By least squares, in doubles
        dense, lengths = point.rows.dense, point.rows.lengths
        weights = decompositions.least_squares(dense[point.independent].T, dense[i])
        scale, found[i - s] = Decimal(float(np.abs(weights).max(initial=0.0))), []
        independent = point.independent[-len(differential) :] if differential else []
        for k, value in zip(independent, weights[-len(differential) :].tolist(), strict=False):
            weight = Decimal(value)
            if WEIGHT_ROUNDOFF * scale < abs(weight) < ROUGH_SURE * scale:
                raise spans.Undecided(NEARLY)
            is_zero = abs(weight) <= WEIGHT_ROUNDOFF * scale
            found[i - s].append(Decimal(0) if is_zero else weight * Decimal(lengths[i] / lengths[k]))
    return [found[i] for i in range(m)]
