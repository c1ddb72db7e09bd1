"""Impacts of a contact that crowd: so many in so small a part of a run that it would have no end."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

# A contact, its impacts since a time, that time, and the time of the last one.
Crowd = tuple[int, int, float, float]


class CrowdParameters:
    """The impacts that a run may have.

    The tests are of `tests/unit/test_numbers_of_contacts.py`.
    """

    __slots__ = ()

    count: int = 10_000
    """Impacts of a contact that may crowd: an impact costs what a few steps do, these some seconds.
    `test_ten_thousand_impacts_of_a_contact_may_crowd` fails at 1000 and 100000."""
    most: int = 1_000_000
    """Impacts of one contact at this pace in a whole run, some minutes, are no crowd.
    `test_a_million_impacts_of_a_contact_in_a_run_are_no_crowd` fails at 100000 and 10000000."""


PARAMETERS = CrowdParameters()
# An elastic contact has no last rebound; of others it is lost in rounding after so many times 1/(1 - e).
LAST = -math.log(2.0**-52)


def most(restitution: float) -> int:
    """The impacts of a contact after which it is asked how long they took."""
    own = LAST / (1.0 - restitution) if restitution < 1.0 else math.inf
    return max(PARAMETERS.count, int(own)) if own <= PARAMETERS.most else PARAMETERS.count


def counted(
    crowds: tuple[Crowd, ...], struck: Iterable[int], restitution: Sequence[float], at: tuple[float, float]
) -> tuple[Crowd, ...]:
    """The crowds with one impact more of each contact that is struck; at: the time, and the duration of the run.

    A contact is counted anew once so many impacts would not be too many for the run.
    """
    t, duration = at
    allowed = duration / PARAMETERS.most
    counts = {
        j: (count, since) for j, count, since, _ in crowds if t - since <= allowed * most(restitution[j])
    }
    last = {crowd[0]: crowd[3] for crowd in crowds}
    for j in struck:
        count, since = counts.get(j, (0, t))
        counts[j], last[j] = (count + 1, since), t
    return tuple((j, count, since, last[j]) for j, (count, since) in sorted(counts.items()))
