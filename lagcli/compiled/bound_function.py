"""Compiled functions with fixed memory: a call allocates and converts nothing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    import casadi as ca

Floats = npt.NDArray[np.float64]


class BoundFunction:
    """A CasADi function bound to arrays: set the `arguments`, `trigger`, read `results`.

    The first results may be `given`, for calls that share them; of a function with more results only `wanted`
    are written. A matrix result has the layout of CasADi (columns after one another) and the shape of numpy; as
    an argument of another call its transpose is bound. is_sparse: of every result the entries of its pattern, in a row.
    """

    def __init__(
        self,
        function: ca.Function,
        arguments: Sequence[Floats],
        given: Sequence[Floats] = (),
        wanted: int | None = None,
        is_sparse: bool = False,
    ) -> None:
        # Loaded where there is a function: this module is asked for before.
        from lagcli.smoothness.sized_function import SizedFunction

        assert isinstance(function, SizedFunction), function
        if not is_sparse:
            function = function.with_full_results
        self.function, self.arguments = function, tuple(arguments)
        self.used = 0  # for those who count their calls
        self.results: list[Floats] = []
        taken, made = function.layout
        # Of an argument that is left out CasADi makes zeros.
        assert len(self.arguments) == len(taken), (function.name(), len(self.arguments), len(taken))
        for i, array in enumerate(arguments):
            assert array.dtype == np.float64, (function.name(), i)
            assert array.size == taken[i], (function.name(), i)
        for i, (shape, entries) in enumerate(made[:wanted]):
            if is_sparse:  # a buffer holds the entries of the pattern only
                shape = (entries, 1)
            array = given[i] if i < len(given) else np.zeros(shape if shape[1] > 1 else shape[0], order="F")
            assert array.size == shape[0] * shape[1], (function.name(), i)
            self.results.append(array)

    @cached_property
    def trigger(self) -> Callable[[], None]:
        """Make the results of the arguments as they are now; whoever has another way to make them may set it."""
        # Of the arrays that a buffer reads and writes CasADi's own types know the addresses only.
        buffer, trigger = cast("tuple[Any, Callable[[], None]]", self.function.buffer())
        for i, array in enumerate(self.arguments):
            buffer.set_arg(i, array.data)
        for i, array in enumerate(self.results):
            buffer.set_res(i, (array.T if array.ndim > 1 else array).data)
        self._buffer = buffer  # which lives as long
        return trigger


def cells(array: Floats) -> memoryview[float]:
    """The numbers of an array (k,), read and written as plain floats without numpy's conversion."""
    return cast("memoryview[float]", memoryview(array.data))


class PositionRows:
    """f (s,) and the entries of B (s, n) of `holonomic(t, q, p)`, at one t and p. only: of these rows."""

    def __init__(
        self, holonomic: ca.Function, t: float, p: Floats, only: Sequence[int] | None = None
    ) -> None:
        arguments = np.array([t]), np.zeros(holonomic.size1_in(1)), np.array(p)
        self._bound = BoundFunction(holonomic, arguments, is_sparse=True)
        self._count, self._only = holonomic.size1_out(0), only
        # Others are zero by structure.
        self._rows = np.asarray(holonomic.sparsity_out(0).row(), dtype=np.intp)
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
    import casadi as ca  # here: this module is asked for where there is no function yet

    return ca.DM(pattern, ca.DM(entries))
