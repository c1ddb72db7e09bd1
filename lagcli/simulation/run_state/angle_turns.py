"""The turns of angles from `atan2` and `atan` in holonomic rows, counted while a run goes on (see `mechanics.cuts`)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lagcli.equations.system import System

Floats = npt.NDArray[np.float64]


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
        first, in the run or before it was resumed."""
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
