"""The mass metric: lengths and nearest points are taken with M, and only coordinates that are free may move.

A model of Cartesian particles has a diagonal M, and nothing of size n x n is built for it.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


class NotDefiniteError(ValueError):
    """M is not positive definite; `along` is the coordinate that shows it most, `value` the eigenvalue."""

    def __init__(self, along: int, value: float) -> None:
        super().__init__(f"eigenvalue {value:.3g}")
        self.along, self.value = along, value


class Metric:
    """M (n, n) restricted to the coordinates that are not `held` (n,). Raises `NotDefiniteError`."""

    def __init__(self, M: Any, held: Flags | None = None) -> None:
        n = M.shape[0]
        self._free = np.ones(n, dtype=bool) if held is None else ~held
        self._masses: Floats | None = None
        self._lower = np.zeros((0, 0))
        if M.sparsity().is_diag() and M.nnz() == n:
            self._masses = np.array(M.nonzeros(), dtype=float)
            worst = int(np.argmin(self._masses)) if n else 0
            if n and not self._masses[worst] > 0:
                raise NotDefiniteError(worst, float(self._masses[worst]))
            return
        whole = np.array(M)
        if not np.isfinite(whole).all():
            raise NotDefiniteError(int(np.flatnonzero(~np.isfinite(whole).all(axis=1))[0]), float("nan"))
        worst = int(np.argmin(np.diag(whole)))
        if not whole[worst, worst] > 0:
            raise NotDefiniteError(worst, float(whole[worst, worst]))
        # Scaled to a unit diagonal the answer does not depend on units; rounding leaves the smallest eigenvalue
        # of a singular M at eps.
        scale = np.sqrt(np.diag(whole))
        eigenvalues, vectors = np.linalg.eigh(whole / np.outer(scale, scale))
        if not eigenvalues[0] > n * np.finfo(float).eps:
            raise NotDefiniteError(int(np.argmax(np.abs(vectors[:, 0]))), float(eigenvalues[0]))
        self._whole = whole
        self._lower = np.linalg.cholesky(whole[np.ix_(self._free, self._free)])

    @classmethod
    def unit(cls, n: int, held: Flags | None = None) -> Metric:
        """The metric in which all coordinates weigh the same."""
        return cls(ca.DM.eye(n), held)

    def whitened(self, B: Any) -> Any:
        """B M^-1/2 (C, free), sparse: rows whose lengths and angles are those of the metric."""
        free = np.flatnonzero(self._free).tolist()
        if self._masses is not None:
            held = B if len(free) == B.shape[1] else B[:, free]
            scale = 1.0 / np.sqrt(self._masses[free])
            values = (
                np.array(held.nonzeros(), dtype=float)
                * scale[np.asarray(held.sparsity().get_col(), dtype=int)]
            )
            return ca.DM(held.sparsity(), ca.DM(values))
        return ca.DM(np.linalg.solve(self._lower, np.array(B[:, free]).T).T)

    def unwhitened(self, u: Floats) -> Floats:
        """M^-1/2 u (n,) for u (free,); zero where a coordinate is held."""
        step = np.zeros(self._free.size)
        if self._masses is not None:
            step[self._free] = u / np.sqrt(self._masses[self._free])
        else:
            step[self._free] = np.linalg.solve(self._lower.T, u)
        return step

    def length(self, step: Floats) -> float:
        """sqrt(step^T M step); infinite where that is too large for a number."""
        with np.errstate(over="ignore", invalid="ignore"):
            if self._masses is not None:
                square = float(np.sum(self._masses * step**2))
            else:
                square = float(step @ self._whole @ step)
        return float(np.sqrt(max(0.0, square)))
