"""CasADi functions that refuse arguments of another size. CasADi itself spreads a scalar over a vector and takes an
empty argument for zeros: parameters of another system would give wrong numbers without an error."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import casadi as ca


class SizedFunction(ca.Function):
    """A function of columns: each argument has as many rows as its symbol, or it raises AssertionError with the name of
    the function and the index of the argument; more columns are more points."""

    @cached_property
    def _taken(self) -> tuple[int, ...]:
        return tuple(self.size1_in(i) for i in range(self.n_in()))

    @cached_property
    def layout(self) -> tuple[tuple[int, ...], tuple[tuple[tuple[int, int], int], ...]]:
        """The entries of each argument; shape and entries of each result."""
        made = tuple((self.size_out(i), self.nnz_out(i)) for i in range(self.n_out()))
        return tuple(self.nnz_in(i) for i in range(self.n_in())), made

    @property
    def with_full_results(self) -> SizedFunction:
        """The function with all entries of each result: what is zero by structure, as the multiplier of an open contact
        is, differs from mode to mode, and the size of a result must not."""
        is_full = all(shape[0] * shape[1] == entries for shape, entries in self.layout[1])
        # A function that kept itself would be freed by a collection alone.
        return self if is_full else self._filled

    @cached_property
    def _filled(self) -> SizedFunction:
        inputs = self.mx_in()
        return SizedFunction(self.name(), inputs, [ca.densify(result) for result in self.call(inputs)])

    if not TYPE_CHECKING:  # the types of a call are those of CasADi

        def __call__(self, *arguments: object) -> object:
            """The results for arguments by position: numbers, arrays or expressions."""
            for i, (given, rows) in enumerate(zip(arguments, self._taken, strict=True)):
                shape = getattr(given, "shape", None)
                if shape is None and isinstance(given, list | tuple):
                    shape = (len(given),)
                if (shape[0] if shape else 1) != rows:  # a plain number has no shape
                    raise AssertionError(self.name(), i, shape, rows)
            return super().__call__(*arguments)
