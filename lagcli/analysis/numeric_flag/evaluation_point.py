"""A point with its ranks and the brackets of two fields, in doubles.

Where these brackets are certainly as many as there are rows, no longer ones are to be looked for.
"""

from __future__ import annotations

import decimal
import math
from decimal import Decimal
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from lagcli.analysis.numeric_flag import multiprecision
from lagcli.analysis.numeric_flag.point_ranks import Ranks
from lagcli.compiled import program
from lagcli.compiled.row_block import RowBlock

Floats = npt.NDArray[np.float64]

# Relative to their size they are certainly not zero from here on.
CERTAIN = 1e-6
# A value that vanishes on the orbit is less than this many times its size and how far the point is off.
OFF = 100.0
# So many pairs are looked at in so many digits.
LOOKED_AT, FEWER = 3, 30
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
        loose = free * self.sizes
        size = self._of(self.block.sizes, [(a, b) for i, a in enumerate(loose) for b in loose[:i]])
        values = self._of(self.block.curl, pairs)
        size = np.maximum(size.max(axis=1, initial=0.0), self._blur(pairs[:LOOKED_AT], values))
        values = values[kept] / np.where(size > 0, size, 1.0)[kept][:, None]
        if not np.isfinite(values).all():
            return np.zeros(0)
        return np.asarray(np.linalg.svd(values, compute_uv=False)) / math.sqrt(values.shape[1])

    def _of(self, function: Any, pairs: list[tuple[Floats, Floats]]) -> Floats:
        """A function (x, p, Y, Z) -> (m,) of pairs of fields, (m, pairs)."""
        return np.array([np.array(function(self.x, self.p, *pair)).ravel() for pair in pairs]).T

    def _blur(self, pairs: list[tuple[Floats, Floats]], values: Floats) -> Floats:
        """Sizes (m,) of what cancelled in these values: what rounding has changed, and what shaken numbers do."""
        curl, found = program.written_out(self.block.curl), np.zeros(values.shape[0])
        x, p = _decimals(self.x), _decimals(self.p)
        other_x, other_p = ([multiprecision.shaken(a) for a in some] for some in (x, p))
        for (Y, Z), value in zip(pairs, values.T.tolist(), strict=False):
            fields = _decimals(Y), _decimals(Z)
            try:
                with decimal.localcontext(prec=FEWER):
                    plain = multiprecision.run(curl, [x, p, *fields], Decimal)
                    other = multiprecision.run(
                        curl, [other_x, other_p, *fields], multiprecision.shaken_constant
                    )
            except multiprecision.NotFinite:
                return np.full(found.size, math.inf)
            changes = [
                max(abs(a - b), abs(a - Decimal(c))) for a, b, c in zip(plain, other, value, strict=True)
            ]
            found = np.maximum(found, [float(change / multiprecision.SHAKE) for change in changes])
        return found


def _decimals(values: Floats) -> list[Decimal]:
    return [Decimal(a) for a in values.tolist()]
