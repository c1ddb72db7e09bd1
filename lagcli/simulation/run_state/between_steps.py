"""The state of a run between two steps: what it takes to go on bit for bit, and what has been handed out.

A new piece of it is defined here once: a checkpoint saves and checks every field by its type.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from lagcli.arrays import Floats
from lagcli.compiled.selection import Selection
from lagcli.equations.system import System
from lagcli.simulation.run_state.statistics import NO_ROWS, Counts, Extremes
from lagcli.simulation.scheme.invariants import InvariantValues


@dataclasses.dataclass(frozen=True, slots=True)
class ContactState:
    """The contacts of a run between two steps.

    touching: closed, and do not press; apart: those of them with gaps above zero; unarmed: numbers of rows, and of
    declared events after all rows, whose watched function has just crossed zero; last: time of the last incident;
    again: changes without a step between them; size: the largest size of the motion at incidents; ending: contacts
    whose rebounds end ahead, with the time; postponed: declared events that these bring about, likewise; deepest: the
    largest -g_j so far; shared: rows whose multipliers or impulses were not unique; crowds: contacts that were struck
    of late, see `run_contacts.Crowd`.
    """

    touching: tuple[int, ...] = ()
    apart: tuple[int, ...] = ()
    unarmed: tuple[int, ...] = ()
    last: float = 0.0
    again: int = 0
    size: float = 0.0
    ending: tuple[tuple[int, float], ...] = ()
    postponed: tuple[tuple[int, float], ...] = ()
    deepest: float = 0.0
    shared: tuple[int, ...] = ()
    crowds: tuple[tuple[int, int, float, tuple[float, ...]], ...] = ()

    def crowd(self, since: float) -> bool:
        """True where steps end at impacts that have a budget of their own: so many of one contact since a time."""
        return any(times[-1] >= since for _, _, _, times in self.crowds if len(times) > 1)


NOTHING = ContactState()


@dataclasses.dataclass(slots=True, eq=False, kw_only=True)
class RunState(Counts):
    """A run between two steps, what it has counted, and what it has handed out.

    t, y (2n + 1,), k = y'(t, y), step: the state, and the step proposed from it; pace_from: time of the last look at
    the pace; row: time of the last row handed out, on either side of t; extremes: of all rows handed out; selection:
    the rows it is stepped with; invariant_values: how each integral is enforced; watch: what the next singular
    configuration is predicted from; turns: where angles with a cut were; is_blurred: whether steps look at the rounding
    of rows and forces, None where that is to be seen. Times are counted from `origin`, but for those of crossings and
    incidents.
    """

    t: float
    y: Floats
    k: Floats
    step: float
    pace_from: float
    row: float = -math.inf
    extremes: Extremes = NO_ROWS
    selection: Selection
    invariant_values: InvariantValues = ()
    watch: tuple[float, ...] = ()
    origin: float
    turns: tuple[float, ...] = ()
    contacts: ContactState = NOTHING
    is_blurred: bool | None = None


class Turns:
    """The value of each angle, counted through all turns: entries of p that a run sets after each step."""

    def __init__(self, system: System) -> None:
        self._system, self._cuts = system, system.cuts
        self.is_any = self._cuts is not None

    def of(self, p: Floats) -> tuple[float, ...]:
        """The references in p."""
        return tuple(p[self._cuts.first :].tolist()) if self._cuts else ()

    def resume(self, p: Floats, references: tuple[float, ...]) -> None:
        """Set p as it was where a run was marked."""
        if self._cuts:
            p[self._cuts.first :] = references

    def settle(self, t: float, q: Floats, p: Floats, notes: tuple[str, ...] = ()) -> tuple[str, ...]:
        """Set p for the next step from t, q (n,); the notes with one on each row of which an angle crosses its cut
        first."""
        cuts = self._cuts
        if cuts is None:
            return notes
        before = np.abs(p[cuts.first :])
        here = cuts.counted(t, q, p)
        p[cuts.first :] = here
        half = cuts.periods / 2
        crossed = np.flatnonzero((np.abs(here) > half) & (before <= half)).tolist()
        for row in sorted({row for j in crossed for row in cuts.passed(j)}):
            name = self._system.rows.rows[row].name
            smooth = f"the row `{name}` goes on smoothly where an angle in it crosses its cut: its turns are counted"
            if not any(note.endswith(smooth) for note in notes):
                notes = (*notes, f"from t = {t:.9g} {smooth}")
        return notes
