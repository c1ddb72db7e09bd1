"""A look ahead from an instant of contacts: which of those that are closed stay so where some of them are held."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from lagcli.linear.metric_rows import stacked
from lagcli.simulation.closed_contacts.contact_instant import ContactInstant, Flags, Floats
from lagcli.start.initial import State

# How far ahead is looked, as a part of the size of the motion; Newton's steps back onto the rows that are held.
FAR, STEPS = 1e-3, 5
# Of the way ahead, what a gap may be off that stays closed. One that opens like a square is off by FAR of it.
CLOSED = 1e-8
# Directions of rows that are this small are rounding.
NO_DIRECTION = 1e-8


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class GapsAhead:
    """Contacts (K,) that stay closed, and those that are violated, a little later; others open."""

    stays: Flags
    is_violated: Flags


def gaps(here: ContactInstant, x: Floats, held: Sequence[int]) -> GapsAhead:
    """Gaps a little later, on the way with accelerations x (n,), with the contacts `held` closed.

    Where nothing moves, or where nothing has a value ahead, all are said to stay.
    """
    everything = np.ones(here.g.size, dtype=bool)
    tau, way = here.reach(x, FAR)
    there = _held(here, here.later(tau, x), list(held)) if way > 0 else None
    if there is None:
        return GapsAhead(everything, ~everything)
    g = here.at(there).g
    allowed = np.maximum(CLOSED * here.gap_changes(way), here.noise)
    return GapsAhead(np.abs(g) <= allowed, g < -allowed)


def _held(here: ContactInstant, state: State, contacts: list[int]) -> State | None:
    """The state moved onto the equality rows of whole coordinates and these contacts; None where there is none."""
    for _ in range(STEPS):
        place = here.at(state)
        f, B = place.whole
        off = np.concatenate([f, place.g[contacts]])
        A = np.array(here.metric.whitened(stacked(B, place.gradients(np.array(contacts, dtype=np.intp)))))
        if not (np.isfinite(off).all() and np.isfinite(A).all()):
            return None
        back = np.linalg.lstsq(A, -off, rcond=NO_DIRECTION)[0]
        state = dataclasses.replace(state, q=state.q + here.metric.unwhitened(back))
    return state
