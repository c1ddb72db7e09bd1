"""Impacts that follow each other faster than a run can tell their instants apart, each by itself and in its order.

Within so short a time forces do nothing, and gaps grow and close at constant speeds: the series is what impacts make of
gaps and speeds. It comes to an end after finitely many impacts, or it contracts: from some impact on gaps and speeds are
those of an earlier one, all gaps and all speeds by the same parts smaller. Then infinitely many follow within a finite
time (S. McNamara and W. R. Young, Inelastic collapse in two dimensions, 1994), and in the limit the contacts of the
series stay together: the impact of these with e = 0.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from lagcli.simulation.closed_contacts import contact_change
from lagcli.simulation.closed_contacts.contact_change import ContactsUndecided, ImpactResult
from lagcli.simulation.closed_contacts.contact_instant import ContactInstant, Flags, Floats


class SeriesParameters:
    """Limits of series of impacts; parts are of no unit.

    The tests are of `tests/physics/test_clusters.py`.
    """

    __slots__ = ()

    alike: float = 1e-9
    """Directions of speeds, and of gaps, that differ by this part are the same: the series goes on as it did.
    `test_a_series_contracts_where_its_directions_return_to_nine_digits` fails at 1e-10 and 1e-8."""
    most: int = 10_000
    """Impacts of one series that are looked at. `test_a_series_is_followed_for_ten_thousand_impacts` fails at
    1000 and 100000."""


PARAMETERS = SeriesParameters()


def parted(here: ContactInstant, together: Flags) -> Flags:
    """Contacts that are as good as closed and part already, so that an impact of others is none of theirs, (K,): they
    were struck just before. together (K,): contacts that stayed closed so far, which drift by rounding alone."""
    return np.asarray(here.near & (here.speeds > here.slow) & ~together)


def impacts(here: ContactInstant, restitution: Floats, together: Flags) -> tuple[ImpactResult, ...]:
    """The impact of contacts that are closed, none where none approaches, and those that follow at once.

    together: see `parted`. The last one may be the limit of infinitely many. Raises `ContactsUndecided`.
    """
    away = parted(here, together)
    first = contact_change.impact(here, restitution, here.near & ~away)
    if first is None:
        return ()
    return _Series(here, restitution, first, away).followed()


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
        self._gaps = np.where(here.near & ~away, 0.0, np.maximum(here.g, 0.0))
        self._now = here.moved(first.v)
        self._afters = [_After(first.impacting, self._gaps, self._now.speeds, 0.0)]

    def followed(self) -> tuple[ImpactResult, ...]:
        """The impacts up to where all contacts part, or the next one is late enough to be found by steps."""
        while (closing := self._now.speeds < -self._now.slow).any():
            now, times = self._now, np.full(closing.size, np.inf)
            times[closing] = self._gaps[closing] / -now.speeds[closing]
            struck = closing & (times <= times.min())
            if (self._gaps > now.unresolved)[struck].all():
                break
            limit = self._limit(times)
            if limit is not None:
                return self._impacts[0], limit
            if len(self._impacts) > PARAMETERS.most:
                within = sum(after.wait for after in self._afters)
                ever = np.any([after.struck for after in self._afters], axis=0)
                raise ContactsUndecided(
                    f"{len(self._impacts)} impacts within {within:.1g} s, and no end of them",
                    np.flatnonzero(ever),
                )
            self._strike(struck, float(times.min()))
        return tuple(self._impacts)

    def _strike(self, struck: Flags, wait: float) -> None:
        """The next impact: of contacts that are struck after a time, with those that stay closed."""
        now, rests = self._now, self._now.at_rest
        following = contact_change.impact(now, self._restitution, struck | rests)
        assert following is not None, "contacts that are struck approach"
        moved = np.maximum(self._gaps + now.speeds * wait, 0.0)
        self._gaps = np.where(struck | rests, 0.0, moved)
        self._impacts.append(following)
        self._now = now.moved(following.v)
        self._afters.append(_After(struck, self._gaps, self._now.speeds, wait))

    def _limit(self, times: Floats) -> ImpactResult | None:
        """The limit of the impacts from the second on, where they go on as they did without end.

        times: after which contacts would be struck, (K,).
        """
        last = self._afters[-1]
        count = len(self._afters)
        contacts = int(np.any([after.struck for after in self._afters], axis=0).sum())
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
                return self._common(own)
        return None

    def _common(self, own: Flags) -> ImpactResult:
        """The impact after which the contacts of a series stay together, and all impacts from the second on in one."""
        now = self._now
        limit = contact_change.impact(now, np.zeros(own.size), own | now.at_rest)
        assert limit is not None, "a contact of the series approaches"
        parts = [*self._impacts[1:], limit]
        return dataclasses.replace(
            limit,
            of_equalities=np.sum([part.of_equalities for part in parts], axis=0),
            of_contacts=np.sum([part.of_contacts for part in parts], axis=0),
            v=limit.onward,
            impacting=np.zeros(own.size, dtype=bool),
            ended=np.zeros(own.size, dtype=bool),
            accumulated=own,
            shared=tuple(sorted({row for part in parts for row in part.shared})),
        )


def _part(before: Floats, after: Floats) -> float | None:
    """The part of numbers (k,) that they are later, all of them the same; None where they are not."""
    size = float(np.abs(before).max())
    if size == 0.0:
        return None if after.any() else 0.0
    part = float(np.abs(after).max()) / size
    return part if (np.abs(after - part * before) <= PARAMETERS.alike * part * size).all() else None
