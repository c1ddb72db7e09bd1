"""Constraint rows that belong together (D.3, D.6): A = [B | b] over (q, t), the first s of them of holonomic rows."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli.arrays import Floats
from lagcli.equations.system import System
from lagcli.smoothness import operation_graph, switches
from lagcli.smoothness.sized_function import SizedFunction

if TYPE_CHECKING:  # a count needs no pieces
    from lagcli.smoothness.switches import AnalyticPieces


# Rounds in which rows and columns are scaled in turn.
SCALING_ROUNDS, TINY_ENTRY = 3, 1e-4


class RowBlock:
    """The rows of a block over the variables x (N,) they touch or depend on, time last where it enters.

    `holonomic` (s) and `differential` (m): indices of the rows of the system; columns: the coordinates in x; kinds
    (N,): a number for each kind of variable, the Cartesian ones together.
    Time is a variable where a row has a part without velocities or depends on t.
    """

    def __init__(self, system: System, rows: Sequence[int]) -> None:
        s = system.holonomic_count
        self.holonomic = tuple(i for i in rows if i < s)
        self.differential = tuple(i for i in rows if i >= s)
        order = [*self.holonomic, *self.differential]
        symbols, whole = system.symbols, system.rows
        B, b = whole.B[order, :], ca.SX(whole.b[order])
        f = whole.f[list(self.holonomic)] if self.holonomic else ca.SX(0, 1)
        entered = {s.element_hash() for s in ca.symvar(ca.vertcat(ca.vec(B.nz[:]), b, f))}
        touched = np.zeros(symbols.q.numel(), dtype=bool)
        touched[np.asarray(B.sparsity().get_col(), dtype=int)] = True
        for k, symbol in enumerate(ca.vertsplit(symbols.q)):
            touched[k] |= symbol.element_hash() in entered
        self.columns = np.flatnonzero(touched)
        moves = not all(b[i].is_zero() for i in range(b.numel()))
        self.has_time = moves or symbols.t.element_hash() in entered
        self.x = ca.vertcat(symbols.q[self.columns.tolist()], *([symbols.t] if self.has_time else []))
        self.p, self._f = system.p, f
        B = B[:, self.columns.tolist()]
        self.A = ca.sparsify(ca.horzcat(B, b)) if self.has_time else B
        self.size = int(self.x.numel())
        lengths = symbols.q.numel() - len(system.model.generalized_names)
        numbers = np.append(self.columns, [symbols.q.numel()] if self.has_time else []).astype(np.intp)
        self.kinds = np.where(numbers < lengths, 0, numbers + 1)

    def on_branch(self, x: Floats, p: Floats, near: float) -> RowBlock:
        """The block with switches (abs, sign, min, max) as they are at a point; those within `near` of it stay."""
        if not self.has_kinks:
            return self
        there = copy.copy(self)
        for name in ("rows", "surface", "along", "curl", "has_kinks", "pieces"):
            there.__dict__.pop(name, None)
        point = [self.x, self.p], [x, p], near
        entries = switches.on_branch(ca.densify(ca.vec(ca.SX(self.A).nz[:])), *point)
        there.A, there._f = ca.SX(self.A.sparsity(), entries), switches.on_branch(ca.densify(self._f), *point)
        return there

    @cached_property
    def rows(self) -> ca.Function:
        """rows(x, p) -> A (s + m, N), f (s,)."""
        return SizedFunction("rows", [self.x, self.p], [self.A, ca.densify(self._f)])

    @cached_property
    def surface(self) -> ca.Function:
        """surface(x, p) -> f (s,)."""
        return SizedFunction("surface", [self.x, self.p], [ca.densify(self._f)])

    @cached_property
    def along(self) -> ca.Function:
        """along(x, p, Y) -> A Y, the rows along a field (s + m,)."""
        x, p, Y, _ = self._arguments
        return SizedFunction("along", [x, p, Y], [ca.densify(ca.mtimes(self.A, Y))])

    @cached_property
    def curl(self) -> ca.Function:
        """curl(x, p, Y, Z) -> d omega_i(Y, Z) of the differential rows (m,)."""
        *_, Y, Z = self._arguments
        omega = self.A[len(self.holonomic) :, :]
        entries, columns = ca.vec(omega.nz[:]), omega.sparsity().get_col()
        # The terms of (J Y) . Z and (J Z) . Y, (m, N) each, with J the derivatives of the rows.
        one, other = (
            ca.SX(omega.sparsity(), ca.densify(ca.jtimes(entries, self.x, along)) * into[columns, 0])
            for along, into in ((Y, Z), (Z, Y))
        )
        return SizedFunction("curl", self._arguments, [ca.densify(ca.sum2(one) - ca.sum2(other))])

    @cached_property
    def has_kinks(self) -> bool:
        """True if abs, sign, min or max change how the rows are to be computed from point to point."""
        steps = (*operation_graph.instructions(self.along), *operation_graph.instructions(self.curl))
        return any(switches.is_comparing(step.op) for step in steps)

    @cached_property
    def pieces(self) -> AnalyticPieces:
        """The pieces of space on which the rows are analytic."""
        return switches.AnalyticPieces(self.A, [self.x, self.p])

    @cached_property
    def _arguments(self) -> list[ca.SX]:
        return [self.x, self.p, ca.SX.sym("Y", self.size), ca.SX.sym("Z", self.size)]


def variable_sizes(A: ca.DM, kinds: npt.NDArray[np.intp]) -> Floats:
    """Sizes (N,) of variables, equal for each of the `kinds` (N,), in which entries of rows A (C, N) are of one size; 1
    where none is touched. Entries that are tiny in their row, as at a special point, say nothing."""
    rows, columns = (np.asarray(part, dtype=np.intp) for part in A.sparsity().get_triplet())
    values = np.abs(np.array(A.nonzeros(), dtype=float))
    groups = kinds[columns]
    of_row, of_kind = np.ones(A.shape[0]), np.ones(int(kinds.max(initial=0)) + 1)
    for _ in range(SCALING_ROUNDS):
        largest = np.zeros(of_row.size)
        np.maximum.at(largest, rows, values * of_kind[groups])
        of_row = 1 / np.where(largest > 0, largest, 1.0)
        relative = values * of_row[rows] * of_kind[groups]
        largest = np.zeros(of_kind.size)
        np.maximum.at(largest, groups, np.where(relative > TINY_ENTRY, relative, 0.0))
        of_kind /= np.where(largest > 0, largest, 1.0)
    return of_kind[kinds]


def scaled(A: ca.DM, sizes: Floats) -> ca.DM:
    """Rows A (C, N) with their columns times the sizes (N,)."""
    columns = np.asarray(A.sparsity().get_col(), dtype=np.intp)
    return ca.DM(A.sparsity(), ca.DM(np.array(A.nonzeros(), dtype=float) * sizes[columns]))


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
