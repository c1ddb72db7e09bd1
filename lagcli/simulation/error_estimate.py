"""The error of a run from its distance to the same run repeated at a tighter tolerance, row by row.

Reintegration, as in L. F. Shampine, Error Estimation and Control for ODEs, J. Sci. Comput. 25 (2005): it sees errors
that the motion amplifies, and steps that something else than the tolerance has cut. Near rounding a tighter run is no
better, and the distance is one by chance.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from lagcli.arrays import Flags, Floats
from lagcli.equations.system import System
from lagcli.frozen import frozen_value
from lagcli.model.settings import Simulation
from lagcli.simulation.run_state.statistics import Incident
from lagcli.simulation.scheme import step_tolerance

if TYPE_CHECKING:
    from lagcli.simulation.loop import Run


KINDS = ("r", "v", "lambda", "R")
_NAMES = ("positions", "velocities", "multipliers", "R")
# A kind that has less digits than these at the end is reported with the time up to which it had them.
SURE = 3


@frozen_value
class Accuracy:
    """The estimate at the last row, t; four numbers each, in the order of `KINDS`.

    errors: of the largest component up to t, in the units of the columns; scales: the largest value up to t; until:
    time of the last row before the error first exceeded a thousandth of the scale; rtol: the tolerance of the steps of
    the repeated run; steps, rejected, evaluations: its account; zero: kinds of which all values are zero to rounding;
    parted: between which times the runs have gone apart at once, one of them having missed a force; between: how many
    rows stand between the times of one incident in both runs, which count for positions alone, and the time of the
    first; growth: by how much each impact makes errors grow, where they do exponentially; energy_error: of a run whose
    energy should be kept and is not, as a part of the energy exchanged, else 0.
    """

    t: float
    errors: tuple[float, ...]
    scales: tuple[float, ...]
    until: tuple[float, ...]
    rtol: float
    steps: int
    rejected: int
    evaluations: int
    zero: frozenset[str] = frozenset()
    parted: tuple[float, float] | None = None
    between: tuple[int, float] | None = None
    growth: float | None = None
    energy_error: float = 0.0

    @property
    def digits(self) -> dict[str, float | None]:
        """log10(scale / error) of each kind, from 0 to what the energy has; None where there is nothing but zeros, to
        rounding."""
        found: dict[str, float | None] = {}
        for kind, error, scale in zip(KINDS, self.errors, self.scales, strict=True):
            error = max(error, self.energy_error * scale)
            is_known = scale and math.isfinite(error)
            digits = max(0.0, math.log10(scale / error)) if is_known else 0.0 if scale else None
            found[kind] = None if kind in self.zero else digits
        return found

    @property
    def sentence(self) -> str:
        """The digits of all kinds in words; empty where nothing but zeros was computed."""
        reported: list[str] = []
        for name, digits, until in zip(_NAMES, self.digits.values(), self.until, strict=True):
            if digits is None:
                continue
            count = str(math.floor(digits))
            better = f" (to {SURE} up to t = {until:.9g})" if digits < SURE and until < self.t else ""
            verb = "is" if name == "R" else "are"
            first = f"{name} {verb} right to {count} digits up to t = {self.t:.9g}{better}"
            reported.append(f"{name} to {count}{better}" if reported else first)
        none = [name for kind, name in zip(KINDS, _NAMES, strict=True) if kind in self.zero]
        if none:
            reported.append(f"{' and '.join(none)} {'is' if none == ['R'] else 'are'} zero to rounding")
        sentence = ", ".join(reported)
        if self.parted is not None:
            early, late = self.parted
            sentence += (
                f"; the two runs go apart between t = {early:.9g} and {late:.9g}: one of them did not see a force"
                " there, so bound the steps with --max-step"
            )
        if self.growth is not None:
            sentence += (
                f"; errors grow about {self.growth:.2g} times at each impact, as they do at convex bodies: no tolerance"
                " helps for long"
            )
        if self.between is not None:
            rows, since = self.between
            standing = "1 row stands" if rows == 1 else f"{rows} rows stand"
            sentence += (
                f"; {standing} between the times that an incident has in both runs ({'' if rows == 1 else 'the first '}"
                f"at t = {since:.9g}): velocities there are those before it or behind it, and are not counted"
            )
        if self.energy_error:
            sentence += (
                f"; the energy should stay and is off by {self.energy_error:.1e} of what is exchanged: no more digits"
                " are claimed than it has, and both runs may have missed the same force"
            )
        return sentence

    def as_json(self) -> dict[str, Any]:
        """The objects of `--stats`."""
        return {
            "digits": self.digits,
            "errors": dict(zip(KINDS, self.errors, strict=True)),
            "three_digits_until": dict(zip(KINDS, self.until, strict=True)),
            "repeated": {
                "step_rtol": self.rtol,
                "steps": self.steps,
                "rejected": self.rejected,
                "evaluations": self.evaluations,
                "parted": None if self.parted is None else list(self.parted),
                **({} if self.between is None else {"rows_between": self.between[0]}),
                **({} if self.growth is None else {"growth_at_impacts": self.growth}),
            },
        }


# Of the kinds, positions and velocities: multipliers and forces jump where the model says so.
STATES = [0, 1]


COLUMNS = tuple(f"err.{kind}" for kind in KINDS)


def window(count: int) -> int:
    """The rows within which runs go apart, of a table with so many."""
    return max(1, math.ceil(PARAMETERS.part * count))


class Parting:
    """The last interval in which the distance of two tables grows too fast, if that is much of what they hold in the
    end. window: rows it has for that, 0 for never; rtol, atol: of the runs."""

    def __init__(self, window: int, rtol: float = 0.0, atol: float = 0.0) -> None:
        self._window, self._rtol, self._atol = window, rtol, atol
        self._t, self._gaps = np.zeros(0), np.zeros((0, len(STATES)))
        self._sizes = np.zeros(len(STATES))
        self._interval: tuple[float, float] | None = None
        self._grown = np.zeros(len(STATES))

    @property
    def found(self) -> tuple[float, float] | None:
        """The times of the rows between which it grew."""
        known = PARAMETERS.tolerances * (self._atol + self._rtol * self._sizes)
        least = np.maximum(PARAMETERS.least * self._sizes, known)
        return self._interval if (self._grown > least).any() else None

    def take(self, t: Floats, gaps: Floats, sizes: Floats) -> None:
        """The times of rows (k,), the largest distances so far and the scales of each kind (k, kinds)."""
        if not self._window or not t.size:
            return
        times, gaps = np.concatenate([self._t, t]), np.vstack([self._gaps, gaps[:, STATES]])
        now, before = gaps[self._window :], gaps[: -self._window]
        size = sizes[len(sizes) - len(now) :, STATES]
        jumps = (now > PARAMETERS.least * size) & (now > PARAMETERS.factor * before)
        for i in np.flatnonzero(jumps.any(axis=1)).tolist():
            begin, end = float(times[i]), float(times[i + self._window])
            # Rows of one rise are one interval; what grows again by so much leaves the interval before far behind.
            if self._interval is None or begin >= self._interval[1]:
                self._interval = begin, end
            self._grown = np.maximum(self._grown, np.where(jumps[i], now[i], 0.0))
        self._sizes = sizes[-1, STATES]
        self._t, self._gaps = times[-self._window :], gaps[-self._window :]


class RepeatedRunParameters:
    """The repeated run, and what the distance of the two says of the error. The tests are of
    `tests/unit/test_numbers_of_steps.py` and `tests/unit/test_numbers_of_starts.py`."""

    __slots__ = ()

    tighter: float = 250.0
    """The part of the tolerance of the first run that it has. `test_a_repeated_run_has_a_smaller_tolerance`."""
    first_step: float = 0.45
    """It begins with this part of the first step, which the tolerance may not change: equal steps err alike.
    `test_a_repeated_run_begins_shorter`."""
    finest: float = 3e-15
    """The relative tolerance below which the error estimate is rounding.
    `test_a_repeated_run_has_a_smaller_tolerance`."""
    nearly: float = 3.0
    """Of a tolerance below so many times the finest. `test_a_fine_run_is_repeated_with_more_error`."""
    safety: tuple[tuple[float, float], ...] = ((0.99e-12, 1.0), (0.99e-13, 1.5), (0.0, 3.0))
    """The factor of the first line that the tolerance of a step reaches, on the distance of the runs: two errors may
    agree by chance, most often where both are sums of rounding.
    `test_the_distance_of_runs_counts_more_near_rounding`."""
    floor: float = 1e-13
    """No estimate is below this part of the scale. `test_no_estimate_is_below_thirteen_digits`."""

    factor: float = 1e5
    """The two go apart where their distance grows by this factor: in chaos that takes eleven times the time in which
    errors grow e-fold. `test_runs_go_apart_where_their_distance_grows_too_fast`."""
    least: float = 1e-7
    """To this or more: the factor of any rounding is less. `test_runs_go_apart_where_their_distance_grows_too_fast`."""
    part: float = 0.01
    """Within this part of the run. `test_runs_go_apart_within_a_hundredth_of_the_rows`."""
    tolerances: float = 1e3
    """And to so many tolerances. `test_runs_go_apart_where_their_distance_grows_too_fast`."""


PARAMETERS = RepeatedRunParameters()
NOT_RESUMED = (
    "a checkpoint holds a run, and not the one it is compared with, so that the error up to it is not known; take the"
    " run from its start"
)


def repeated(settings: Simulation) -> Simulation:
    """The settings of the repeated run: another tolerance, such that steps differ too, and half the largest step."""
    if settings.max_step is not None:
        settings = dataclasses.replace(settings, max_step=settings.max_step / 2)
    rtol, atol, *_ = step_tolerance.of_steps(settings).tolist()
    if rtol < PARAMETERS.nearly * PARAMETERS.finest:
        finer, atol = PARAMETERS.nearly * rtol, PARAMETERS.nearly * atol
    else:
        finer = max(rtol / PARAMETERS.tighter, PARAMETERS.finest)
        atol = max(atol * finer / rtol, min(atol, step_tolerance.PARAMETERS.least))
    # The settings whose steps have these tolerances: the inverse of `step_tolerance.of_steps`.
    limits = step_tolerance.PARAMETERS
    wanted = finer if finer < limits.finest else finer * limits.tightening
    absolute = None if settings.atol is None else atol * wanted / finer
    return dataclasses.replace(settings, rtol=wanted, atol=absolute)


def safety(settings: Simulation) -> float:
    """The factor on the distance of the two runs."""
    rtol = step_tolerance.of_steps(settings)[0]
    return next(factor for least, factor in PARAMETERS.safety if rtol >= least)


def columns_of_kinds(system: System) -> tuple[list[int], ...]:
    """The indices of the columns of each kind in a row of the table of a system, the first of which is t."""
    at = {name: i for i, name in enumerate(system.columns, 1)}
    particles, generalized = system.model.particle_names, system.model.generalized_names
    named = (
        *system.model.state_columns,
        tuple(f"lambda.{row.name}" for row in system.rows.rows),
        (*(f"R.{name}.{axis}" for name in particles for axis in "xyz"), *(f"R.{q}" for q in generalized)),
    )
    return tuple([at[name] for name in names] for names in named)


# Incidents whose times are off by the errors of both runs: a row between them has the velocities before an impact in
# the one and those after it in the other, which tells nothing about how well either is known.
COMPARED = ("impact", "contact", "release", "accumulation")
LATE = 1e-4  # of the time since the start: incidents that differ by more are no longer the same
# Errors that grow by powers of time come to less than GROWN times from half of the impacts on; FEWEST are needed.
GROWN, FEWEST = 30.0, 6


class IncidentSides:
    """The incidents of two runs, taken as they come, and the rows between those that belong together: how many `rows`
    there were, and the time of the `first`."""

    def __init__(self) -> None:
        self.rows = 0
        self.first: float | None = None
        self._start: float | None = None
        self._pending: dict[tuple[str, str], tuple[list[float], list[float]]] = {}

    def add(self, side: int, incidents: Sequence[Incident]) -> None:
        """Incidents of the run (0) or of the repeated one (1), in the order of time."""
        for one in incidents:
            if one.kind in COMPARED:
                self._pending.setdefault((one.kind, one.name), ([], []))[side].append(one.t)

    def between(self, t: Floats) -> Flags:
        """True for rows at times t (k,) between the incidents of both runs, all of which are known up to the last
        row."""
        found = np.zeros(len(t), dtype=bool)
        if not len(t):
            return found
        start = self._start = float(t[0]) if self._start is None else self._start
        late = LATE * (t - start)
        for sides in self._pending.values():
            one, other = (np.searchsorted(side, t, "right") for side in sides)
            for k in np.flatnonzero(one != other).tolist():
                ahead = sides[0] if one[k] > other[k] else sides[1]
                found[k] |= t[k] - ahead[min(one[k], other[k])] <= late[k]
            # What belongs together is left out, and what has had no other for long.
            count = min(int(one[-1]), int(other[-1]))
            for side in sides:
                del side[:count]
                del side[: int(np.searchsorted(side, float(t[-1]) - float(late[-1]), "left"))]
        return self._counted(t, found)

    def beside(self, t: Floats) -> Flags:
        """As `between`, for a table whose own incidents are not known: rows next to one of the repeated run."""
        start = self._start = float(t[0]) if self._start is None and len(t) else self._start
        found = np.zeros(len(t), dtype=bool)
        for _, times in self._pending.values():
            for at in times:
                found |= np.abs(t - at) <= LATE * LATE * (t - (start or 0.0))
            times[:] = [at for at in times if len(t) and at > t[-1]]
        return self._counted(t, found)

    def _counted(self, t: Floats, found: Flags) -> Flags:
        if found.any() and self.first is None:
            self.first = float(t[int(np.argmax(found))])
        self.rows += int(found.sum())
        return found


class ImpactGrowth:
    """The distance of positions as the impacts go on."""

    def __init__(self) -> None:
        self._gaps: list[float] = []  # behind so many instants of impacts
        self._last: float | None = None
        self._count = 0

    def take(self, t: Floats, gaps: Floats, incidents: Sequence[Incident]) -> None:
        """Rows t (k,), the largest distance of positions up to each (k,), and the incidents that came with them."""
        times = []
        for one in incidents:
            if one.kind == "impact" and one.t != self._last:
                self._last = one.t
                times.append(one.t)
        if not times or not len(t):
            return
        rows = np.minimum(np.searchsorted(t, times, "left"), len(t) - 1)
        self._gaps += gaps[rows].tolist()
        self._count += len(times)

    def factor(self, floor: float) -> float | None:
        """By how much an impact makes errors grow, where they grow exponentially; floor: what is rounding alone."""
        gaps = np.array(self._gaps)
        if len(gaps) < FEWEST:
            return None
        half = len(gaps) // 2
        begin = max(float(gaps[half]), floor)
        if gaps[-1] < GROWN * begin:
            return None
        return float((gaps[-1] / begin) ** (1 / (len(gaps) - 1 - half)))


class Errors:
    """Running maxima of the distance of two tables and of the values themselves, of each kind. kinds: the columns of
    each kind; parted: looks for an interval in which the tables go apart."""

    def __init__(self, kinds: tuple[list[int], ...], factor: float, parted: Parting | None = None) -> None:
        self._parting = parted or Parting(0)
        self._kinds, self._factor = kinds, factor
        self._gaps, self._sizes = np.zeros(len(kinds)), np.zeros(len(kinds))
        self._last = math.nan
        self.sides, self._growth = IncidentSides(), ImpactGrowth()
        self._until = [math.nan] * len(kinds)
        self._is_lost = [False] * len(kinds)

    def take(self, rows: Floats, others: Floats, incidents: Sequence[Incident] | None = ()) -> Floats:
        """The errors (k, 4) of rows (k, columns) of the one table from those of the other at the same times. incidents:
        those that came with them, which `sides` knows already; None where they are not known."""
        t = rows[:, 0]
        between = self.sides.beside(t) if incidents is None else self.sides.between(t)
        apart = [rows[:, at] - others[:, at] for at in self._kinds]
        for gap in apart[1:]:  # positions go on through an impact
            gap[between] = 0.0
        with np.errstate(invalid="ignore"):
            gaps = _running(self._gaps, apart)
        # Where one of the runs has seen nothing, its values alone give no scale.
        both = [np.maximum(np.abs(rows[:, at]), np.abs(others[:, at])) for at in self._kinds]
        sizes = _running(self._sizes, both)
        self._growth.take(t, gaps[:, 0], incidents or ())
        self._parting.take(t, gaps, sizes)
        errors = np.maximum(self._factor * gaps, PARAMETERS.floor * sizes)
        if not len(rows):
            return errors
        self._gaps, self._sizes = gaps[-1], sizes[-1]
        if math.isnan(self._last):
            self._until = [float(t[0])] * len(self._kinds)
        for kind, column in enumerate((errors > 10.0**-SURE * sizes).T):
            if not self._is_lost[kind]:
                self._is_lost[kind] = bool(column.any())
                good = int(np.argmax(column)) if self._is_lost[kind] else len(t)
                if good:
                    self._until[kind] = float(t[good - 1])
        self._last = float(t[-1])
        return errors

    def accuracy(self, again: Run, tolerance: float) -> Accuracy | None:
        """The accuracy after the rows so far, if any; `again`: the repeated run, with this tolerance."""
        if math.isnan(self._last):
            return None
        errors = np.maximum(self._factor * self._gaps, PARAMETERS.floor * self._sizes)
        statistics = again.statistics
        return Accuracy(
            self._last,
            tuple(errors.tolist()),
            tuple(self._sizes.tolist()),
            tuple(self._until),
            tolerance,
            statistics.steps,
            statistics.rejected,
            statistics.evaluations,
            parted=self._parting.found,
            between=None if self.sides.first is None else (self.sides.rows, self.sides.first),
            growth=self._growth.factor(PARAMETERS.floor * float(self._sizes[0])),
        )


def _running(before: Floats, values: list[Floats]) -> Floats:
    """The largest of each kind up to each row. What has no value, a multiplier at its pole, does not count."""
    sizes = [np.abs(np.where(np.isfinite(value), value, 0.0)).max(axis=1, initial=0.0) for value in values]
    return np.maximum.accumulate(np.vstack([before, np.array(sizes).T]))[1:]
