"""Made-up incidents of a model: a ball that falls on a floor and bounces."""

import numpy as np

from lagcli.model.model import Model
from lagcli.output.tables import incident_table
from lagcli.output.tables.incident_table import IncidentColumns
from lagcli.simulation.run_state.statistics import Incident, Kind

BALL = """
lagcli: 1
particles:
  a: {mass: 1, position: [0, 0, 1]}
coordinates:
  theta: {value: 0.5}
lagrangian: rate(theta)**2/2
forces:
  weight: {to: a, force: "[0, 0, -9.81]"}
holonomic:
  floor: a.z - 1 = 0
  wall: a.x = 0
outputs:
  height: a.z
"""


def columns(model: Model) -> tuple[str, ...]:
    """The columns of the table of `BALL`, without t."""
    from lagcli.equations import system

    return system.build(model).columns


def layout(model: Model) -> IncidentColumns:
    """The columns of its incidents."""
    return incident_table.columns(model, columns(model))


def incident(
    model: Model, t: float, kind: Kind = "impact", name: str = "floor", push: float = 2.0
) -> Incident:
    """An incident; the numbers of its lines tell their columns: 100 times the time, and the place; the height is t."""
    width = len(columns(model))
    before = 100.0 * t + np.arange(width)
    after = before.copy()
    after[5] = -before[5]
    return Incident(t, kind, name, np.array([push, 0.0]), before, after)
