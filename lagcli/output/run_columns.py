"""The columns of the tables of a run beside those that every table of its model has."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lagcli.compiled import NumericSystem
from lagcli.equations.system import System
from lagcli.output.table_columns import GeneralizedForces
from lagcli.output.tables import incident_table
from lagcli.output.tables.incident_table import IncidentColumns

Floats = npt.NDArray[np.float64]


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class RunColumns:
    """incidents: the columns of the table of incidents; by_name: those that are given only where they are asked for by
    name, `Q.theta`; forces: their values."""

    incidents: IncidentColumns
    by_name: tuple[str, ...]
    forces: GeneralizedForces


def of(system: System, numeric: NumericSystem, p: Floats, names: Sequence[str]) -> RunColumns:
    """The columns of a run with the parameters p whose table has the columns `names`, t first."""
    forces = GeneralizedForces(system, numeric, p, names)
    return RunColumns(incident_table.columns(system.model, system.columns), forces.names, forces)
