"""The answer of a search: the derived flag, or why it is not known."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import numpy.typing as npt

from lagcli.start.initial import State

Floats = npt.NDArray[np.float64]


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class NumericFlag:
    """The derived flag of `rows` (m,), differential rows of the system, on the surface of those they came with.

    dimension: of the kernel D at generic points, over coordinates and, with `has_time`, time.
    extra: dimensions of I, I', ... beyond the df, to zero or to the first that repeats; growth: dim D grows by
    these in the growth vector, (0, ...). inside (m,): which rows lie in I^(oo). combinations (k, m): a basis of
    the k combinations of rows that stay, at the start, or where that is special at a generic point.
    contradiction: a multiple of dt lies in the rows. special: ranks or growth at the start are not those nearby
    (None: brackets were too large to look there too). places: states of the orbit that were looked at, the start
    first; surface: the rank of the holonomic rows on it. on_piece: abs, min, max or sign switch in the rows, so that
    the flag is that of the start's side.
    digits: the precision of the proof; error: the largest value that counted as zero, least: the smallest that
    did not, both relative to the size of the terms they are made of. Where not `is_certain`, `reason` says why, and
    of extra, growth, inside and combinations what is not known is empty or None.
    """

    rows: tuple[int, ...]
    has_time: bool
    dimension: int | None = None
    extra: tuple[int, ...] = ()
    growth: tuple[int, ...] = ()
    inside: tuple[bool, ...] = ()
    combinations: Floats | None = None
    contradiction: bool = False
    special: bool | None = False
    places: tuple[State, ...] = ()
    surface: int = 0
    on_piece: bool = False
    is_certain: bool = False
    reason: str = ""
    digits: int = 16
    error: float = 0.0
    least: float = math.inf

    @property
    def staying(self) -> int | None:
        """The dimension of I^(oo) beyond the df: how many integrals the rows have on the surface."""
        return None if self.combinations is None else int(self.combinations.shape[0])
