"""The search for the derived flag: at which point, with which brackets, and what they say of the rows (D.3)."""

from __future__ import annotations

import dataclasses
import decimal
import math
from collections.abc import Sequence
from decimal import Decimal

import numpy as np
import numpy.typing as npt

from lagcli.analysis.numeric_flag import bracket_values, dependent_rows, growth, precise_brackets, undecided
from lagcli.analysis.numeric_flag.bracket_values import BracketValues
from lagcli.analysis.numeric_flag.evaluation_point import EvaluationPoint
from lagcli.analysis.numeric_flag.flag_answer import NumericFlag
from lagcli.analysis.numeric_flag.flag_points import Points
from lagcli.analysis.numeric_flag.growth import Growth
from lagcli.analysis.numeric_flag.span import Limits, Span
from lagcli.compiled.row_block import RowBlock
from lagcli.equations.system import System
from lagcli.start.initial import State

Floats = npt.NDArray[np.float64]

CONDITION = "a combination of the rows says g dt = 0, and the condition g = 0 was not found in closed form"
SIDES_DIFFER = "the start lies on a kink (abs, sign, min, max), whose sides may differ"
# What a start that was declared in decimals shows where it lies on a special place.
AT_START = Limits(Decimal("1e-11"), Decimal("1e-11"))
# The limits that are tried: numbers as they are written, as doubles, and at last as those of a start that was rounded,
# off the place that it lies on.
ROUNDED = Limits(Decimal("1e-10"), Decimal("1e-6"))
ATTEMPTS: tuple[tuple[bool, Limits | None], ...] = ((True, None), (False, None), (True, ROUNDED))


def flag(system: System, begin: State, rows: Sequence[int], deadline: float = math.inf) -> NumericFlag:
    """The flag of the differential ones among `rows`, indices of rows of the system, the others holonomic.

    begin: a start on the surface; the flag is that of the motions from it. deadline: a value of `time.monotonic` at
    which the search is given up.
    """
    block = RowBlock(system, sorted(rows))
    nothing = NumericFlag(block.differential, block.has_time)
    try:
        with decimal.localcontext(prec=precise_brackets.DIGITS):
            return _found(nothing, Points(block, system, begin, deadline), deadline)
    except undecided.Undecided as why:
        return dataclasses.replace(nothing, reason=str(why))


def _found(nothing: NumericFlag, points: Points, deadline: float) -> NumericFlag:
    """The flag; `nothing` holds what is known without a search."""
    start, generic = points.start, points.generic()
    if generic.all.value is None or generic.surface.value is None:
        raise undecided.Undecided("no gap in the singular values of the constraint rows decides their rank")
    known = dataclasses.replace(
        nothing,
        dimension=generic.dimension,
        contradiction=generic.still.high < generic.all.low,
        special=start.ranks != generic.ranks,
        places=tuple(points.state(place) for place in points.places),
        surface=generic.surface.low,
        is_certain=True,
    )
    _require_one_branch(generic, start)
    if known.contradiction:
        return dataclasses.replace(known, is_certain=False, reason=CONDITION)
    if generic.first == len(generic.kept):
        if not points.both_sides_turn():
            raise undecided.Undecided(SIDES_DIFFER)
        return _open(known, start, generic)
    if generic is start and generic.dimension > 1:  # one field has no brackets
        raise undecided.Undecided("no other point of the surface was found, and the start may be special")
    for is_spelled, limits in ATTEMPTS:
        try:
            given = BracketValues(generic, deadline, is_spelled, limits)
            return _on_piece(_searched(known, start, given), points, generic)
        except undecided.AmbiguousRank as why:
            failed = why
    raise failed


def _on_piece(found: NumericFlag, points: Points, place: EvaluationPoint) -> NumericFlag:
    """The flag, with what kinks (abs, sign, min, max) mean for combinations that stay."""
    if not found.is_certain or not found.extra[-1] or not points.has_switches:
        return found
    if place.block.has_kinks:
        raise undecided.Undecided(SIDES_DIFFER)
    return dataclasses.replace(found, on_piece=True)


def _open(known: NumericFlag, start: EvaluationPoint, place: EvaluationPoint) -> NumericFlag:
    """The flag where brackets of two fields, in doubles, certainly show that no combination stays."""
    m = len(place.kept)
    whole = None if place.are_independent else bracket_values.in_digits(place, is_spelled=True)
    return dataclasses.replace(
        known,
        extra=(m, 0) if m else (0,),
        growth=(0, m) if m else (0,),
        inside=tuple(not any(weights) for weights in dependent_rows.weights(place, whole)),
        combinations=np.zeros((0, len(place.block.differential))),
        special=known.special or start.first != m,
        least=float(place.turning[m - 1]) if m else math.inf,
    )


def _searched(known: NumericFlag, start: EvaluationPoint, given: BracketValues) -> NumericFlag:
    """The flag by brackets."""
    place = given.place
    grown = growth.of(given) if place.dimension > 1 else Growth(given.span())
    told = dataclasses.replace(
        known,
        growth=grown.ranks,
        inside=tuple(not grown.span.touches(w) for w in dependent_rows.weights(place, given.exact)),
        combinations=_staying(grown.span, place),
        digits=given.digits,
        error=float(grown.span.error),
        least=float(grown.span.least),
    )
    if place.dimension > 1 and not told.special:
        there = _at_start(start, grown, given)
        told = dataclasses.replace(told, special=None if there is None else there.ranks != grown.ranks)
        if there is not None and not told.special:
            told = dataclasses.replace(told, combinations=_staying(there.span, start))
    try:
        extra, span = growth.derived(given, grown)
    except undecided.AmbiguousRank:
        raise
    except undecided.Undecided as why:
        return dataclasses.replace(told, is_certain=False, reason=str(why))
    error, least = max(told.error, float(span.error)), min(told.least, float(span.least))
    return dataclasses.replace(told, extra=extra, error=error, least=least)


def _require_one_branch(place: EvaluationPoint, start: EvaluationPoint) -> None:
    """Raise `undecided.Undecided` where what holds at a place need not hold elsewhere around the start."""
    if start.surface.low < place.surface.low:
        raise undecided.Undecided("the surface is singular at the start, and its branches may differ")


def _at_start(start: EvaluationPoint, grown: Growth, given: BracketValues) -> Growth | None:
    """Brackets at the start, of as many fields, or None where they are not known."""
    try:
        there = growth.of(given.at(start, AT_START), len(grown.levels))
    except undecided.Undecided:
        return None
    if there.ranks > grown.ranks:
        raise undecided.Undecided("brackets have a lower rank at the point that was taken than at the start")
    return there


def _staying(span: Span, place: EvaluationPoint) -> Floats:
    """The combinations (k, m) of the differential rows that vanish on a span, the largest weight 1."""
    found = np.zeros((span.count - span.rank, len(place.block.differential)))
    for row, weights in zip(found, span.annihilators(), strict=True):
        largest = max(map(abs, weights))
        row[place.kept] = [float(a / largest) for a in weights]
    return found
