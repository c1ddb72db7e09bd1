"""A point with its ranks and the brackets of two fields, in doubles.

Where these brackets are certainly as many as there are rows, no longer ones are to be looked for.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property

import numpy as np
import numpy.typing as npt

from lagcli.analysis.numeric_flag import term_sizes
from lagcli.analysis.numeric_flag.point_ranks import Ranks
from lagcli.compiled import program
from lagcli.compiled.row_block import RowBlock

Floats = npt.NDArray[np.float64]

# Relative to their size they are certainly not zero from here on.
CERTAIN = 1e-6
# A value that vanishes on the orbit is less than this many times its size and how far the point is off.
OFF = 100.0
# So many pairs of fields show the sizes of terms.
LOOKED_AT = 3
SEED = 20062


class EvaluationPoint(Ranks):
    """The rows at one point, and their brackets of two random fields.

    error: how far the point may lie off the orbit of the start, in parts of the way to it.
    """

    def __init__(self, block: RowBlock, x: Floats, p: Floats, error: float = 0.0) -> None:
        super().__init__(block, x, p)
        self.error = error

    @property
    def first(self) -> int:
        """The rank of these brackets, the certain part of it."""
        return int((self.turning > max(CERTAIN, OFF * self.error)).sum())

    @cached_property
    def turning(self) -> Floats:
        """Singular values of the brackets on the independent rows, relative to the size of what they are made of."""
        kept = self.kept
        if not kept or self.dimension < 2:
            return np.zeros(0)
        random = np.random.default_rng(SEED)
        free = random.standard_normal((2 * len(kept) + 2, self.block.size))
        held = np.array([self.in_kernel(u) for u in free]) * self.sizes
        pairs = [(a, b) for i, a in enumerate(held) for b in held[:i]]
        values, size = self._of(self.block.curl, pairs)[kept], self.terms[kept]
        with np.errstate(invalid="ignore"):  # looked for in the next line
            values = values / np.where(size > 0, size, 1.0)[:, None]
        if not np.isfinite(values).all():
            return np.zeros(0)
        return np.asarray(np.linalg.svd(values, compute_uv=False)) / math.sqrt(values.shape[1])

    @cached_property
    def terms(self) -> Floats:
        """The sizes (m,) of what d omega_i of fields of this size is made of, for the differential rows."""
        curl, random = program.written_out(self.block.curl), np.random.default_rng(SEED)
        fields = random.standard_normal((LOOKED_AT, 2, self.block.size)) * self.sizes
        sizes = [term_sizes.of(curl, [self.x, self.p, Y, Z]) for Y, Z in fields]
        return np.asarray(np.max(sizes, axis=0))

    def _of(self, function: Callable[..., object], pairs: list[tuple[Floats, Floats]]) -> Floats:
        """A function (x, p, Y, Z) -> (m,) of pairs of fields, (m, pairs)."""
        return np.array([np.array(function(self.x, self.p, *pair)).ravel() for pair in pairs]).T
