"""Compiled functions with fixed memory: nothing is allocated and nothing converted while stepping."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


class Call:
    """A CasADi function bound to arrays: set the `arguments`, call, read `results`.

    A matrix result has the layout of CasADi (columns after one another) and the shape of numpy; as an argument
    of another call its transpose is bound.
    """

    def __init__(self, function: Any, arguments: list[Floats]) -> None:
        self._buffer, self.trigger = function.buffer()
        self._function = function  # the buffer does not keep it alive
        self.results: list[Floats] = []
        for i, array in enumerate(arguments):
            assert array.dtype == np.float64, (function.name(), i)
            self._buffer.set_arg(i, memoryview(array.data))
        for i in range(function.n_out()):
            # A buffer holds the entries of the pattern only: of a sparse result the places would be lost.
            assert function.sparsity_out(i).is_dense(), (function.name(), i)
            shape = (function.size1_out(i), function.size2_out(i))
            array = np.zeros(shape, order="F") if shape[1] > 1 else np.zeros(shape[0])
            self._buffer.set_res(i, memoryview((array.T if array.ndim > 1 else array).data))
            self.results.append(array)

    def __call__(self) -> None:
        self.trigger()
