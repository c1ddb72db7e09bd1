"""CasADi functions that refuse arguments of another size.

CasADi itself spreads a scalar over a vector, takes an empty argument for zeros and turns a row to a column: parameters
of another system (with or without the constants of enforced integrals) would give wrong numbers without an error.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import casadi as ca


class SizedFunction(ca.Function):
    """A function of columns: each argument has as many rows as its symbol; more columns are more points.

    Raises AssertionError with the name of the function and the index of an argument of another size.
    """

    @cached_property
    def _taken(self) -> tuple[int, ...]:
        return tuple(self.size1_in(i) for i in range(self.n_in()))

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
