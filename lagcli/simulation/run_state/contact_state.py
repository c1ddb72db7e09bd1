"""The state of one-sided constraints and declared events between two steps of a run."""

from __future__ import annotations

import dataclasses


@dataclasses.dataclass(frozen=True, slots=True)
class ContactState:
    """touching: contacts that are closed and do not press; unarmed: numbers of rows, and of declared events after all
    rows, of which the function that is watched has just crossed zero; last: time of the last incident, counted as the
    state; again: changes without a step between them; size: the largest size of the motion at incidents; ending:
    contacts whose rebounds end at a time ahead, with the time; deepest: the largest -g_j so far; shared: rows whose
    multipliers or impulses were not unique at some time."""

    touching: tuple[int, ...] = ()
    unarmed: tuple[int, ...] = ()
    last: float = 0.0
    again: int = 0
    size: float = 0.0
    ending: tuple[tuple[int, float], ...] = ()
    deepest: float = 0.0
    shared: tuple[int, ...] = ()


NOTHING = ContactState()
