"""The gaps of one-sided constraints in rows of the table."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lagcli.compiled import NumericSystem
from lagcli.equations.system import System

Floats = npt.NDArray[np.float64]


class RowGaps:
    """The gaps of a run by its rows."""

    def __init__(self, system: System, numeric: NumericSystem, p: Floats) -> None:
        self._count, self._gaps, self._p = system.contacts.count, numeric.gaps, np.asarray(p)
        places = {name: i for i, name in enumerate(system.columns, start=1)}
        self._places = [places[name] for name in system.model.coordinate_names] if self._count else []

    def deepest(self, rows: Floats) -> float:
        """The largest -g_j over rows (k, columns), t first; 0 where none is below zero."""
        if not self._count or not len(rows):
            return 0.0
        y = np.zeros((self._gaps.size1_in(1), len(rows)))
        y[: len(self._places)] = rows[:, self._places].T
        p = self._p[: self._gaps.size1_in(2)]
        g = np.array(self._gaps(rows[:, :1].T, y, np.repeat(p[:, None], len(rows), axis=1)))
        return max(0.0, float(np.nan_to_num(-g).max()))
