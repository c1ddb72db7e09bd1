"""Impacts of a contact that crowd: so many in so small a part of a run that it would have no end."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Sequence

import numpy as np

from lagcli.simulation.closed_contacts.contact_instant import Flags, Floats
from lagcli.simulation.run_state import run_stop
from lagcli.simulation.run_state.run_stop import StepFailure
from lagcli.simulation.stepping.stepper import Stepper

# A contact, its impacts since a time, that time, and the time of the last one.
Crowd = tuple[int, int, float, float]


class CrowdParameters:
    """The impacts that a run may have.

    The tests are of `tests/unit/test_numbers_of_contacts.py`.
    """

    __slots__ = ()

    many: int = 10_000
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
    return max(PARAMETERS.many, int(own)) if own <= PARAMETERS.most else PARAMETERS.many


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


def last(run: Stepper, contacts: int) -> Floats:
    """Times (K,) at which the contacts of a run were struck of late, or nan."""
    times = np.full(contacts, np.nan)
    for j, _, _, t in run.contacts.crowds:
        times[j] = t
    return times


def count(run: Stepper, impacts: list[Flags], restitution: Floats, names: Sequence[str]) -> None:
    """Count impacts where the run stands, of contacts (K,) each. Raises `StepFailure` where they would have no end."""
    crowds = run.contacts.crowds
    at = run.t, run.grid.end - run.grid.start
    for struck in impacts:
        crowds = counted(crowds, np.flatnonzero(struck).tolist(), restitution.tolist(), at)
    run.contacts = dataclasses.replace(run.contacts, crowds=crowds)
    full = [each for each in crowds if each[1] >= most(restitution[each[0]])]
    if full:
        _, number, since, _ = full[0]
        named = (f"{own} of `{names[j]}`" for j, own, *_ in crowds if 2 * own > number)
        raise StepFailure(
            f"impacts crowd without end, within {run.t - since:.2g} of time {', '.join(named)}: they lose next to"
            " nothing between walls that close in, or on a contact that is met too slowly to tell it from rest"
            " (with a `restitution` below 1 they end; on a contact that is only touched begin with dg/dt = 0)",
            run_stop.CONTACT,
        )
