"""Rows and their ranks -> the count of degrees of freedom, with names (3N - s; n - s with generalized coordinates).

s is the codimension of the surface of the holonomic rows (`codimension`), or that nearby where the start is a special
configuration; differential rows that can be integrated add to it.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
from typing import Any, Literal

import numpy as np

from lagcli import doubles, progress
from lagcli.analysis import codimension
from lagcli.analysis.classification.verdict import Classification
from lagcli.analysis.codimension import Codimension
from lagcli.compiled import NumericSystem, row_block
from lagcli.equations import kinks, size_limits
from lagcli.equations.system import System
from lagcli.frozen import frozen_value
from lagcli.linear import decompositions, metric_rows, rank
from lagcli.model.model import Model, ParticleForce
from lagcli.smoothness import sides
from lagcli.start import initial, projection
from lagcli.start.initial import State

Proof = Literal["symbolic", "numeric", "none"]

# A row whose direction turns by TURN within a rounding of the configuration's size stands at a tip of its surface.
TURN = 0.1
SEED = 20061


@frozen_value
class DofCount:
    """The count. Where it is undecided, `configuration_dof` is None, `reason` says why, and `bounds` holds it.

    particles N, coordinates n (3N for Cartesian particles only), holonomic s, nonholonomic m, redundant r:
    configuration_dof = n - s, velocity_dof = n - s - m. `redundant_rows` names rows that follow from rows before
    them, but none whose rank is below their codimension. `start_rank` is the rank of all rows at the start itself;
    `rows` the number of holonomic and rigid rows, `rank` theirs at generic points of their surface; `contacts` the
    number of one-sided constraints, which are not counted.
    """

    particles: int
    coordinates: int
    holonomic: int | None
    nonholonomic: int | None
    redundant: int | None
    configuration_dof: int | None
    velocity_dof: int | None
    proof: Proof
    bounds: tuple[int, int]
    reason: str = ""
    redundant_rows: tuple[str, ...] = ()
    start_rank: int | None = 0
    notes: tuple[str, ...] = ()
    rows: int = 0
    rank: int = 0
    contacts: int = 0

    def __repr__(self) -> str:
        low, high = self.bounds
        freedoms = f"{low} to {high}, undecided" if self.configuration_dof is None else self.configuration_dof
        counts = (("s", self.holonomic), ("m", self.nonholonomic), ("redundant", self.redundant))
        shown = ", ".join(f"{name} = {count}" for name, count in counts)
        return f"<DofCount: {freedoms}; n = {self.coordinates}, {shown}; proof {self.proof}>"

    def as_json(self) -> dict[str, Any]:
        """The object of `dof --json`."""
        names = "particles coordinates holonomic nonholonomic redundant configuration_dof velocity_dof proof".split()
        return {**{name: getattr(self, name) for name in names}, "notes": list(self.notes)}


@frozen_value
class _Ranks:
    """Ranks of the rows that count as holonomic and of all rows, over points on the surface and beside it."""

    of_holonomic: list[rank.Rank]
    everything: list[rank.Rank]

    @property
    def highest(self) -> tuple[int, int]:
        """The ranks at generic points: the highest that are certain."""
        return max(r.low for r in self.of_holonomic), max(r.low for r in self.everything)

    @property
    def possible(self) -> tuple[int, int]:
        """The highest ranks that cannot be excluded."""
        return max(r.high for r in self.of_holonomic), max(r.high for r in self.everything)


@frozen_value
class Examined:
    """The count, what is known of the surface of the holonomic rows, points of it, the start first, and the verdicts,
    without those that such a surface leaves open."""

    count: DofCount
    surface: Codimension
    points: list[State]
    found: Classification


@progress.phase("counting degrees of freedom")
def examine(system: System, numeric: NumericSystem, begin: State, found: Classification) -> Examined:
    """Counts at a consistent configuration, with the verdicts on the differential rows. Raises `diagnostics.ModelError`
    where rows contradict each other."""
    names = [row.name for row in system.rows.rows]
    # Of a row that vanishes identically numbers see its rounding.
    vanishing_rows = {name for group in found.groups for name in group.vanishing}
    effective = [i for i, name in enumerate(names) if name not in vanishing_rows]
    holonomic_rows = list(range(system.holonomic_count))
    is_holonomic = len(holonomic_rows) == len(names)
    lost = {i for group in found.groups for i, name in enumerate(names) if name in group.lost}
    ranks = functools.partial(_ranks, numeric, holonomic_rows=holonomic_rows, effective=effective, lost=lost)
    points, vanishing = [begin], ""
    on = ranks(points)
    surface = codimension.examine(system, numeric, begin)
    is_singular, s = surface.kind == "singular", surface.codimension or 0
    if surface.kind == "deficient" and not is_holonomic:
        # Verdicts on differential rows beside these came from more directions than the surface has.
        numbers, coordinates = row_block.coordinates(system)
        among = np.isin(coordinates, surface.coordinates) & (numbers >= system.holonomic_count)
        beside = frozenset(names[i] for i in numbers[among].tolist())
        rows = initial.names_of(system, surface.rows)
        why = f"it meets coordinates of the rows {rows}, whose gradients leave more directions than there are"
        found = found.doubted(beside, why)
    # Whether differential rows follow from rows before them, where doubles tell another rank than algebra and digits.
    known = [] if found.undecided else [group for group in found.groups if group.following is not None]
    exact = {name: name in (group.following or ()) for group in known for name in group.rows}

    # Rows that are independent at the start are so nearby; of others generic points tell.
    if any(exact.values()) if exact else on.highest[1] < len(effective):
        from lagcli.start import conflict  # here, as the rows of most models are independent

        # Differential rows may have another rank along the motions from the start than at it.
        here, holonomic = on.everything[0].value, on.of_holonomic[0].value
        is_lost = bool(found.groups)
        if not found.undecided and here is not None and holonomic is not None:
            is_lost = found.flag[0] != here - holonomic
        is_lost = is_lost and surface.kind != "deficient" and not exact
        if (is_lost or is_singular) and len(names) <= metric_rows.PARAMETERS.dense:
            points = _generic(system, numeric, begin, holonomic_rows, 0.0)
            on = ranks(points)
            # What rows that lose rank at the start say of motions that stay where they do, and of those that come away,
            # differs: from the origin x d(y) = y d(x) leads along every ray.
            if not is_singular and on.everything[0].high < on.highest[1]:
                vanishing = (
                    f"the start is a special configuration: the rows have rank {on.everything[0].high} there and"
                    f" {on.highest[1]} nearby, and motions that stay on such configurations need not be those that"
                    " leave them"
                )
            # The time of the start may be special too (t d(y) = 0 at t = 0): that all motions leave.
            later = initial.later(system) if found.depends_on_time else 0.0
            if later:
                points = _generic(system, numeric, begin, holonomic_rows, later)
        on = ranks(points)
        # Of some rows algebra has shown that no combination of them and of others is a multiple of dt.
        groups = (one for one in found.groups if one.proof == "symbolic" or one.holonomic_rank)
        proved = {name for group in groups for name in group.rows}
        proved_rows = frozenset(i for i, name in enumerate(names) if name in proved)
        conflict.require_lasting(system, numeric, begin, proved_rows)
    if lost and not vanishing and on.highest[1] <= on.everything[0].high:
        vanishing = (
            f"`{names[min(lost)]}` vanishes at the start, and no point was found nearby where it does not"
        )

    # Why the count is open: by the surface or ranks, in which `exact` rows are not asked of doubles, ...
    open_reason = surface.reason or _undecided_tip(numeric, begin, holonomic_rows) or vanishing
    if not open_reason:
        generic = surface.rank if surface.kind == "deficient" else surface.codimension
        if on.possible[0] != on.highest[0] or (on.possible != on.highest and not exact):
            open_reason = "no gap in the singular values of the constraint rows decides their rank"
        elif not (is_singular and is_holonomic) and on.highest[0] != generic:
            open_reason = f"the holonomic rows have rank {on.highest[0]} where rank {generic} is proved"
    # ... or by the differential rows
    rank_beyond = found.flag[0] if exact else on.highest[1] - on.highest[0]
    reason = open_reason or _undecided_rows(found, rank_beyond)

    # Its bounds: rows of undecided groups may be integrable or not. Ranks by numbers and by algebra may differ.
    n, total = system.symbols.q.numel(), s + rank_beyond
    decided_flags = [group.flag for group in found.groups if group.is_decided]
    ends = (
        n - total + sum(flag[0] - flag[-1] for flag in decided_flags),
        n - s - sum(flag[-1] for flag in decided_flags),
    )
    bounds = min(ends), max(ends)
    if any(group.may_demand for group in found.undecided):
        # A condition g = 0 is a row that no rank has seen, and its differential may demand others.
        bounds = 0, max(ends)
    if open_reason:
        # Real surfaces may be smaller than n - rows (x**2 + y**2 = 0): where the rank proves nothing, neither does the
        # number of rows.
        bounds = 0, n - on.of_holonomic[0].low
    elif bounds[0] == bounds[1]:
        reason = ""  # whichever of the rows are integrable
    decided, holonomic_count = reason == "", n - bounds[1]

    # What is said of it
    here, nearby = on.everything[0].value, s + rank_beyond if is_singular else on.highest[1]
    notes = [*surface.notes, *dict.fromkeys(note for group in found.groups for note in group.notes)]
    if here is not None and here < nearby:
        special = "the start is a special configuration: the rows have rank"
        notes.insert(0, f"{special} {here} there and {nearby} nearby")
    best = max(range(len(points)), key=lambda i: on.everything[i].low)
    follow = _redundant(numeric, points[best], effective, surface)
    redundant = [i for i, name in enumerate(names) if exact.get(name, i in follow)]
    # Ranks are numbers, but for those of holonomic rows that exact algebra has met on its way.
    is_exact = sum(group.holonomic_rank for group in found.groups) == surface.codimension
    is_proved = bool(found.groups) and is_exact and all(one.proof == "symbolic" for one in found.groups)
    proof: Proof = "symbolic" if is_proved else "numeric"
    counted = DofCount(
        particles=len(system.model.particle_names),
        coordinates=n,
        holonomic=holonomic_count if decided else None,
        nonholonomic=total - holonomic_count if decided else None,
        redundant=max(len(names) - total, len(redundant)) if decided else None,
        configuration_dof=n - holonomic_count if decided else None,
        velocity_dof=n - total if decided else None,
        proof=proof if decided else "none",
        bounds=bounds,
        reason=reason,
        redundant_rows=tuple(names[i] for i in redundant if decided),
        start_rank=on.everything[0].value,
        notes=() if open_reason else tuple(notes),
        rows=len(holonomic_rows),
        rank=s if is_singular else surface.rank,
        contacts=system.contacts.count,
    )
    return Examined(counted, surface, points, found)


def _undecided_rows(found: Classification, rank_beyond: int) -> str:
    """The reason why the differential rows leave the count open, or an empty text."""
    for group in found.undecided[:1]:
        rows = ", ".join(f"`{name}`" for name in group.rows)
        verb = "is" if len(group.rows) == 1 else "are"
        return f"whether {rows} {verb} integrable is undecided: {group.reason}"
    if found.flag[0] == rank_beyond:
        return ""
    return f"the differential rows have rank {found.flag[0]} by algebra and {rank_beyond} by numbers"


def _redundant(numeric: NumericSystem, point: State, effective: list[int], surface: Codimension) -> set[int]:
    """The rows that follow from rows before them, at a generic point."""
    from lagcli.linear import independent_rows  # here, as a walk over few rows asks nothing of it

    rows = projection.plain_rows(numeric, point)
    flags, among = np.ones(rows.count, dtype=bool), rows.take(effective)
    found = rank.estimate(among).value if among.is_large else None
    if found is None:
        flags[effective] = independent_rows.redundant(among)
    else:
        following = independent_rows.dependence(among, found).following()
        flags[effective] = np.isin(np.arange(among.count), following)
    holonomic_rank = int(np.count_nonzero(~flags[: numeric.holonomic.size1_out(0)]))
    if holonomic_rank < (surface.codimension or 0):
        # Rows whose gradients depend on others there hold the surface all the same.
        flags[list(surface.rows)] = False
        flags[list(surface.follow)] = True
    return set(np.flatnonzero(flags).tolist())


def _generic(
    system: System, numeric: NumericSystem, begin: State, holonomic_rows: list[int], later: float
) -> list[State]:
    """The start, and points of the surface that lie on its side of all branches of the rows."""
    from lagcli.compiled.row_block import RowBlock

    block = RowBlock(system, range(len(system.rows.rows)))
    # Ever nearer to a start that stands close to another branch of its rows
    for shorter in range(4):
        part = 0.5 ** (2 * shorter)
        found = projection.along(
            numeric, begin, holonomic_rows, part * later, step=part * projection.PARAMETERS.step
        )
        points = [np.append(one.q[block.columns], [one.t] if block.has_time else []) for one in found]
        for k, (one, other) in enumerate(itertools.pairwise(points), start=1):
            if block.pieces.end_between(np.linspace(one, other, 24), begin.p):
                found = found[:k]
                break
        if len(found) > 1:
            break
    return found


def _undecided_tip(numeric: NumericSystem, state: State, holonomic_rows: list[int]) -> str:
    """Say that gradients turn within next to nothing, as at the tip of a cone (`norm(u) = 0`) or where they nearly
    vanish, or nothing."""
    direction = decompositions.generic_direction(state.q.size, SEED)
    # Where a gradient vanishes second derivatives have been looked at (`codimension`).
    gradients = metric_rows.LocalRows(numeric.holonomic(state.t, state.q, state.p)[1])
    holonomic_rows = [i for i in holonomic_rows if gradients.norms[i] > 0]
    here = projection.plain_rows(numeric, state).take(holonomic_rows)
    far = sides.PARAMETERS.farther * doubles.VALUE
    sizes = kinks.coordinate_sizes(state.q, gradients.row, gradients.column, gradients.count)
    beside = [
        dataclasses.replace(state, q=state.q + side * sizes * direction)
        for side in (-far, -doubles.VALUE, doubles.VALUE, far)
    ]
    for there in beside[1:3]:
        if not projection.is_finite(numeric, there):
            continue
        turned = projection.plain_rows(numeric, there).take(holonomic_rows).unit - here.unit
        if np.abs(metric_rows.LocalRows(turned).values).max(initial=0.0) > TURN:
            rows = [metric_rows.LocalRows(numeric.holonomic(at.t, at.q, at.p)[1]) for at in beside]
            what = "jumps at the start"
            if not sides.Sides(tuple(each.values for each in rows)).jumps().any():
                what = (
                    f"turns within {doubles.VALUE:.0e} of the size of the start, as beside where it vanishes"
                )
            return f"the gradient of a constraint {what}, so the rank there does not prove the dimension"
    return ""


def _ranks(
    numeric: NumericSystem,
    points: list[State],
    holonomic_rows: list[int],
    effective: list[int],
    lost: set[int],
) -> _Ranks:
    """Ranks of the holonomic rows and of all effective ones, at the points; the first, the start, is known to be
    finite, and rows that are lost vanish there, though doubles leave rounding of them."""
    found = _Ranks([], [])
    for k, point in enumerate(points):
        if projection.is_finite(numeric, point):
            rows = projection.plain_rows(numeric, point)
            some = [i for i in effective if k or i not in lost]
            rows = rows if len(some) == rows.count else rows.take(some)
            whole = rank.estimate(rows)
            found.everything.append(whole)
            complete = len(holonomic_rows) == rows.count
            found.of_holonomic.append(whole if complete else rank.estimate(rows.take(holonomic_rows)))
    return found


def are_free_particles(model: Model) -> bool:
    """True if a model has particles alone, free ones, and at most constant forces on them."""
    return (
        not any(size_limits.rows(law) for law in model.constraints())
        and not (model.coordinates or model.outputs or model.lagrangian)
        and all(isinstance(force, ParticleForce) and force.constant for force in model.forces)
        and all(
            p.start is not None and np.isfinite(p.mass_values).all() and np.isfinite(p.start).all()
            for p in model.particles
        )
    )


def of_free_particles(model: Model) -> DofCount:
    """The count of a model of free particles: 3N, whatever acts on them, so that no equation need be built."""
    particles = sum(p.members.count for p in model.particles)
    n = 3 * particles
    return DofCount(
        particles=particles,
        coordinates=n,
        holonomic=0,
        nonholonomic=0,
        redundant=0,
        configuration_dof=n,
        velocity_dof=n,
        proof="numeric",
        bounds=(n, n),
    )
