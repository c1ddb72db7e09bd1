"""Impacts of a contact that crowd: so many in so small a part of a run that it would have no end.

A ball between a heavy body and a wall is struck ever faster, and ever more slowly once the heavy body has turned; a
piston that closes in on it never turns. In both the intervals are 1/u^2 of a number of the impact with u'' = -k^2 u: on
a billiard table that is unfolded the ball goes along a straight line, and impacts lie at equal angles (G. Galperin,
Playing pool with pi, 2003). Impacts at one pace, and on a parabola of times, are those with k = 0.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Iterable, Sequence

import numpy as np

from lagcli import doubles
from lagcli.simulation.closed_contacts.contact_instant import Flags, Floats
from lagcli.simulation.closed_contacts.impact_series import ClosedBefore
from lagcli.simulation.run_state import run_stop
from lagcli.simulation.run_state.run_stop import StepFailure
from lagcli.simulation.stepping.stepper import Stepper

# A contact, its impacts since the last of at most four times, the time of the last one, and the times.
Crowd = tuple[int, int, float, tuple[float, ...]]


class CrowdParameters:
    """The impacts that a run may have.

    The tests are of `tests/unit/test_numbers_of_contacts.py`.
    """

    __slots__ = ()

    many: int = 1_000
    """Impacts of a contact between two times: an impact costs what a few steps do, those between four times some
    seconds. `test_three_thousand_impacts_of_a_contact_may_crowd`."""
    most: int = 1_000_000
    """Impacts of one contact that may be to come, some minutes.
    `test_a_million_impacts_of_a_contact_may_be_to_come`."""


PARAMETERS = CrowdParameters()
# An elastic contact has no last rebound; of others it is lost in rounding after so many times 1/(1 - e).
LAST = -math.log(doubles.EPS)


def between(restitution: float) -> int:
    """The impacts of a contact between two of the four times by which it is asked how many are to come."""
    own = LAST / 3 / (1.0 - restitution) if restitution < 1.0 else math.inf
    return max(PARAMETERS.many, int(own)) if own <= PARAMETERS.most else PARAMETERS.many


def to_come(times: Sequence[float], count: int, end: float) -> float:
    """The impacts up to an end, after four times with so many between each two, if they go on as they did; infinite
    where they would be more than may be.

    As fast as they are now, or with u at the times: D_i = S/(u_i u_i+1) are the times between, and u_i+1 + u_i-1 =
    2 c u_i, so that c^2 = (D_1 + D_2)(D_2 + D_3)/(4 D_1 D_3).
    """
    most, (first, second, third) = PARAMETERS.most / count, (b - a for a, b in itertools.pairwise(times))
    if third > 0 and (end - times[-1]) / third <= most:
        return count * (end - times[-1]) / third
    if not min(first, second, third) > 0:
        return math.inf
    c = math.sqrt((first + second) * (second + third) / (4 * first * third))
    u = (1 + first / second) / (2 * c)
    total, before, now, t = first * u, first / second, u * second / third, times[-1]
    for windows in range(int(most)):
        before, now = now, 2 * c * now - before
        if now <= 0 or t >= end:
            return float(windows * count)
        t += total / (before * now)
    return math.inf


def counted(
    crowds: tuple[Crowd, ...], struck: Iterable[int], restitution: Sequence[float], t: float
) -> tuple[Crowd, ...]:
    """The crowds with one impact more at time t of each contact that is struck."""
    found = {crowd[0]: crowd for crowd in crowds}
    for j in struck:
        _, count, _, times = found.get(j, (j, 0, t, ()))
        is_next = not times or count + 1 >= between(restitution[j])
        found[j] = (j, 0, t, (*times[-3:], t)) if is_next else (j, count + 1, t, times)
    return tuple(found[j] for j in sorted(found))


def before(run: Stepper, pressed: Iterable[int], contacts: int) -> ClosedBefore:
    """The contacts, so many, of a run before an impact; pressed: those that press, or lie on them."""
    presses, touching, bouncing = np.zeros((3, contacts), dtype=bool)
    presses[list(pressed)], touching[list(run.contacts.touching)] = True, True
    bouncing[list(run.contacts.apart)] = True
    last = np.full(contacts, np.nan)
    late = run.t - (run.grid.end - run.grid.start) * PARAMETERS.many / PARAMETERS.most
    for j, _, t, _ in run.contacts.crowds:
        last[j] = t if t >= late else np.nan
    return ClosedBefore(presses, touching & ~bouncing, bouncing, last)


def count(run: Stepper, impacts: list[Flags], restitution: Floats, names: Sequence[str]) -> None:
    """Count impacts where the run stands, of contacts (K,) each. Raises `StepFailure` where they would have no end."""
    crowds, e = run.contacts.crowds, restitution.tolist()
    for struck in impacts:
        crowds = counted(crowds, np.flatnonzero(struck).tolist(), e, run.t)
    run.contacts = dataclasses.replace(run.contacts, crowds=crowds)
    for j, since, t, times in crowds:
        if since or t < run.t or len(times) < 4:
            continue
        number = between(e[j])
        if to_come(times, number, run.grid.end) > PARAMETERS.most:
            named = (f"`{names[i]}`" for i, _, _, own in crowds if i == j or own[1:2] >= times[:1])
            raise StepFailure(
                f"impacts crowd without end, {3 * number} within {run.t - times[0]:.2g} of time, of {', '.join(named)}:"
                " they lose next to nothing between walls that close in, or on a contact that is met too slowly to tell"
                " it from rest (with a `restitution` below 1 they end; on a contact that is only touched begin with"
                " dg/dt = 0)",
                run_stop.CONTACT,
            )
