"""Contacts at one instant: impacts, and those that press (theory of one-sided constraints)."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from lagcli.contact import impact_law
from lagcli.simulation.contact_instant import WEIGHTLESS, ContactInstant

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Blow:
    """An impact: the velocities after it (n,), impulses of the equality rows that are kept and of the contacts (K,).

    struck: contacts that approached, or take an impulse; ended: contacts whose rebounds end here, with the time that
    those left out would have taken, (K,) each.
    """

    v: Floats
    of_equalities: Floats
    of_contacts: Floats
    struck: Flags
    ended: Flags
    lasting: Floats


def impact(here: ContactInstant, restitution: Floats) -> Blow | None:
    """The impact of all contacts that are closed; None where none approaches.

    Rebounds that cannot be resolved, of contacts that are pressed, are left out: their series ends.
    Raises `impact_law.LawError`.
    """
    if not (here.near & (here.speeds < -here.slow)).any():
        return None
    e = restitution.copy()
    lasting, ended = np.zeros(e.size), np.zeros(e.size, dtype=bool)
    near = np.flatnonzero(here.near)
    found = _law(here, near, e)
    # Each turn ends the series of some contact, so that there are few.
    for _ in range(near.size):
        after = here.moved(found.x)
        small = _unresolved(after, near, e)
        if not small.size:
            break
        lasting[small] = 2 * after.speeds[small] / (_pressed(after)[small] * (1 - e[small]))
        e[small], ended[small] = 0.0, True
        found = _law(here, near, e)
    impulses = np.zeros(e.size)
    impulses[near] = found.of_contacts
    struck = here.near & ((here.speeds < -here.slow) | (impulses > 0))
    return Blow(found.x, found.of_equalities, impulses, struck, ended, lasting)


def _unresolved(after: ContactInstant, near: npt.NDArray[np.intp], e: Floats) -> npt.NDArray[np.intp]:
    """Contacts that rebound and are pressed so that they rise no higher than rounding."""
    speeds, bouncing = after.speeds[near], near[(after.speeds[near] > 0) & (e[near] > 0) & (e[near] < 1)]
    if not bouncing.size or not (speeds > 0).any():
        return bouncing[:0]
    pull = _pressed(after)[bouncing]
    with np.errstate(divide="ignore", invalid="ignore"):
        height = after.speeds[bouncing] ** 2 / (2 * pull)
    return bouncing[(pull > 0) & (height <= after.lowest[bouncing])]


def _pressed(after: ContactInstant) -> Floats:
    """-d2g/dt2 (K,) of all contacts with those closed that neither approach nor part."""
    return -pressing(after, after.near & (np.abs(after.speeds) <= after.slow)).accelerations


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Pressing:
    """Multipliers and d2g/dt2 of all contacts (K,), of which some are closed; closed: those that press."""

    multipliers: Floats
    accelerations: Floats
    closed: tuple[int, ...]


def pressing(here: ContactInstant, among: Flags) -> Pressing:
    """The forces of contacts that are closed and neither approach nor part: 0 <= lambda ⊥ d2g/dt2 >= 0."""
    numbers = np.flatnonzero(among)
    B, _, gamma = here.equalities
    contacts = here.G.B[numbers.tolist(), :], here.gamma[numbers]
    with _told_of(numbers):
        found = impact_law.forces(here.metric, here.force, (B.B, gamma), contacts)
    multipliers = np.zeros(here.g.size)
    multipliers[numbers] = found.of_contacts
    accelerations = here.G.times(found.x) - here.gamma
    lengths = here.lengths[numbers]
    scale = here.pull[numbers] / np.where(lengths > 0, lengths**2, 1.0)
    presses = found.of_contacts > WEIGHTLESS * scale
    return Pressing(multipliers, accelerations, tuple(numbers[presses].tolist()))


def _law(here: ContactInstant, near: npt.NDArray[np.intp], e: Floats) -> impact_law.LawResult:
    B, b, _ = here.equalities
    contacts = here.G.B[near.tolist(), :], here.g_t[near], e[near]
    with _told_of(near):
        return impact_law.impact(here.metric, here.state.v, (B.B, b), contacts)


@contextlib.contextmanager
def _told_of(numbers: npt.NDArray[np.intp]) -> Iterator[None]:
    """The law told of these contacts alone; its errors name contacts by their numbers among all."""
    try:
        yield
    except impact_law.LawError as error:
        error.contacts = tuple(int(numbers[place]) for place in error.contacts)
        raise
