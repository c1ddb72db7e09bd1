"""The run of a system reduced by its null space, as a table."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lagcli.equations.system import System
from lagcli.formulations import maggi, reduced_steps
from lagcli.formulations.dense_functions import DenseFunctions
from lagcli.model.model import Simulation
from lagcli.simulation.stepping.grid import Grid

Floats = npt.NDArray[np.float64]


def run(
    system: System, grid: Grid, begin: tuple[Floats, Floats, Floats], settings: Simulation
) -> tuple[Floats, reduced_steps.ReducedStatistics, reduced_steps.ReducedStop | None]:
    """Rows (k, 1 + columns) of a system from q, v (n,) with parameters p; why it stopped, where it did."""
    q, v, p = begin
    functions, account = DenseFunctions(system, p), reduced_steps.ReducedStatistics()
    places = _reactions(system)
    found: list[Floats] = []
    stopped = None
    try:
        for t, motion in reduced_steps.rows(functions, grid, (q, v), settings, account):
            lam = maggi.multipliers(functions, t, motion)
            row = functions.row(t, (motion.q, motion.v, motion.a), lam)
            row[places] = maggi.reaction(functions, t, motion)
            found.append(row)
    except reduced_steps.ReducedStop as stop:
        stopped = stop
    table = np.array(found) if found else np.zeros((0, 1 + len(system.columns)))
    return table + 0.0, account, stopped


def _reactions(system: System) -> list[int]:
    """The columns of R of Cartesian particles and generalized coordinates, in the order of q."""
    model = system.model
    cartesian = [name for p in model.particles if not p.is_dependent for name in p.members.names]
    names = [*(f"R.{name}.{axis}" for name in cartesian for axis in "xyz")]
    names += [f"R.{name}" for name in model.generalized_names]
    columns = {name: 1 + i for i, name in enumerate(system.columns)}
    return [columns[name] for name in names]
