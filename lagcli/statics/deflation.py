"""Equations from which known zeros are taken out (Farrell, Birkisson and Funke, SIAM J. Sci. Comput. 37 (2015) A2026).

The residual is multiplied by prod (1 + 1/d_i^2), d_i the distance of q to a known point: it is zero there no more.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lagcli.statics.rest_equations import RestEquations

Floats = npt.NDArray[np.float64]

# Distances below this, as parts of the size of things, are not divided by; and points that are taken out, the latest:
# each costs a gradient at every step.
LEAST, MOST_KNOWN = 1e-8, 60


class DeflatedEquations:
    """The residual of some equations without the zeros at `known` configurations; angles count by their sines."""

    def __init__(self, equations: RestEquations, known: Sequence[Floats], angles: Sequence[bool]) -> None:
        self._equations, self._known = equations, list(known)[-MOST_KNOWN:]
        self._angles = np.array(angles, dtype=bool)

    def __call__(self, x: Floats) -> tuple[Floats, Floats] | None:
        """Residual and gradient."""
        found = self._equations(x)
        if found is None:
            return None
        r, J = found
        n, size = self._equations.problem.n, self._equations.scales.length
        factor, slope = 1.0, np.zeros(x.size)
        for q in self._known:
            way = (x[:n] - q) / size
            along = way / size
            half = (x[:n] - q)[self._angles] / 2
            way[self._angles], along[self._angles] = 2 * np.sin(half), np.sin(2 * half)
            square = max(float(way @ way), LEAST**2)
            factor *= 1 + 1 / square
            slope[:n] += -2 * along / square**2 / (1 + 1 / square)
        if not np.isfinite(factor):
            return None
        return factor * r, factor * (J + np.outer(r, slope))
