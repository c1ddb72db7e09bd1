"""The times at which steps must end because of what a model says about t alone, whatever the motion does.

At a switch (`sign`, `abs`, `min`, `max` of functions of t) a step ends a few roundings of the time before, and the next
one begins as shortly after. Between stations no function of t alone rises or falls by much of its range: a step that
passes one of them at most cannot lead over a pulse. Interval arithmetic, which misses none, finds both piece by piece
as the run goes on, wherever it ends.
"""

from __future__ import annotations

import bisect
import math
import sys
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.smoothness.time_functions import TimeFunctions


class TimetableParameters:
    """The fineness in which the time is looked through for switches and stations. The tests are of
    `tests/unit/test_numbers_of_schemes.py`."""

    __slots__ = ()

    rows: int = 1024
    """Rows of the table in a piece that is looked through at once, about.
    `test_a_piece_of_time_holds_a_thousand_rows`."""
    most_halvings: int = 14
    """So often, less where there is more to evaluate. `test_a_piece_with_too_much_is_halved`."""
    most_cells: int = 2**12
    """Cells of a piece at a time that are halved further. `test_no_more_than_four_thousand_cells_are_halved`."""
    most_values: int = 2**21
    """Values in all cells at a time, each of 16 bytes. `test_no_more_than_two_million_values_are_made_at_once`."""
    run: int = 16
    """Cells in a row that are halved down to doubles: rounding alone may fill more.
    `test_cells_in_a_long_row_have_nine_digits`."""
    offset: int = 4
    """Steps keep so many roundings of the time away. `test_steps_keep_four_roundings_of_the_time_from_a_switch`."""
    still: int = 256
    """A switch is no wider than so many. `test_states_stand_still_across_hundreds_of_roundings`."""
    grain: float = doubles.EPS / 1024
    """This part of a piece, near t = 0. `test_near_zero_there_is_another_rounding`."""
    change: float = 0.25
    """By no more of its range in a cell. `test_cells_are_halved_until_functions_change_by_a_quarter`."""
    shortest: float = doubles.EPS * 2**16
    """But not below this part of the piece. `test_cells_of_a_jump_are_halved_thirty_six_times`."""
    between: float = 0.5
    """In all, and by that of a cell; a step passes one station, and a pulse is two.
    `test_between_stations_functions_change_by_half_their_range`."""


PARAMETERS = TimetableParameters()


class SwitchSpan(NamedTuple):
    """A time at which a function of t switches, to rounding: it does between these two."""

    before: float
    after: float


class Timetable:
    """The switches and stations of a run. start: of the run; row_step: the time between its rows; longest: what no step
    may be longer than; passing: how many stations a step may pass."""

    def __init__(
        self,
        functions: TimeFunctions | None,
        start: float,
        row_step: float,
        longest: float = math.inf,
        passing: int = 1,
    ) -> None:
        self._functions, self._start, self._longest = functions, start, longest
        self._passing = passing
        # A power of 2; one that is no double is longer than any run.
        exponent = most = sys.float_info.max_exp
        if row_step > 0:
            exponent = math.ceil(math.log2(PARAMETERS.rows) + math.log2(row_step))
        self._piece = math.ldexp(1.0, exponent) if exponent < most else math.inf
        # All up to a time is known; pieces from there on that are looked through next, the first last.
        self._known = -math.inf
        self._open: list[tuple[float, float, int]] = []
        self._switches: list[SwitchSpan] = []
        self._stationary_times: list[float] = []
        size = 1 if functions is None else functions.size
        self._halvings = max(0, PARAMETERS.most_halvings - size.bit_length())
        is_empty = functions is None or not (functions.switches or functions.oscillations)
        self._is_empty = is_empty or not math.isfinite(self._piece)

    @property
    def is_any(self) -> bool:
        """True if there is anything that steps may have to end at."""
        return not self._is_empty or self._longest < math.inf

    @property
    def least(self) -> float:
        """The time across a switch near t = 0; 0 where there are none."""
        return 0.0 if self._is_empty else 2 * PARAMETERS.offset * PARAMETERS.grain * self._piece

    def shortened(self, t: float, h: float) -> float:
        """The longest step from t that is no longer than h and passes nothing it must not."""
        h = min(h, self._longest)
        if self._is_empty:
            return h
        self._extend(t, t + h)
        i = bisect.bisect_right(self._stationary_times, t) + self._passing
        if i < len(self._stationary_times) and self._stationary_times[i] < t + h:
            h = self._stationary_times[i] - t
        i = bisect.bisect_right(self._switches, (t, math.inf)) if self._switches else 0
        if i < len(self._switches) and self._switches[i].before < t + h:
            h = self._switches[i].before - t
        return h

    def free(self, t: float) -> tuple[float, float]:
        """The time up to which steps may go on from t with nothing in their way that is known, and what none is longer
        than."""
        if self._is_empty:
            return math.inf, self._longest
        i = bisect.bisect_right(self._stationary_times, t) + self._passing
        station = self._stationary_times[i] if i < len(self._stationary_times) else math.inf
        i = bisect.bisect_right(self._switches, (t, math.inf))
        switch = self._switches[i].before if i < len(self._switches) else math.inf
        until = min(station, switch, self._known)
        return until - 2 * PARAMETERS.still * math.ulp(until), self._longest

    def switch(self, t: float) -> tuple[float, float] | None:
        """The time of the switch at which t stands, and one on its other side; None where it stands at none."""
        if self._is_empty or not (self._functions and self._functions.switches):
            return None
        self._extend(t, t)
        # A step that ends at a time may miss it by a rounding.
        near = t + 2 * math.ulp(t)
        i = bisect.bisect_right(self._switches, (near, math.inf)) - 1
        if i < 0 or self._switches[i].after <= t:
            return None
        before, after = self._switches[i]
        if not _is_still(self._switches[i], PARAMETERS.grain * self._piece):
            return None
        return max(t, before + (after - before) / 2), after

    def ahead(self, t: float, until: float) -> float | None:
        """The first switch after t, known so far, and not after another time."""
        return next((switch.before for switch in self._switches if t < switch.before <= until), None)

    def _extend(self, t: float, until: float) -> None:
        """Find what is not known yet between two times, as far as the next step from the first may need it."""
        limit = until + PARAMETERS.still * math.ulp(until)
        if self._known > limit:
            return
        # What lies behind is not asked for again.
        self._switches = [switch for switch in self._switches if switch.after >= t]
        self._stationary_times = [station for station in self._stationary_times if station >= t]
        while self._known <= limit:
            # A step from t ends at what is known.
            passed = bisect.bisect_right(self._stationary_times, t) + self._passing
            if len(self._stationary_times) > passed or (self._switches and self._switches[-1].before > t):
                break
            if not self._open:
                first = self._known
                if not math.isfinite(first):
                    first = math.floor(t / self._piece) * self._piece
                self._open.append((first, first + self._piece, self._halvings))
            self._search(t, *self._open.pop())

    def _search(self, t: float, low: float, high: float, halvings: int) -> None:
        """Find all between two times that is ahead of t; the first half first where there is too much."""
        assert self._functions is not None
        functions, grain = self._functions, PARAMETERS.grain * self._piece
        begin = max(low, self._start - PARAMETERS.still * math.ulp(self._start))
        if begin < high and high >= t:
            span = begin, high

            def find() -> tuple[list[SwitchSpan] | None, list[float] | None]:
                switches = _switches(functions, span, grain)
                return switches, _stationary_times(functions, functions.oscillations, span)

            # Kept for the next run; None where there is too much.
            switches, stations = functions.cached.answer((*span, self._piece), find)
            if halvings and (switches is None or stations is None):
                middle = (low + high) / 2
                self._open += [(middle, high, halvings - 1), (low, middle, halvings - 1)]
                return
            # What is too much in the shortest piece is left to the error estimate and to the rows; of each function by
            # itself there may be less.
            if stations is None:
                each = (_stationary_times(functions, (wave,), span) for wave in functions.oscillations)
                stations = sorted({x for found in each for x in found or []})
            self._add(switches or [], stations)
        self._known = high

    def _add(self, switches: list[SwitchSpan], stations: list[float]) -> None:
        for switch in switches:
            last = self._switches[-1] if self._switches else None
            if last is not None and switch.before <= last.after:
                self._switches[-1] = SwitchSpan(last.before, max(last.after, switch.after))
            else:
                self._switches.append(switch)
        self._stationary_times += stations


def _switches(functions: TimeFunctions, span: tuple[float, float], grain: float) -> list[SwitchSpan] | None:
    """The switches between two times; None where there is too much to look at."""
    if not functions.switches:
        return []
    left, right = (np.array([x]) for x in span)
    coarse: list[tuple[float, float]] = []
    while True:
        if left.size * functions.size > PARAMETERS.most_values:
            return None
        values = functions.values((left, right), functions.switches)
        enforced = np.zeros(left.size, dtype=bool)
        for a, b in values:
            # What is zero all over a cell switches at its ends, if anywhere.
            zero = (a <= 0.0) & (b >= 0.0) & ~((a == 0.0) & (b == 0.0))
            enforced |= np.atleast_2d(zero).any(axis=0)
        left, right = left[enforced], right[enforced]
        whole = (right - left <= grain) | (right <= np.nextafter(left, np.inf))
        if whole.all():
            break
        fine = right - left <= doubles.ZERO * np.maximum(np.abs(left), np.abs(right))
        if fine.any():
            # Cells in a row of many without a gap.
            numbers = np.cumsum(np.concatenate([[0], left[1:] > right[:-1]]))
            crowded = fine & (np.bincount(numbers)[numbers] > PARAMETERS.run)
            coarse += zip(left[crowded].tolist(), right[crowded].tolist(), strict=True)
            left, right, whole = left[~crowded], right[~crowded], whole[~crowded]
        if left.size > PARAMETERS.most_cells:
            return None
        left, right = _halved(left, right, ~whole)
    found = _joined([*zip(left.tolist(), right.tolist(), strict=True)], grain)
    wide = []
    for switch in _joined(coarse, grain):
        if _is_still(switch, grain):
            found.append(switch)
        else:
            wide += [(x, x) for x in switch]
    return _joined([*found, *_joined(wide, grain)], 0.0) if coarse else found


def _is_still(switch: SwitchSpan, grain: float) -> bool:
    """True if states stand still across a switch."""
    return switch.after - switch.before <= PARAMETERS.still * max(math.ulp(switch.after), grain)


def _halved(left: Floats, right: Floats, which: npt.NDArray[np.bool_]) -> tuple[Floats, Floats]:
    """Some of the cells in two halves each."""
    middle = np.where(which, left + (right - left) / 2, right)
    left, right = np.column_stack([left, middle]).ravel(), np.column_stack([middle, right]).ravel()
    real = left < right
    return left[real], right[real]


def _joined(cells: list[tuple[float, float]] | list[SwitchSpan], grain: float) -> list[SwitchSpan]:
    """Cells as switches, with some roundings aside; those that nearly touch as one."""
    found: list[SwitchSpan] = []
    for a, b in sorted(cells):
        offset = PARAMETERS.offset * max(math.ulp(max(abs(a), abs(b))), grain) if grain else 0.0
        if found and a - 4 * offset <= found[-1].after:
            found[-1] = SwitchSpan(found[-1].before, max(found[-1].after, b + offset))
        else:
            found.append(SwitchSpan(a - offset, b + offset))
    return found


def _stationary_times(
    functions: TimeFunctions, oscillations: tuple[int, ...], span: tuple[float, float]
) -> list[float] | None:
    """The stations of waves between two times; None where there is too much to look at."""
    if not oscillations:
        return []
    whole = functions.values((np.array([-np.inf]), np.array([np.inf])), oscillations)
    left, right = (np.array([x]) for x in span)
    shortest = PARAMETERS.shortest * (span[1] - span[0])
    while True:
        values = functions.values((left, right), oscillations)
        # The most that a function may change in each cell, as a part of its range: at all times, or in this piece where
        # it has no bound. Of a family the largest.
        change = np.zeros(left.size)
        for bound, value in zip(whole, values, strict=True):
            low, high = (np.atleast_2d(part) for part in value)
            scale = np.atleast_2d(bound[1] - bound[0])
            scale = np.where(np.isfinite(scale), scale, (high.max(axis=1) - low.min(axis=1))[:, None])
            with np.errstate(all="ignore"):
                part = (high - low) / scale
            # Where it has no bound in this piece either, or is constant, there is nothing to know.
            change = np.maximum(change, np.where(np.isfinite(part), part, 0.0).max(axis=0))
        split = (change > PARAMETERS.change) & (right - left > shortest)
        if not split.any():
            break
        if left.size > PARAMETERS.most_cells or 2 * left.size * functions.size > PARAMETERS.most_values:
            return None
        left, right = _halved(left, right, split)
    return _spaced(right, np.minimum(change, 1.0))


def _spaced(ends: Floats, change: Floats) -> list[float]:
    """Ends of cells such that functions change by `between` at most from one to the next, or within one cell."""
    found: list[float] = []
    total = 0.0
    for end, part in zip(ends.tolist(), change.tolist(), strict=True):
        total += part
        if total > PARAMETERS.between:
            found.append(end)
            total = 0.0
    if total > 2 * PARAMETERS.change and (not found or found[-1] < ends[-1]):
        found.append(float(ends[-1]))
    return found
