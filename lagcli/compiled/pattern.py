"""The coordinates that the constraint rows hold, and whether time: by structure, without numbers."""

from __future__ import annotations

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli.equations.system import System

Numbers = npt.NDArray[np.int64]


def coordinates(system: System) -> tuple[Numbers, Numbers]:
    """Pairs (row, coordinate): the row moves the coordinate, or, where it is differential, depends on it."""
    B, b, s = system.rows.B, system.rows.b, system.holonomic_count
    w = ca.densify(B[s:, :] @ system.symbols.v + b[s:, :])
    rows, columns = _entry_indices(B)
    depending, on = _entry_indices(ca.jacobian(w, system.symbols.q)) if w.numel() else (rows[:0], columns[:0])
    return np.concatenate([rows, depending + s]), np.concatenate([columns, on])


def depends_on_time(system: System) -> bool:
    """True if time is a coordinate of the forms: some row has a part along dt, or coefficients that hold t."""
    B, b = system.rows.B, system.rows.b
    moving = any(not b[i].is_zero() for i in range(b.numel()))
    return moving or (B.nnz() > 0 and bool(ca.depends_on(B.nz[:], system.symbols.t)))


def _entry_indices(matrix: ca.SX) -> tuple[Numbers, Numbers]:
    rows, columns = matrix.sparsity().get_triplet()
    return np.asarray(rows, dtype=np.int64), np.asarray(columns, dtype=np.int64)
