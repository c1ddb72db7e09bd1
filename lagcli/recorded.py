"""What can be read off the rows of a table: the states, and the generalized forces that go with them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lagcli.compile import NumericSystem
from lagcli.mechanics.system import System
from lagcli.model import Model

Floats = npt.NDArray[np.float64]


class States:
    """Where t, q and v stand in the rows of a table with all `columns` of a model."""

    def __init__(self, model: Model, columns: Sequence[str]) -> None:
        places = {name: i for i, name in enumerate(columns)}
        cartesian = [name for p in model.particles if not p.is_dependent for name in p.members.names]
        q = [f"{name}.{axis}" for name in cartesian for axis in "xyz"]
        v = [f"{name}.v{axis}" for name in cartesian for axis in "xyz"]
        generalized = model.generalized_names
        self._t = places["t"]
        self._q = [places[name] for name in (*q, *generalized)]
        self._v = [places[name] for name in (*v, *(f"rate({name})" for name in generalized))]

    def __call__(self, rows: Floats) -> tuple[Floats, Floats, Floats]:
        """t (k,), q (k, n) and v (k, n) of rows (k, columns)."""
        return rows[:, self._t], rows[:, self._q], rows[:, self._v]


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
