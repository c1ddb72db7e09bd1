"""Rows and their ranks -> the count of degrees of freedom, with names (3N - s; n - s with generalized coordinates).

Where the rank of the holonomic rows at the start is the rank they have at any point beside the surface, it is
constant nearby, and the constraints cut out a smooth surface of dimension n - rank. Where it is lower, a walk
over the surface looks for points where it is not: then the start is a special configuration, a crossing. Where
the rank stays lower wherever the constraints hold (three collinear particles with all their distances), the
rank proves nothing, and the count is undecided.
"""

from __future__ import annotations

import dataclasses
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from lagcli import constraint_rows, diagnostics, rank, walk
from lagcli.classification.verdict import Classification
from lagcli.compile import NumericSystem
from lagcli.constraint_rows import MetricRows
from lagcli.integrate import initial, projection
from lagcli.integrate.initial import State
from lagcli.mechanics.system import System

Floats = npt.NDArray[np.float64]
Proof = Literal["symbolic", "numeric", "none"]

LATER = (0.001, 0.01)  # of the duration: soon, so that no other law has come to its end by then
# A row whose direction turns by TURN within TIP of the configuration's size stands at a tip of its surface.
TIP, TURN = 2e-12, 0.1
SEED = 20061


@dataclasses.dataclass(frozen=True, slots=True)
class DofCount:
    """The count. Where it is undecided, `configuration_dof` is None, `reason` says why, and `bounds` holds it.

    particles N, coordinates n (3N for Cartesian particles only), holonomic s, nonholonomic m, redundant r:
    configuration_dof = n - s, velocity_dof = n - s - m. `redundant_rows` names rows that follow from rows before
    them; `start_rank` is the rank of all rows at the start itself.
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
    reason: str
    redundant_rows: tuple[str, ...]
    start_rank: int | None
    notes: tuple[str, ...]

    def as_json(self) -> dict[str, Any]:
        """The object of `dof --json`."""
        return {
            "particles": self.particles,
            "coordinates": self.coordinates,
            "holonomic": self.holonomic,
            "nonholonomic": self.nonholonomic,
            "redundant": self.redundant,
            "configuration_dof": self.configuration_dof,
            "velocity_dof": self.velocity_dof,
            "proof": self.proof,
        }


@dataclasses.dataclass(frozen=True, slots=True)
class _Ranks:
    """Ranks of the rows that count as holonomic and of all rows, over points on the surface and beside it."""

    whole: list[rank.Rank]
    everything: list[rank.Rank]

    @property
    def highest(self) -> tuple[int, int]:
        """The ranks at generic points: the highest that are certain."""
        return max(r.low for r in self.whole), max(r.low for r in self.everything)

    @property
    def possible(self) -> tuple[int, int]:
        """The highest ranks that cannot be excluded."""
        return max(r.high for r in self.whole), max(r.high for r in self.everything)


def count(system: System, numeric: NumericSystem, begin: State, found: Classification) -> DofCount:
    """Counts at a consistent configuration, with the verdicts on the differential rows.

    Raises `diagnostics.ModelError` where rows contradict each other.
    """
    names = [row.name for row in system.rows.rows]
    # Of a row that vanishes identically numbers see its rounding.
    said = [i for i, name in enumerate(names) if name not in found.vanishing]
    whole = list(range(system.holonomic_count))
    points = [begin]
    on = beside = _ranks(numeric, points, whole, said)
    if on.highest[1] < len(said):  # rows that are independent at the start are so nearby
        beside = _ranks(numeric, walk.beside(system, begin), whole, said)
    # The time of the start may be special too (t d(y) = 0 at t = 0).
    later = LATER[-1] * (system.model.simulation.duration or 1.0) if found.depends_on_time else 0.0
    is_moving = later > 0.0 and on.highest[1] < len(said)
    if is_moving or not (walk.is_regular(numeric, begin) and on.possible == on.highest == beside.possible):
        points = [begin] if len(names) > constraint_rows.DENSE else walk.along(numeric, begin, whole, later)
        on = _ranks(numeric, points, whole, said)
    if on.highest[1] < len(said):
        _refuse_contradiction(system, numeric, begin)
    surface, total = on.highest
    doubt = _undecided_tip(numeric, begin, whole) or _undecided_rank(on, beside)
    reason = doubt or _undecided_rows(found, total - surface)
    generic = max(range(len(points)), key=lambda i: on.everything[i].low)
    flags = np.ones(len(names), dtype=bool)
    flags[said] = rank.redundant(_normalized_rows(numeric, points[generic]).take(said))
    n, decided = system.symbols.q.numel(), reason == ""
    held = surface + (found.flag[-1] if decided else 0)
    return DofCount(
        particles=len(system.model.particle_names),
        coordinates=n,
        holonomic=held if decided else None,
        nonholonomic=total - held if decided else None,
        redundant=len(names) - total if decided else None,
        configuration_dof=n - held if decided else None,
        velocity_dof=n - total if decided else None,
        proof=_proof(found, surface) if decided else "none",
        # Real surfaces may be smaller than n - rows (x**2 + y**2 = 0): where the rank proves nothing, neither
        # does the number of rows.
        bounds=(0, n - on.whole[0].low) if doubt else _bounds(n, surface, total, found),
        reason=reason,
        redundant_rows=tuple(name for name, flag in zip(names, flags, strict=True) if flag and decided),
        start_rank=on.everything[0].value,
        notes=() if doubt else (*_notes(on), *found.notes),
    )


def _bounds(n: int, surface: int, total: int, found: Classification) -> tuple[int, int]:
    """What is known without the groups that are undecided: their rows may be integrable or not."""
    decided = [group.flag for group in found.groups if group.is_decided]
    integrable, other = sum(flag[-1] for flag in decided), sum(flag[0] - flag[-1] for flag in decided)
    return n - total + other, n - surface - integrable


def _proof(found: Classification, surface: int) -> Proof:
    """Ranks are numbers, but for those of holonomic rows that exact algebra has met on its way."""
    known = sum(group.held for group in found.groups)
    is_exact = known == surface and all(group.proof == "symbolic" for group in found.groups)
    return "symbolic" if is_exact and found.groups else "numeric"


def _undecided_rows(found: Classification, rank_beyond: int) -> str:
    """Why the differential rows leave the count open, or nothing."""
    for group in found.undecided:
        rows = ", ".join(f"`{name}`" for name in group.rows)
        verb = "is" if len(group.rows) == 1 else "are"
        return f"whether {rows} {verb} integrable is undecided: {group.reason}"
    if found.flag[0] != rank_beyond:
        return f"the differential rows have rank {found.flag[0]} by algebra and {rank_beyond} by numbers"
    return ""


def _notes(on: _Ranks) -> tuple[str, ...]:
    here, total = on.everything[0].value, on.highest[1]
    if here is not None and here < total:
        return (f"the start is a special configuration: the rows have rank {here} there and {total} nearby",)
    return ()


def _undecided_tip(numeric: NumericSystem, state: State, whole: list[int]) -> str:
    """Whether gradients turn within next to nothing, as at the tip of a cone (`norm(u) = 0`)."""
    direction = np.random.default_rng(SEED).standard_normal(state.q.size)
    here = _normalized_rows(numeric, state).take(whole)
    for side in (-TIP, TIP):
        there = dataclasses.replace(state, q=state.q + side * walk.size(state.q) * direction)
        if (
            walk.is_finite(numeric, there)
            and _normalized_rows(numeric, there).take(whole).turned_from(here) > TURN
        ):
            return "the gradient of a constraint jumps at the start, so the rank there does not prove the dimension"
    return ""


def _undecided_rank(on: _Ranks, beside: _Ranks) -> str:
    if on.possible != on.highest:
        return "no gap in the singular values of the constraint rows decides their rank"
    found, possible = on.highest[0], beside.possible[0]
    if possible > found:
        return (
            f"the rows have rank {found} wherever the constraints hold and {possible} beside it,"
            " so the rank does not prove the dimension"
        )
    return ""


def _refuse_contradiction(system: System, numeric: NumericSystem, state: State) -> None:
    """Redundant rows that move must move alike: raise `diagnostics.ModelError` where they part at later times.

    At two later times the nearest configuration is sought, and velocities for it; what stays violated cannot be
    satisfied together with the others (a.x = t and a.x = sin(t)).
    """
    for part in LATER:
        t = state.t + part * (system.model.simulation.duration or 1.0)
        later = dataclasses.replace(state, t=t)
        try:
            q = walk.surface(numeric, later).feasible(state.q)
        except projection.NoConfiguration as failure:
            q = failure.q
        later = dataclasses.replace(later, q=q)
        B, b = numeric.rows(t, q, state.v, state.p)
        if not np.isfinite(B.nonzeros()).all() or not np.array(b).any():
            continue
        v = projection.velocity(np.zeros(q.size), B, np.array(b).ravel(), initial.metric_at(numeric, later))
        broken = initial.residuals(system, numeric, dataclasses.replace(later, v=v)).violated
        if broken:
            names = initial.names_of(system, broken)
            message = f"{names} cannot be satisfied together with the other rows: at t = {t:.6g} they part"
            location = system.rows.rows[broken[0]].location
            raise diagnostics.ModelError(
                [diagnostics.Diagnostic("contradictory-constraints", message, location)]
            )


def _ranks(numeric: NumericSystem, points: list[State], whole: list[int], said: list[int]) -> _Ranks:
    """Ranks of the holonomic rows and of all that say something, at the points; the first is known to be finite."""
    found = _Ranks([], [])
    for point in points:
        if walk.is_finite(numeric, point):
            rows = _normalized_rows(numeric, point)
            rows = rows if len(said) == rows.count else rows.take(said)
            found.everything.append(rank.rank(rows))
            complete = len(whole) == rows.count
            found.whole.append(found.everything[-1] if complete else rank.rank(rows.take(whole)))
    return found


def _normalized_rows(numeric: NumericSystem, point: State) -> MetricRows:
    B = numeric.rows(point.t, point.q, point.v, point.p)[0]
    return MetricRows(B, initial.metric_at(numeric, point))
