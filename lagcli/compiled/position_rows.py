"""The holonomic rows of a system at one time, evaluated many times: nothing is converted but what is asked for."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli.compiled.bound_function import BoundFunction

Floats = npt.NDArray[np.float64]


class PositionRows:
    """f (s,) and the entries of B (s, n) of a function `holonomic(t, q, p)`, at one t and p.

    only: of some of the rows, in this order.
    """

    def __init__(
        self, holonomic: ca.Function, t: float, p: Floats, only: Sequence[int] | None = None
    ) -> None:
        arguments = np.array([t]), np.zeros(holonomic.size1_in(1)), np.array(p)
        self._bound = BoundFunction(holonomic, arguments, is_sparse=True)
        self._count, self._only = holonomic.size1_out(0), only
        self._rows = np.asarray(
            holonomic.sparsity_out(0).row(), dtype=np.intp
        )  # others are zero by structure
        self._pattern = holonomic.sparsity_out(1)
        if only is not None:
            every = range(self._pattern.size2())
            self._pattern, taken = self._pattern.sub(list(only), list(every))
            self._taken = np.asarray(taken, dtype=np.intp)

    def values(self, q: Floats) -> tuple[Floats, Floats]:
        """f (s,) and the entries of B at q (n,), which `matrix` puts in their places."""
        self._bound.arguments[1][:] = q
        self._bound.trigger()
        found, entries = self._bound.results
        f = np.zeros(self._count)
        f[self._rows] = found
        return (f, entries.copy()) if self._only is None else (f[self._only], entries[self._taken])

    def matrix(self, entries: Floats) -> ca.DM:
        """B (s, n), sparse."""
        return sparse_matrix(self._pattern, entries)


def sparse_matrix(pattern: ca.Sparsity, entries: Floats) -> ca.DM:
    """The sparse matrix with these entries, column by column."""
    return ca.DM(pattern, ca.DM(entries))
