"""Rows that no velocity satisfies together: a combination of them says dt = 0 (D.6)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lagcli import constraint_rows
from lagcli.constraint_rows import Rows

Floats = npt.NDArray[np.float64]

# Of rows of length one: what is left of b after the best velocity, above rounding.
APART = 1e-7


def least(rows: Rows, b: Floats) -> list[int]:
    """Rows of B v + b = 0 without a solution, of which none can be left out; empty where there is a solution.

    Of more rows than are looked at densely all that take part are given.
    """
    lengths = rows.divisors
    B, b = np.array(rows.B) / lengths[:, None], b / lengths
    scale = float(np.abs(b).max(initial=0.0)) or 1.0
    kept = [int(i) for i in np.flatnonzero(np.abs(_rest(B, b)) > APART * scale)]
    if len(kept) > constraint_rows.DENSE:
        return kept
    for i in reversed(list(kept)):
        fewer = [k for k in kept if k != i]
        if np.abs(_rest(B[fewer], b[fewer])).max(initial=0.0) > APART * scale:
            kept = fewer
    return kept


def _rest(B: Floats, b: Floats) -> Floats:
    """The part of b that no velocity takes away: a combination y of the rows with y B = 0."""
    return np.asarray(b - B @ np.linalg.lstsq(B, b, rcond=1e-10)[0]) if len(b) else b
