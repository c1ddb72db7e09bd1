"""The mass metric: lengths and nearest points are taken with M, and only coordinates that are free may move. M has a
block for each set of coupled coordinates; nothing of size n x n is built."""

from __future__ import annotations

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.arrays import Flags, Floats

Indices = npt.NDArray[np.intp]

# M is clearly definite where its smallest eigenvalue is this many times what rounding may leave of a singular one.
CLEARLY = 10.0


class NotDefiniteError(ValueError):
    """M is not positive definite; `along` is the coordinate that shows it most, `value` the eigenvalue."""

    def __init__(self, along: int, value: float) -> None:
        super().__init__(f"eigenvalue {value:.3g}")
        self.along, self.value = along, value


class Metric:
    """M (n, n) restricted to the coordinates that are not `fixed` (n,). Raises `NotDefiniteError`."""

    def __init__(self, M: ca.DM, fixed: Flags | None = None) -> None:
        n = M.shape[0]
        self._M = M
        self._free = np.ones(n, dtype=bool) if fixed is None else ~fixed
        pattern = M.sparsity()
        is_plain = pattern.is_diag()
        whole = is_plain and pattern.nnz() == n
        diagonal = np.array(M.nonzeros() if whole else ca.diag(M), dtype=float).ravel()
        if not is_plain:
            values = np.array(M.nonzeros(), dtype=float)
            if not np.isfinite(values).all():
                rows = np.asarray(M.sparsity().row(), dtype=np.intp)
                raise NotDefiniteError(int(rows[~np.isfinite(values)].min()), float("nan"))
        worst = int(np.argmin(diagonal)) if n else 0
        if n and not diagonal[worst] > 0:
            raise NotDefiniteError(worst, float(diagonal[worst]))
        # Where each free coordinate stands among them, and the lengths of those that are coupled to no other.
        self._index = np.cumsum(self._free) - 1
        self._lengths = np.sqrt(diagonal)
        self._blocks = [] if is_plain else _blocks(M, self._free, self._index)

    @classmethod
    def unit(cls, n: int, fixed: Flags | None = None) -> Metric:
        """The metric in which all coordinates weigh the same."""
        return cls(ca.DM.eye(n), fixed)

    def plain(self) -> Metric:
        """The unit metric over the coordinates that may move here."""
        return Metric.unit(self._free.size, ~self._free)

    def whitened(self, B: ca.DM) -> ca.DM:
        """B M^-1/2 (C, free), sparse: rows whose lengths and angles are those of the metric."""
        free = np.flatnonzero(self._free)
        fixed = B if free.size == B.shape[1] else B[:, free.tolist()]
        columns = np.asarray(fixed.sparsity().get_col(), dtype=np.intp)
        values = np.array(fixed.nonzeros(), dtype=float)
        scale = 1.0 / self._lengths[free]
        if not self._blocks:
            with np.errstate(over="ignore"):  # rows are asked for their lengths
                return ca.DM(fixed.sparsity(), ca.DM(values * scale[columns]))
        rows = np.asarray(fixed.sparsity().row(), dtype=np.intp)
        # Where coordinates are coupled entries of a block fill it in the rows that touch it.
        number = np.full(scale.size, -1)
        for i, (indices, _) in enumerate(self._blocks):
            number[indices] = i
        of = number[columns]
        order = np.argsort(of, kind="stable")
        ends = np.searchsorted(of[order], np.arange(len(self._blocks) + 1))
        alone = order[: ends[0]]
        parts = [(rows[alone], columns[alone], values[alone] * scale[columns[alone]])]
        for (indices, lower), first, end in zip(self._blocks, ends, ends[1:], strict=False):
            here, size = order[first:end], indices.size
            touched, at = np.unique(rows[here], return_inverse=True)
            dense = np.zeros((touched.size, size))
            dense[at, np.searchsorted(indices, columns[here])] = values[here]
            turned = np.linalg.solve(lower, dense.T).T
            parts.append((np.repeat(touched, size), np.tile(indices, touched.size), turned.ravel()))
        row, column, value = (np.concatenate(each) for each in zip(*parts, strict=True))
        return ca.DM.triplet(row.tolist(), column.tolist(), ca.DM(value), *fixed.shape)

    def unwhitened(self, u: Floats) -> Floats:
        """M^-1/2 u (n,) for u (free,); zero where a coordinate is fixed."""
        moved = u / self._lengths[self._free]
        for indices, lower in self._blocks:
            moved[indices] = np.linalg.solve(lower.T, u[indices])
        step = np.zeros(self._free.size)
        step[self._free] = moved
        return step

    def solved(self, force: Floats) -> Floats:
        """M^-1 force (n,) on the free coordinates; zero where one is fixed."""
        free = force[self._free]
        moved = free / self._lengths[self._free] ** 2
        for indices, lower in self._blocks:
            moved[indices] = np.linalg.solve(lower.T, np.linalg.solve(lower, free[indices]))
        found = np.zeros(self._free.size)
        found[self._free] = moved
        return found

    def length(self, step: Floats) -> float:
        """sqrt(step^T M step); infinite where that is too large for a number."""
        with np.errstate(over="ignore", invalid="ignore"):
            if self._M.sparsity().is_diag():
                square = float(np.sum((self._lengths * step) ** 2))
            else:
                square = float(step @ np.array(ca.mtimes(self._M, ca.DM(step))).ravel())
        return float(np.sqrt(max(0.0, square)))


def _blocks(M: ca.DM, free: Flags, index: Indices) -> list[tuple[Indices, Floats]]:
    """Free coordinates that are coupled, set by set, by their indices (k,), and the lower factor of M over them (k, k).
    Raises `NotDefiniteError` for the set that shows it most."""
    count, order, ends = M.sparsity().scc()
    found: list[tuple[Indices, Floats]] = []
    worst: NotDefiniteError | None = None
    for i in range(count):
        if ends[i + 1] - ends[i] == 1:
            continue
        among = np.sort(np.asarray(order[ends[i] : ends[i + 1]], dtype=np.intp))
        whole = np.array(M[among.tolist(), among.tolist()])
        # Scaled to a unit diagonal the answer does not depend on units; rounding leaves the smallest eigenvalue of a
        # singular M at eps. A factorization is far cheaper than eigenvalues, and all that a clearly definite M asks.
        scale = np.sqrt(np.diag(whole))
        scaled = whole / np.outer(scale, scale)
        least = M.shape[0] * doubles.EPS
        try:
            np.linalg.cholesky(scaled - CLEARLY * least * np.eye(len(scaled)))
        except np.linalg.LinAlgError:
            eigenvalues, vectors = np.linalg.eigh(scaled)
            if not eigenvalues[0] > least:
                error = NotDefiniteError(int(among[np.argmax(np.abs(vectors[:, 0]))]), float(eigenvalues[0]))
                worst = error if worst is None or error.value < worst.value else worst
                continue
        independent = free[among]
        if independent.any():
            lower = np.asarray(np.linalg.cholesky(whole[np.ix_(independent, independent)]), dtype=float)
            found.append((index[among[independent]], lower))
    if worst is not None:
        raise worst
    return found
