"""The figures a run reports about itself, filled while it goes on."""

from __future__ import annotations

import dataclasses
import operator
from typing import Any

import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.frozen import frozen_value
from lagcli.simulation.run_state.incident import NONE, Incident, RankDrop, Tally

Floats = npt.NDArray[np.float64]

# Below this part of the energies themselves nothing is exchanged but rounding.
ENERGY_ROUNDOFF = 1e-10
# Where nothing is, a deviation below this part of the energies is the rounding of their last digits.
LAST_DIGITS = 16 * doubles.EPS


@frozen_value
class Extremes:
    """Extremes over the rows of a run, each of which is a float; energies in the model's unit.

    position_drift, velocity_drift: largest |f_i| / |B_i|, |g_j| / |dg_j|, and |B_i v + b_i| / |B_i|
    start: the Jacobi energy H less W at the first row, after an impact at the start; rest: its part without
        velocities there
    imbalance: largest |H(t) - start - W(t)|; moving, resting: largest |H - rest| and |rest - rest(start)|;
    largest: largest |H| and |rest|; unbalanced: 1 where W is not known from some step on; penetration: largest -g_j
    """

    start: float
    rest: float
    position_drift: float = 0.0
    velocity_drift: float = 0.0
    imbalance: float = 0.0
    moving: float = 0.0
    resting: float = 0.0
    largest: float = 0.0
    unbalanced: float = 0.0
    penetration: float = 0.0

    def with_rows(self, rows: Floats) -> Extremes:
        """The extremes with more rows, (k, 5): position drift, velocity drift, H, its part without velocities, W."""
        if not len(rows):
            return self
        position, velocity, jacobi, rest, work = rows.T
        return Extremes(
            self.start,
            self.rest,
            max(self.position_drift, float(position.max())),
            max(self.velocity_drift, float(velocity.max())),
            max(self.imbalance, _size(jacobi - self.start - work)),
            max(self.moving, _size(jacobi - rest)),
            max(self.resting, _size(rest - self.rest)),
            max(self.largest, _size(jacobi), _size(rest)),
            self.unbalanced,
            self.penetration,
        )


NO_ROWS = Extremes(0.0, 0.0)


def _size(values: Floats) -> float:
    return float(np.abs(values).max())


@dataclasses.dataclass(slots=True, kw_only=True)
class Counts:
    """The counts of a run up to its state: a new one is a line here, and the run state, checkpoints and a resumed run
    have it.

    steps are accepted ones; evaluations those of the right-hand side; notes: what there is to report on integrals that
    are not enforced all the time; crossings: singular configurations that were passed; tally: of incidents up to the
    state, reported: of those handed out before or standing in `RunStatistics.incidents`, which may be more where the
    run was resumed from before them.
    """

    steps: int = 0
    rejected: int = 0
    evaluations: int = 0
    notes: tuple[str, ...] = ()
    crossings: tuple[RankDrop, ...] = ()
    tally: Tally = NONE
    reported: Tally = NONE


_NAMES = tuple(field.name for field in dataclasses.fields(Counts))
# The values of all counts, in their order: taken at every step, they cost less than an object.
counted = operator.attrgetter(*_NAMES)


def named(values: tuple[object, ...]) -> dict[str, Any]:
    """Counts by their names, from the values of `counted`."""
    return dict(zip(_NAMES, values, strict=True))


@dataclasses.dataclass(slots=True, kw_only=True)
class RunStatistics(Counts):
    """The account of a run; `extremes` is None before its first row.

    `solve_seconds`: wall time; resting: the energy of `RestingForces`; ended_by: the name of the event that has ended
    the run; is_balanced: whether the work W is known up to here.
    """

    solve_seconds: float = 0.0
    extremes: Extremes | None = None
    incidents: list[Incident] = dataclasses.field(default_factory=list)
    resting: float = 0.0
    ended_by: str | None = None
    is_balanced: bool = dataclasses.field(default=True, init=False)

    def __post_init__(self) -> None:
        self.is_balanced = self.extremes is None or not self.extremes.unbalanced

    def add(self, incident: Incident) -> None:
        """An incident that the state reached is behind; one that was reported before is not reported again."""
        self.tally = self.tally.plus(incident)
        if self.tally.incidents > self.reported.incidents:
            self.reported = self.tally
            self.incidents.append(incident)

    def mark_work_unknown(self) -> None:
        """From here on W is not known."""
        self.is_balanced = False
        if self.extremes is not None:
            self.extremes = dataclasses.replace(self.extremes, unbalanced=1.0)

    @property
    def energy_imbalance(self) -> float | None:
        """Largest deviation from the energy balance, as a part of what was exchanged; None where it is not known.

        For particles that is the largest T plus the largest change of V.
        """
        found = self.extremes
        if not self.is_balanced:
            return None
        if found is None:
            return 0.0
        sizes = max(found.largest, self.resting)
        moved = found.moving + found.resting
        exchanged = moved + ENERGY_ROUNDOFF * sizes
        if moved <= ENERGY_ROUNDOFF * sizes and found.imbalance <= LAST_DIGITS * sizes:
            return 0.0
        return found.imbalance / exchanged if exchanged else found.imbalance

    def take_depth(self, depth: float) -> None:
        """Take the largest -g_j of rows that were written."""
        if self.extremes is not None and depth > self.extremes.penetration:
            self.extremes = dataclasses.replace(self.extremes, penetration=depth)

    def take_figures(self, rows: Floats) -> None:
        """Take the figures of rows, (k, 5), in their order."""
        if self.extremes is None and len(rows):
            unbalanced = float(not self.is_balanced)
            _, _, jacobi, rest, work = rows[0].tolist()
            self.extremes = Extremes(jacobi - work, rest, unbalanced=unbalanced)
        if self.extremes is not None:
            self.extremes = self.extremes.with_rows(rows)
