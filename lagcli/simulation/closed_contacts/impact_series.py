"""Impacts that follow each other faster than a run can tell their instants apart, each by itself and in its order.

Within so short a time forces do nothing: the series is what impacts make of gaps and speeds. It ends after finitely
many, or it contracts: from some impact on gaps and speeds are those of an earlier one, smaller by the same parts. Then
infinitely many follow within a finite time (S. McNamara and W. R. Young, Inelastic collapse in two dimensions, 1994),
and in the limit the contacts of the series stay together: the impact of these with e = 0.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from lagcli import doubles
from lagcli.arrays import Flags, Floats
from lagcli.simulation.closed_contacts import contact_change
from lagcli.simulation.closed_contacts.contact_change import ContactsUndecided, ImpactResult
from lagcli.simulation.closed_contacts.contact_instant import ContactInstant

# Gaps that open to so many times what is not told apart from closed are left to steps again.
FARTHER = 10.0
# Impacts of one series that are looked at: a heavy body that light ones bring to rest before a wall has thousands.
MOST = 5_000


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class ClosedBefore:
    """Contacts before an impact, (K,) each: that pressed; that stayed closed without a push, and drift by rounding
    alone; that touch, but whose impacts had no end; times at which they were struck of late, as impacts that crowd, or
    nan."""

    pressed: Flags
    touching: Flags
    bouncing: Flags
    last: Floats


def apart(here: ContactInstant, before: ClosedBefore) -> Flags:
    """Contacts that are as good as closed, so that an impact of others is none of theirs, (K,): they part already, or
    have begun to; or they come a little later, as they did before, where an impact of two at one instant would be
    chance. Raises `ContactsUndecided`."""
    parting, closing = here.speeds > here.slow, here.near & (here.speeds < -here.slow)
    if not closing.any():
        return np.zeros(closing.size, dtype=bool)
    first, last = closing & (here.g <= here.unresolved), before.last
    in_turn = np.isfinite(last) & np.isfinite(last[first]).all() & ~np.isin(last, last[first])
    later = closing & ~first & in_turn & first.any()
    opened, still = before.bouncing, here.near & before.touching & ~closing
    if still.any():
        opened = opened | contact_change.opening(here, still)
    left = parting & ~before.pressed & ~before.touching | opened & ~closing
    return np.asarray(here.near & left | later)


def impacts(here: ContactInstant, restitution: Floats, before: ClosedBefore) -> tuple[ImpactResult, ...]:
    """The impact of contacts that are closed, none where none approaches, and those that follow at once. The last
    impact may be the limit of infinitely many. Raises `ContactsUndecided`."""
    away = apart(here, before)
    while True:
        first = contact_change.impact(here, restitution, here.near & ~away)
        if first is None:
            return ()
        if not (here.near & ~first.impacting).any():
            return (first,)
        series = _Series(here.whole, restitution, first, away).followed()
        speeds = here.moved(series[-1].v).speeds
        # What comes more slowly than rest is told from is struck by no later impact: it is struck by this one.
        left = away & (speeds < -here.speed_roundoff) & (speeds >= -here.slow)
        if not left.any():
            return series
        away = away & ~left


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class _After:
    """Contacts that were struck, (K,), gaps and speeds of all after it, and the time from the one before it."""

    struck: Flags
    gaps: Floats
    speeds: Floats
    wait: float


class _Series:
    """A series of impacts that begins with a `first` one, of all closed contacts but those that are `away`, (K,)."""

    def __init__(self, here: ContactInstant, restitution: Floats, first: ImpactResult, away: Flags) -> None:
        self._restitution, self._impacts = restitution, [first]
        # Which of those that are not told from closed ones comes first is not known.
        self._gaps = np.where(here.near & ~away, 0.0, np.maximum(here.g, here.noise))
        # Contacts that are not closed, however small their gaps.
        self._apart = away | first.apart
        # Impacts so many are not part of a limit.
        self._alone = 1
        self._now = here.moved(first.v)
        self._afters = [_After(first.impacting, self._gaps, self._now.speeds, 0.0)]
        self._struck, self._way, self._took = first.impacting, np.zeros(first.v.size), 0.0

    def followed(self) -> tuple[ImpactResult, ...]:
        """The impacts up to where all contacts part, or the next one is late enough to be found by steps."""
        while (closing := self._closing).any():
            now, times = self._now, np.full(closing.size, np.inf)
            times[closing] = self._gaps[closing] / -now.speeds[closing]
            struck = closing & (times <= times.min())
            far = FARTHER if len(self._impacts) > 1 else 1.0
            if (self._gaps > far * now.unresolved)[struck].all():
                if (now.g <= now.noise)[closing].any():
                    # The same impacts would follow at once, from the gaps at the begin of the series.
                    self._impacts[-1] = dataclasses.replace(self._impacts[-1], way=self._way)
                break
            own = self._contracts(times)
            if own is not None:
                self._end(own)
                continue
            if len(self._impacts) > MOST:
                raise ContactsUndecided(
                    f"{len(self._impacts)} impacts within {self._took:.1g} of time, and no end of them",
                    np.flatnonzero(self._struck),
                )
            # The next impact: of contacts that are struck after a time, with those that stay closed.
            wait, rests = float(times.min()), now.at_rest & ~self._apart
            now.slow[struck] = np.minimum(now.slow, now.speed_roundoff)[struck]
            following = contact_change.impact(now, self._restitution, struck | rests)
            assert following is not None, "contacts that are struck approach"
            # Gaps that close too slowly to tell do not close.
            moved = self._gaps + wait * np.where(closing, now.speeds, np.maximum(now.speeds, 0.0))
            self._gaps = np.where(struck | rests, 0.0, np.maximum(moved, 0.0))
            self._way, self._took = self._way + wait * now.state.v, self._took + wait
            self._apart = self._apart & ~following.impacting | following.apart
            self._impacts.append(following)
            self._now, self._struck = now.moved(following.v), self._struck | struck
            self._afters.append(_After(struck, self._gaps, self._now.speeds, wait))
        own, now = self._struck, self._now
        if len(self._impacts) > 1 and now.at_rest[own].all() and self._restitution[own].all():
            last, before = self._windows(own)
            rests = own | now.at_rest & ~self._apart
            is_pressed = last < before or set(np.flatnonzero(own)) <= set(
                contact_change.contact_forces(now, rests).closed
            )
            if is_pressed:
                # It has contracted to what is none: the last impact still was one.
                self._impacts.pop()
                self._now = now.moved(self._impacts[-1].v)
                self._end(own)
        return (*self._impacts[:-1], dataclasses.replace(self._impacts[-1], apart=self._apart))

    @property
    def _closing(self) -> Flags:
        """Contacts that are to be struck, (K,): forces, which would be faster than slow ones, do nothing meanwhile."""
        none = np.where(self._apart, np.minimum(self._now.slow, self._now.speed_roundoff), self._now.slow)
        return np.asarray(self._now.speeds < -none)

    def _end(self, own: Flags) -> None:
        """Go on behind the limit of the series, after which its contacts, (K,), stay together: all impacts in one."""
        now, none, alone = self._now, np.zeros(own.size), self._alone
        later, wait = self._impacts[alone:], sum(after.wait for after in self._afters[alone:])
        contacts, v = np.flatnonzero(own | now.at_rest & ~self._apart), now.state.v
        of_equalities = np.zeros(self._impacts[0].of_equalities.size)
        of_equalities = np.sum([of_equalities, *(each.of_equalities for each in later)], axis=0)
        of_contacts = np.sum([none, *(each.of_contacts for each in later)], axis=0)
        # The second turn takes away the rounding of large impulses.
        for _ in range(2):
            common = contact_change.law(now.moved(v), contacts, none)
            v, of_equalities = common.x, of_equalities + common.of_equalities
            of_contacts[contacts] += common.of_contacts
        is_none = np.zeros(own.size, dtype=bool)
        rows = tuple(sorted({row for each in self._impacts for row in each.shared}))
        limit = ImpactResult(v, v, of_equalities, of_contacts, is_none, is_none, none, rows, own, is_none)
        self._now, self._gaps = now.moved(v), np.where(own, 0.0, self._gaps)
        self._apart = self._apart & ~own | contact_change.opening(self._now, own | self._now.at_rest)
        self._impacts[alone:] = [limit]
        self._afters[alone:] = [_After(own, self._gaps, self._now.speeds, wait)]
        # The impact that goes before the next limit is reported by itself too.
        self._alone = len(self._impacts) + 1

    def _contracts(self, times: Floats) -> Flags | None:
        """The contacts (K,) of a series that goes on as it did without end; None where it does not. times: after which
        contacts would be struck, (K,)."""
        last, count = self._afters[-1], len(self._afters)
        contacts = int(self._struck.sum())
        for index in range(count - 2, max(-1, count - 2 - 4 * contacts), -1):
            before = self._afters[index]
            if (before.struck != last.struck).any():
                continue
            period = self._afters[index + 1 :]
            own = np.any([after.struck for after in period], axis=0)
            slower = _part(before.speeds[own], last.speeds[own])
            smaller = _part(before.gaps[own], last.gaps[own])
            if slower is None or smaller is None or not smaller < min(slower, 1.0):
                continue
            sooner = smaller / slower
            lasting = sum(after.wait for after in period) * sooner / (1.0 - sooner)
            if (times[~own] > lasting).all():
                return np.asarray(own)
        # A series may add nothing to its time any more, in whatever order its contacts are struck.
        lost = doubles.EPS * self._took
        if self._afters[-1].wait >= lost:
            return None
        own = np.any([after.struck for after in self._afters[count // 2 :]], axis=0)
        now, earlier = self._windows(own)
        return own if now < lost and now < earlier and (times[~own] > now).all() else None

    def _windows(self, own: Flags) -> tuple[float, float]:
        """The time in which contacts (K,) were struck last, all of them, and that before it, infinite where there is
        none: a series whose times grow has no end, though its speeds become none."""
        times, left = [0.0], own.copy()
        for after in reversed(self._afters):
            left, times[-1] = left & ~after.struck, times[-1] + after.wait
            if not left.any():
                times, left = [*times, 0.0], own.copy()
                if len(times) > 2:
                    return times[0], times[1]
        return times[0], np.inf


def _part(before: Floats, after: Floats) -> float | None:
    """The part of numbers (k,) that they are later, all of them the same; None where they are not."""
    size = float(np.abs(before).max())
    if size == 0.0:
        return None if after.any() else 0.0
    part = float(np.abs(after).max()) / size
    return part if (np.abs(after - part * before) <= doubles.ZERO * part * size).all() else None
