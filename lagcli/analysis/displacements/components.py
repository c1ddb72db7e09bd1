"""Dependent and independent components of the displacements (D.16 to D.21).

All components are numbered, x_n with n = 3(k - 1) + j for the axis j of particle k, and generalized coordinates after
them. As many as the rank are dependent, chosen by pivots so that the rows are solved for them best; the others are
independent, and

    dx_dependent = T dx_independent + tau dt

tells all allowed displacements, with dt = 0 the virtual ones.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from lagcli.linear import independent_rows
from lagcli.model.model import Model

Floats = npt.NDArray[np.float64]

# A column whose rest is at least this part of the largest may be the pivot; of those the last is.
EQUAL = 1 - 1e-9
# Entries of T and tau below this part of the largest are rounding.
ROUNDING = 1e-13


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Components:
    """names (n,) of the components with their numbers (None for generalized coordinates); places among them of the
    dependent (rank,) and independent (n - rank,) ones; T (rank, n - rank) and tau (rank,)."""

    names: tuple[str, ...]
    numbers: tuple[int | None, ...]
    dependent: tuple[int, ...]
    independent: tuple[int, ...]
    T: Floats
    tau: Floats


def components(model: Model, rows: tuple[Floats, Floats], rank: int, sizes: Floats) -> Components:
    """The components for rows B (C, n) and b (C,) of this rank; sizes (n,): a length of each coordinate, to compare
    them by."""
    B, b = rows
    # The largest entry of each row is made one first: squares of huge ones are not finite.
    B, b = _divided(B, b, np.abs(B).max(axis=1, initial=0.0))
    B, b = _divided(B, b, np.linalg.norm(B * sizes, axis=1))
    dependent = _pivots(B * sizes, rank)
    independent = [i for i in range(B.shape[1]) if i not in set(dependent)]
    right = -np.column_stack([B[:, independent] * sizes[independent], b])
    solved = np.linalg.lstsq(B[:, dependent] * sizes[dependent], right, rcond=None)[0]
    solved = np.where(np.abs(solved) < ROUNDING * np.abs(solved).max(initial=0.0), 0.0, solved)
    solved = solved * sizes[dependent][:, None]
    numbers = _numbers(model)
    return Components(
        model.coordinate_names,
        numbers,
        tuple(dependent),
        tuple(independent),
        solved[:, :-1] / sizes[independent] + 0.0,
        solved[:, -1] + 0.0,
    )


def _divided(B: Floats, b: Floats, lengths: Floats) -> tuple[Floats, Floats]:
    """The rows over their lengths, but for those that are zero."""
    lengths = np.where(lengths > 0.0, lengths, 1.0)
    return B / lengths[:, None], b / lengths


def _numbers(model: Model) -> tuple[int | None, ...]:
    """n = 3(k - 1) + j of each coordinate, with k among all particles of the file."""
    flags = [p.is_dependent for p in model.particles for _ in range(p.members.count)]
    found: list[int | None] = [
        3 * k + j for k, is_dependent in enumerate(flags) if not is_dependent for j in (1, 2, 3)
    ]
    return (*found, *(None for _ in model.generalized_names))


def _pivots(B: Floats, rank: int) -> list[int]:
    """Columns of B that span its range, each the farthest from those before it, the last of several."""
    last = B.shape[1] - 1
    return sorted(last - k for k in independent_rows.farthest(B.T[::-1], rank, nearly=EQUAL))
