"""Values read off the rows of a table, the states, and the generalized forces that go with them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lagcli.arrays import Floats
from lagcli.compiled import NumericSystem
from lagcli.equations.system import System
from lagcli.linear.metric_rows import LocalRows
from lagcli.model.model import Model

# A part of the largest force, or speed, that sums of some hundred roundings may leave.
# `tests/unit/test_drawing_thresholds.py::test_a_reaction_far_below_the_weight_is_zero` fails at 1e-12 and 1e-14.
FORCE_ROUNDOFF = 1e-13
STATES = 8  # of each block of rows, at which forces and inertia are looked at


class States:
    """The indices of t, q and v in the rows of a table with all `columns` of a model."""

    def __init__(self, model: Model, columns: Sequence[str]) -> None:
        indices = {name: i for i, name in enumerate(columns)}
        self._t = indices["t"]
        self._q = [indices[name] for name in model.coordinate_names]
        self._v = [indices[name] for name in model.rate_names]

    def __call__(self, rows: Floats) -> tuple[Floats, Floats, Floats]:
        """t (k,), q (k, n) and v (k, n) of rows (k, columns)."""
        return rows[:, self._t], rows[:, self._q], rows[:, self._v]


def size(model: Model, columns: Sequence[str], rows: Floats) -> float:
    """The smaller one of the largest position and the largest speed in a table (T, columns) that is not zero, or 1."""
    found = []
    for kind in map(frozenset, model.state_columns):
        values = np.abs(rows[:, [i for i, name in enumerate(columns) if name in kind]])
        found.append(float(values[np.isfinite(values)].max(initial=0.0)))
    return min(filter(None, found), default=1.0)


class Floors:
    """The sizes below which values are rounding of zero, from the forces and the inertia of a run.

    Of rows of a table with all `columns`: G, the largest of h, M a, the parts lambda_i B_i of the reaction, and the
    inertial forces of motion in a curve, each as the length of force / sqrt(mass). What is below FORCE_ROUNDOFF of it
    cannot be told from zero: lambda_i sqrt(B_i M^-1 B_i^T), R_j / sqrt(M_jj), and v_j sqrt(M_jj) where sqrt(2 T), with
    what G makes in the time, takes its place. A force that is large at a few rows alone, as beside a pole, makes no
    speed, and makes forces rounding at these rows only; elsewhere G is not below its mean over the time.
    """

    def __init__(self, system: System, numeric: NumericSystem, p: Floats, columns: Sequence[str]) -> None:
        model = system.model
        self._numeric, self._p, self._states = numeric, p, States(model, columns)
        indices = {name: i for i, name in enumerate(columns)}
        self._lam = [indices[f"lambda.{row.name}"] for row in system.rows.rows]
        names = model.coordinate_names
        own = set(names)
        self._R = [indices[f"R.{name}"] for name in names]
        self._v = [indices[name] for name in model.rate_names]
        dependent = [(k, n) for k, n in enumerate(model.particle_names) if f"{n}.x" not in own]
        self._dependent = [(k, indices[f"R.{name}.{axis}"]) for k, name in dependent for axis in "xyz"]
        self._masses = np.concatenate([np.zeros(0), *(np.ravel(p.mass_values) for p in model.particles)])
        n = len(names)
        self._motion = self._extent = self._impulse = self._moved = 0.0
        self._inertia, self._lengths = np.zeros(n), np.full(len(self._lam), np.inf)
        self._largest, self._above = np.zeros(len(columns)), np.zeros(len(columns))
        self._times, self._last = (np.inf, -np.inf), (np.inf, 0.0, 0.0)

    def take(self, rows: Floats) -> None:
        """More rows (k, columns) of the table."""
        if not len(rows):
            return
        width = min(self._largest.size, rows.shape[1])  # a table of another run has no columns of errors
        values = np.abs(rows[:, :width])
        self._largest[:width] = np.fmax(self._largest[:width], np.fmax.reduce(values))
        at, known = np.unique(np.linspace(0, len(rows) - 1, STATES).astype(int)), self._last[1]
        G = np.array([known, *(self._look(rows[i]) for i in at)])
        # A row stands between two that are looked at, or is the second of them.
        ends = np.searchsorted(at, np.arange(len(rows)))
        floors = np.maximum(G[ends], G[ends + 1])[:, None] * self._units()[:width]
        above = np.fmax.reduce(np.where(values > floors, values, 0.0))
        self._above[:width] = np.fmax(self._above[:width], above)

    def _look(self, row: Floats) -> float:
        """G of a row, 0 where it is not finite; a curve counts in the mean only."""
        (t,), (q,), (v,) = self._states(row[None])
        at = t, q, v, self._p
        h, M = np.array(self._numeric.force(*at)[0]).ravel(), LocalRows(self._numeric.inertia(*at))
        B, lam = LocalRows(self._numeric.rows(*at)[0]), row[self._lam]
        m = np.bincount(M.row, weights=M.values * (M.row == M.column), minlength=q.size)
        if not (m > 0).all() or not np.isfinite([*h, *m, *lam, *B.values]).all():
            return 0.0
        root = np.sqrt(m)
        reaction = np.bincount(B.column, weights=B.values * lam[B.row], minlength=q.size)
        parts = [h, h + reaction]
        lengths = np.sqrt(np.bincount(B.row, weights=(B.values / root[B.column]) ** 2, minlength=lam.size))
        forces = [float(np.linalg.norm(part / root)) for part in parts] + np.abs(lam * lengths).tolist()
        moving, extent = float(np.linalg.norm(v * root)), float(np.linalg.norm(q * root))
        largest: float = max(forces)
        before, known, moved = self._last
        self._last = (float(t), largest, moving)
        self._impulse += min(known, largest) * max(0.0, float(t) - before)
        self._moved += min(moved, moving) ** 2 * max(0.0, float(t) - before)
        self._motion, self._extent = max(self._motion, moving), max(self._extent, extent)
        self._inertia = np.maximum(self._inertia, root)
        self._lengths = np.minimum(self._lengths, np.where(lengths > 0, lengths, np.inf))
        self._times = min(self._times[0], float(t)), max(self._times[1], float(t))
        return largest

    def _units(self) -> Floats:
        """The floor of each column of forces (columns,) where G is one, 0 for the others."""
        units = np.zeros(self._largest.size)
        units[self._lam] = np.where(np.isfinite(self._lengths), FORCE_ROUNDOFF / self._lengths, 0.0)
        units[self._R] = FORCE_ROUNDOFF * self._inertia
        for k, extent in self._dependent:
            units[extent] = FORCE_ROUNDOFF * np.sqrt(self._masses[k])
        return units

    def floors(self) -> Floats:
        """The floor of each column over the whole time (columns,), 0 where there is none."""
        lasting = max(0.0, self._times[1] - self._times[0])
        force, square = self._last[1], self._last[2] ** 2
        if lasting:
            force, square = self._impulse / lasting, self._moved / lasting
        curved = square / self._extent if self._extent else 0.0
        found = max(force, curved) * self._units()
        with np.errstate(divide="ignore", invalid="ignore"):
            impulse = self._impulse + curved * lasting
            speed = FORCE_ROUNDOFF * (self._motion + impulse) / self._inertia
        found[self._v] = np.where(self._inertia > 0, speed, 0.0)
        return np.asarray(found)

    def are_zero(self, indices: Sequence[int]) -> bool:
        """True if some columns, one of them not exactly zero, are zero to rounding in all rows."""
        at, floors = list(indices), self.floors()
        return bool((self._above[at] <= floors[at]).all() and (self._largest[at] > 0).any())

    def zeros(self) -> npt.NDArray[np.bool_]:
        """True for columns that are zero to rounding in all rows, but not exactly zero (columns,)."""
        return (self._largest > 0) & (self._above <= self.floors())


class GeneralizedForces:
    """The columns `Q.theta`: Q_j (D.30) of each generalized coordinate, of all forces and potentials declared."""

    def __init__(self, system: System, numeric: NumericSystem, p: Floats, columns: Sequence[str]) -> None:
        model = system.model
        taken = set(columns)  # a particle may be called Q
        named = ((i, f"Q.{name}") for i, name in enumerate(model.generalized_names))
        names = [(i, name) for i, name in named if name not in taken]
        self.names = tuple(name for _, name in names)
        first = system.symbols.q.numel() - len(model.generalized_names)
        self._rows = [first + i for i, _ in names]
        self._numeric, self._p, self._states = numeric, p, States(model, columns)

    def __call__(self, rows: Floats) -> Floats:
        """Q_j (k, names) at the rows (k, columns) of a table with all columns."""
        t, q, v = self._states(rows)
        if not len(rows):
            return np.zeros((0, len(self.names)))
        found = self._numeric.applied(t[None], q.T, v.T, np.tile(self._p, (len(rows), 1)).T)
        return np.asarray(np.array(found)[self._rows].T)
