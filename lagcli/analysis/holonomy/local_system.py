"""The part of a system near one row: the coordinates that may move, the rest fixed where they start.

A path of the part is a path of the whole. Points are z = (q of the part, t) in units of their own, and the rows the
forms A dz = B dq + b dt (D.6) that touch the part.
"""

from __future__ import annotations

import dataclasses
import math
from functools import cached_property
from typing import Any

import numpy as np

from lagcli import doubles, progress
from lagcli.arrays import Flags, Floats, Integers
from lagcli.compiled import NumericSystem, paths
from lagcli.equations.system import System
from lagcli.start.initial import State

LARGEST = 60  # coordinates of a part; what is further away rests
# Of points beside the start; the same in every run.
SEED = 1909


class LoopTimeUpError(Exception):
    """The time for a search is over."""


@dataclasses.dataclass(frozen=True)
class LocalPart:
    """`rows` (c,) and `coordinates` (k,) are numbers in the whole system; `row` is the one in question, in `rows`.
    After `deadline` (see `progress.after`) it answers with `LoopTimeUpError`."""

    system: System
    numeric: NumericSystem
    state: State
    row: int
    rows: Integers
    coordinates: Integers
    deadline: float
    built: dict[tuple[int, ...], paths.PathSteps] = dataclasses.field(default_factory=dict)

    @property
    def k(self) -> int:
        """The number of coordinates, and the index of t in a point."""
        return self.coordinates.size

    @property
    def start(self) -> Floats:
        """The point of the state (k + 1,)."""
        return np.append(self.state.q[self.coordinates], self.state.t) / self.scale

    @cached_property
    def scale(self) -> Floats:
        """The units (k + 1,) in which points are counted, powers of ten. Over about one unit of a coordinate the rows
        turn; without this a link of 1 cm and an angle in one row could not move together. Units below the step of the
        quotient that shows it, or above its inverse, are one."""
        q = np.append(self.state.q[self.coordinates], self.state.t)
        shifts = doubles.STEP * np.eye(self.k + 1)[:-1]
        here = self._forms(q[None])[0]
        turned = (self._forms(q + shifts) - self._forms(q - shifts)) / (2 * doubles.STEP)
        with np.errstate(all="ignore"):
            lengths = np.linalg.norm(here, axis=1) / np.linalg.norm(turned, axis=2)
            lengths[~np.isfinite(lengths) | (lengths == 0)] = np.inf
            shortest = lengths.min(axis=1, initial=np.inf)
        shortest[~((shortest > doubles.STEP) & (shortest < 1 / doubles.STEP))] = 1.0
        return np.append(10.0 ** np.rint(np.log10(shortest)), 1.0)

    def whole(self, Z: Floats) -> Floats:
        """Configurations (N, n) of the whole system for points (N, k + 1)."""
        q = np.repeat(self.state.q[None], len(Z), axis=0)
        q[:, self.coordinates] = (Z * self.scale)[:, : self.k]
        return q

    def forms(self, Z: Floats) -> Floats:
        """A (N, c, k + 1) at points Z (N, k + 1); not finite where a row is not. Raises `LoopTimeUpError`. Its columns
        are those of displacements in the units of the points."""
        self.wait()
        seconds = progress.PARAMETERS
        progress.reckon(seconds.evaluation + seconds.entry * len(Z) * self._entries[0].size)
        Z = Z * self.scale
        most = max(1, 200_000 // max(1, self._entries[0].size))  # entries of B in one call
        found = [self._forms(Z[i : i + most]) for i in range(0, len(Z), most)]
        return np.concatenate(found) * self.scale if found else np.zeros((0, self.rows.size, self.k + 1))

    def wait(self) -> None:
        """Raises `LoopTimeUpError` after the deadline, and `OverTime` where the time of the whole work is over."""
        progress.require_time()
        if progress.left(self.deadline) < 0:
            raise LoopTimeUpError

    @cached_property
    def expressions(self) -> tuple[Any, Any]:
        """z (k + 1,) and A (c, k + 1) as expressions in it."""
        fixed = paths.FixedValues(self.state.q, self.state.v, self.state.p, self.scale)
        return paths.rows(self.system, self.rows, self.coordinates, fixed)

    def residual(self, Z: Floats) -> float:
        """The largest |f| of the holonomic rows that the part touches, over points (N, k + 1)."""
        touched = self.rows[self.rows < self.system.holonomic_count]
        if not touched.size:
            return 0.0
        found = [
            np.array(self.numeric.holonomic(t, q, self.state.p)[0]).ravel()[touched]
            for t, q in zip(Z[:, -1] * self.scale[-1], self.whole(Z), strict=True)
        ]
        return float(np.abs(found).max())

    @cached_property
    def angles(self) -> Flags:
        """True for coordinates (k,) that enter the rows as angles: with the period 2 pi and no smaller part of it."""
        random = np.random.default_rng(SEED)
        Z = self.start + 0.3 * random.standard_normal((5, self.k + 1))
        here = self.forms(Z)
        found = np.zeros(self.k, dtype=bool)
        for i in range(self.k):
            whole, part = Z.copy(), Z.copy()
            whole[:, i] += math.tau / self.scale[i]
            part[:, i] += 1.0 / self.scale[i]
            with np.errstate(invalid="ignore"):
                same = np.allclose(self.forms(whole), here, rtol=1e-9, atol=1e-9)
                found[i] = same and not np.allclose(self.forms(part), here, rtol=1e-6, atol=1e-9)
        return found

    @property
    def knows_time(self) -> bool:
        """True if t or dt stands in the rows."""
        random = np.random.default_rng(SEED)
        Z = self.start + 0.1 * random.standard_normal((5, self.k + 1))
        A = self.forms(Z)
        return bool(A[:, :, -1].any() or (self.forms(Z + np.eye(self.k + 1)[-1]) != A).any())

    def _forms(self, Z: Floats) -> Floats:
        """The forms in the units of the model."""
        state, count = self.state, len(Z)
        q = np.repeat(state.q[:, None], count, axis=1)
        q[self.coordinates] = Z[:, : self.k].T
        B, b = self.numeric.rows(Z[:, -1][None], q, state.v, state.p)
        entries, rows, columns = self._entries
        A = np.zeros((count, self.rows.size, self.k + 1))
        A[:, rows, columns] = np.array(B.nonzeros(), dtype=float).reshape(count, -1)[:, entries]
        A[:, :, -1] = np.array(b).T[:, self.rows]
        return A

    @cached_property
    def _entries(self) -> tuple[Integers, Integers, Integers]:
        """The nonzeros of B in the part, with their rows and columns there."""
        sparsity = self.numeric.rows.sparsity_out(0)
        row, column = (np.array(x, dtype=np.int64) for x in (sparsity.row(), sparsity.get_col()))
        row_of, column_of = np.full(sparsity.shape[0], -1), np.full(sparsity.shape[1], -1)
        row_of[self.rows] = np.arange(self.rows.size)
        column_of[self.coordinates] = np.arange(self.k)
        entries = np.flatnonzero((row_of[row] >= 0) & (column_of[column] >= 0))
        return entries, row_of[row[entries]], column_of[column[entries]]


def around(
    system: System, numeric: NumericSystem, state: State, row: int, deadline: float = math.inf
) -> list[LocalPart]:
    """Parts that hold one row of the system, each larger than the one before, up to a size."""
    differentials = _pairs(numeric.rows.sparsity_out(0), system.rows.B.shape[0])
    coefficients = _pairs(numeric.rows.jac_sparsity(0, 1), system.rows.B.shape[0])
    drift = _pairs(numeric.rows.jac_sparsity(1, 1), system.rows.B.shape[0])
    touching = np.unique(np.concatenate([differentials, coefficients, drift]), axis=0)
    n = system.symbols.q.numel()
    coordinates = np.zeros(n, dtype=bool)
    coordinates[touching[touching[:, 0] == row, 1]] = True
    found: list[LocalPart] = []
    while True:
        # A row whose coefficients alone change with what moves still holds where its own coordinates rest.
        rows = np.unique(differentials[coordinates[differentials[:, 1]], 0])
        here = np.flatnonzero(coordinates)
        found.append(LocalPart(system, numeric, state, int(np.searchsorted(rows, row)), rows, here, deadline))
        wider = coordinates.copy()
        wider[touching[np.isin(touching[:, 0], rows), 1]] = True
        if (wider == coordinates).all() or len(here) > LARGEST:
            return found
        coordinates = wider


def _pairs(sparsity: object, rows: int) -> Integers:
    """(row, column) of the entries of a matrix, or of a derivative of a stacked matrix with that many rows."""
    row, column = (np.array(x, dtype=np.int64) for x in (sparsity.row(), sparsity.get_col()))  # type: ignore[attr-defined]
    return np.column_stack([row % rows, column]).reshape(-1, 2)
