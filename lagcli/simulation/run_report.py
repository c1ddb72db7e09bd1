"""The state of a run between two blocks of its rows and its account, as one frozen object."""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from lagcli.compiled.selection import Selection
from lagcli.simulation.global_error.accuracy import Accuracy
from lagcli.simulation.run_state.incident import Incident, Tally
from lagcli.simulation.singularity.singular_point import RankDrop

Floats = npt.NDArray[np.float64]


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class RunReport:
    """The account of a run at the time t reached.

    q, v, a: the state there and its accelerations, (n,) each; selection: the independent rows it is stepped with;
    indeterminate: rows whose multipliers, or impulses, are not unique or were not at some time; steps: accepted ones;
    rejected; evaluations: of the right-hand side; solve_seconds: wall time, of a repeated run too; position_drift,
    velocity_drift: as in `statistics.Figures`; energy_imbalance: a part of what was exchanged, None where it is not
    known; exchanged: the largest T so far plus the largest change of V; crossings: singular configurations up to t;
    told: the tally of incidents handed out; ended_by: the event that has ended the run; complete: the rows of
    the grid up to t, be they made or not; accuracy: of rows, where the run is repeated.
    """

    t: float
    q: Floats
    v: Floats
    a: Floats
    selection: Selection
    indeterminate: frozenset[int]
    steps: int
    rejected: int
    evaluations: int
    solve_seconds: float
    position_drift: float
    velocity_drift: float
    energy_imbalance: float | None
    exchanged: float
    largest_penetration: float
    crossings: tuple[RankDrop, ...]
    told: Tally
    ended_by: str | None
    complete: int
    notes: tuple[str, ...]
    accuracy: Accuracy | None


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class RunBlock:
    """Rows (k, columns) as they are handed out, maybe none, and the incidents that came with them."""

    rows: Floats
    incidents: list[Incident]
