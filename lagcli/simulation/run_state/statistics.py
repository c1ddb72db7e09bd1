"""What a run tells of itself while it goes on: incidents, which are impacts, contacts, releases, declared events and
crossings of singular configurations; counts, and the extremes of its rows."""

from __future__ import annotations

import dataclasses
import operator
from typing import Any, Literal, get_args

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.frozen import frozen, frozen_value

# In the order in which those of one instant are reported: what came before it, what it was, what holds after it.
Kind = Literal["impact", "accumulation", "contact", "release", "event", "crossing"]
KINDS: tuple[Kind, ...] = get_args(Kind)


@frozen
class Incident:
    """An impact, contact, release or event of one name at an instant t, not counted from the origin of the run.
    impulses: of all constraints then, in the order of the columns `lambda.NAME` (C + K,), in units of lambda times
    time: momenta jump by B^T Lambda + G^T Lambda_G; before, after: lines of the table without t, then errors where the
    table has them."""

    t: float
    kind: Kind
    name: str
    impulses: Floats
    before: Floats
    after: Floats


@frozen_value
class RankDrop:
    """At a time t the rank of the rows drops by `number`; participants: the rows that become dependent."""

    t: float
    number: int
    participants: tuple[int, ...]


@frozen_value
class Tally:
    """Indices of incidents up to some state: of all, of different instants, and of impacts, releases and accumulations
    of single contacts; last: time of the last one."""

    incidents: int = 0
    instants: int = 0
    impacts: int = 0
    releases: int = 0
    accumulations: int = 0
    last: float | None = None

    def plus(self, incident: Incident) -> Tally:
        """The numbers behind one more."""
        return Tally(
            self.incidents + 1,
            self.instants + (incident.t != self.last),
            self.impacts + (incident.kind == "impact"),
            self.releases + (incident.kind == "release"),
            self.accumulations + (incident.kind == "accumulation"),
            incident.t,
        )


NONE = Tally()


# Below this part of the energies themselves nothing is exchanged but rounding.
ENERGY_ROUNDOFF = 1e-10
# Where nothing is, a deviation below this part of the energies is the rounding of their last digits.
LAST_DIGITS = 16 * doubles.EPS


@frozen_value
class Extremes:
    """Extremes over the rows of a run; energies in the model's unit.

    position_drift, velocity_drift: largest |f_i| / |B_i|, |g_j| / |dg_j|, and |B_i v + b_i| / |B_i|; start: the Jacobi
    energy H less W at the first row; rest: its part without velocities there; imbalance: largest |H(t) - start - W(t)|;
    moving, resting: largest |H - rest| and |rest - rest(start)|; largest: largest |H| and |rest|; unbalanced: 1 where W
    is not known from some step on; penetration: largest -g_j.
    """

    start: float
    rest: float
    position_drift: float
    velocity_drift: float
    imbalance: float
    moving: float
    resting: float
    largest: float
    unbalanced: float
    penetration: float


NO_ROWS = Extremes(*[0.0] * len(dataclasses.fields(Extremes)))


@dataclasses.dataclass(slots=True, kw_only=True)
class Counts:
    """The counts of a run up to its state, one a line: the run state, checkpoints and a resumed run have them. steps
    are accepted ones; evaluations: of the right-hand side; notes: on integrals that are not enforced all the time;
    crossings: singular configurations passed; tally: of incidents up to the state; reported: of those handed out, or
    standing in `RunStatistics.incidents`, maybe more where the run was resumed from before them."""

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
    """The account of a run; `extremes` is None before its first row. resting: the energy of `RestingForces`; ended_by:
    the name of the event that has ended the run; is_balanced: whether the work W is known up to here; native_steps:
    those that native code took; compile_seconds: in which it was looked for and made."""

    solve_seconds: float = 0.0
    compile_seconds: float = 0.0
    extremes: Extremes | None = None
    incidents: list[Incident] = dataclasses.field(default_factory=list)
    resting: float = 0.0
    ended_by: str | None = None
    native_steps: int = 0
    is_balanced: bool = dataclasses.field(default=True, init=False)

    def __post_init__(self) -> None:
        self.is_balanced = self.extremes is None or not self.extremes.unbalanced

    def add(self, incident: Incident) -> None:
        """An incident that the state reached is behind; one that was reported before is not reported again."""
        self.tally = self.tally.plus(incident)
        if self.tally.incidents > self.reported.incidents:
            self.reported = self.tally
            self.incidents.append(incident)

    def take_rows(self, rows: Floats, depth: float) -> None:
        """Take the figures of rows that were written, (k, 5): position drift, velocity drift, H, its part without
        velocities, W; and the largest -g_j of them."""
        if not len(rows):
            return
        position, velocity, jacobi, rest, work = rows.T
        found, unbalanced = self.extremes or NO_ROWS, float(not self.is_balanced)
        begin, at_rest = found.start, found.rest
        if self.extremes is None:
            begin, at_rest = float(jacobi[0]) - float(work[0]), float(rest[0])
        sizes = np.array(
            [position, velocity, jacobi - begin - work, jacobi - rest, rest - at_rest, jacobi, rest]
        )
        drift, velocity_drift, imbalance, moving, resting, *energies = np.abs(sizes).max(axis=1).tolist()
        self.extremes = Extremes(
            start=begin,
            rest=at_rest,
            position_drift=max(found.position_drift, drift),
            velocity_drift=max(found.velocity_drift, velocity_drift),
            imbalance=max(found.imbalance, imbalance),
            moving=max(found.moving, moving),
            resting=max(found.resting, resting),
            largest=max(found.largest, *energies),
            unbalanced=unbalanced if self.extremes is None else found.unbalanced,
            penetration=max(found.penetration, depth),
        )

    @property
    def energy_imbalance(self) -> float | None:
        """Largest deviation from the energy balance, as a part of what was exchanged: for particles the largest T plus
        the largest change of V; None where it is not known."""
        found = self.extremes or NO_ROWS
        if not self.is_balanced:
            return None
        sizes = max(found.largest, self.resting)
        moved = found.moving + found.resting
        exchanged = moved + ENERGY_ROUNDOFF * sizes
        if moved <= ENERGY_ROUNDOFF * sizes and found.imbalance <= LAST_DIGITS * sizes:
            return 0.0
        return found.imbalance / exchanged if exchanged else found.imbalance
