"""Rows and their ranks -> the count of degrees of freedom, with names (3N - s; n - s with generalized coordinates).

Where the rank of the holonomic rows at the start is the rank they have at any point beside the surface, it is
constant nearby, and the constraints cut out a smooth surface of dimension n - rank. Where it is lower, a walk
over the surface looks for points where it is not: then the start is a special configuration, a crossing. Where
the rank stays lower wherever the constraints hold (three collinear particles with all their distances), the
rank proves nothing, and the count is undecided.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from lagcli import constraint_rows, diagnostics, rank
from lagcli.classification import Alone
from lagcli.compile import NumericSystem, curvature
from lagcli.constraint_rows import MetricRows
from lagcli.integrate import initial, projection
from lagcli.integrate.initial import State
from lagcli.mechanics.system import System

Floats = npt.NDArray[np.float64]
Proof = Literal["symbolic", "numeric", "none"]

POINTS = 4  # on the surface, besides the start
WALK_STEPS = 3
LATER = (0.001, 0.01)  # of the duration: soon, so that no other law has come to its end by then
# A row whose direction turns by TURN within TIP of the configuration's size stands at a tip of its surface.
TIP, TURN = 2e-12, 0.1
STEP, ASIDE = 0.2, 0.05  # of the size of the configuration
# Shorter steps would be within rounding of a singular surface, where the rank cannot be seen.
MAX_HALVINGS = 11
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


def count(system: System, numeric: NumericSystem, alone: Mapping[str, Alone]) -> DofCount:
    """Counts at the nearest consistent configuration. `alone`: verdict of each differential row, by row name.

    Raises `diagnostics.ModelError` where no consistent configuration is found.
    """
    state = initial.declared(system)
    state = initial.assemble(system, numeric, state, ()).state
    if not _is_finite(numeric, state):
        initial.inertia(system, numeric, state)  # says of which coordinate
    names = [row.name for row in system.rows.rows]
    s = system.holonomic_count
    integrable = [i for i in range(s, len(names)) if alone[names[i]] in ("exact", "integrable")]
    whole = [*range(s), *integrable]
    points = [state]
    on = beside = _ranks(numeric, points, whole)
    if on.highest[1] < len(names):  # rows that are independent at the start are so nearby
        beside = _ranks(numeric, _beside(system, state), whole)
    if not (_is_regular(numeric, state) and on.possible == on.highest == beside.possible):
        points = [state] if len(names) > constraint_rows.DENSE else _walk(numeric, state, whole)
        on = _ranks(numeric, points, whole)
    if on.highest[1] < len(names):
        _refuse_contradiction(system, numeric, state)
    doubt = _undecided_tip(numeric, state) or _undecided_rank(on, beside)
    reason = doubt or _undecided_rows(system, alone, points)
    generic = max(range(len(points)), key=lambda i: on.everything[i].low)
    flags = rank.redundant(_normalized_rows(numeric, points[generic]))
    n, (held, total) = system.symbols.q.numel(), on.highest
    decided = reason == ""
    return DofCount(
        particles=len(system.model.particle_names),
        coordinates=n,
        holonomic=held if decided else None,
        nonholonomic=total - held if decided else None,
        redundant=len(names) - total if decided else None,
        configuration_dof=n - held if decided else None,
        velocity_dof=n - total if decided else None,
        proof="numeric" if decided else "none",
        # Real surfaces may be smaller than n - rows (x**2 + y**2 = 0): where the rank proves nothing, neither
        # does the number of rows.
        bounds=(0, n - on.whole[0].low) if doubt else (n - total, n - held),
        reason=reason,
        redundant_rows=tuple(name for name, flag in zip(names, flags, strict=True) if flag and decided),
        start_rank=on.everything[0].value,
        notes=() if doubt else _notes(on),
    )


def _notes(on: _Ranks) -> tuple[str, ...]:
    here, total = on.everything[0].value, on.highest[1]
    if here is not None and here < total:
        return (f"the start is a special configuration: the rows have rank {here} there and {total} nearby",)
    return ()


def _undecided_tip(numeric: NumericSystem, state: State) -> str:
    """Whether gradients turn within next to nothing, as at the tip of a cone (`norm(u) = 0`)."""
    direction = np.random.default_rng(SEED).standard_normal(state.q.size)
    here = _normalized_rows(numeric, state)
    for side in (-TIP, TIP):
        there = dataclasses.replace(state, q=state.q + side * _size(state.q) * direction)
        if _is_finite(numeric, there) and _normalized_rows(numeric, there).turned_from(here) > TURN:
            return "the gradient of a constraint jumps at the start, so the rank there does not prove the dimension"
    return ""


def _undecided_rank(on: _Ranks, beside: _Ranks) -> str:
    if on.possible != on.highest:
        return "no gap in the singular values of the constraint rows decides their rank"
    for found, possible in zip(on.highest, beside.possible, strict=True):
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
            q = _surface(numeric, later).feasible(state.q)
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


def _undecided_rows(system: System, alone: Mapping[str, Alone], points: list[State]) -> str:
    """Why the differential rows leave the count open, or nothing."""
    open_rows = [name for name, verdict in alone.items() if verdict == "undecided"]
    if open_rows:
        return f"whether `{open_rows[0]}` is integrable is undecided"
    rows = [name for name, verdict in alone.items() if verdict == "nonholonomic"]
    if not rows:
        return ""
    if len(alone) > 1:
        names = ", ".join(f"`{name}`" for name in alone)
        return f"{names} are not all integrable alone, and whether they are jointly is not decided"
    if system.holonomic_count and not _obstructed(system, points):
        return f"`{rows[0]}` may be integrable on the surface of the holonomic constraints"
    return ""


def _obstructed(system: System, points: list[State]) -> bool:
    """Whether the one differential row is not integrable on the surface of the holonomic ones.

    With I = {df, omega} the derived flag drops omega where d omega does not vanish on the kernel of I:
    d omega(X, Y) = X^T (J - J^T) Y with J = d A / d(q, t), for X, Y in the kernel over (q, t).
    """
    of_row = curvature.function(system, system.rows.B.shape[0] - 1)
    for point in points:
        Omega, rows = (np.array(part) for part in of_row(point.t, point.q, point.v, point.p))
        size = np.abs(Omega).max(initial=0.0)
        if not (np.isfinite(rows).all() and 1e-300 < size < np.inf):
            continue
        basis = rank.null_basis(_unit(rows))
        if np.abs(basis.T @ (Omega / size) @ basis).max(initial=0.0) > rank.LARGE:
            return True
    return False


def _is_regular(numeric: NumericSystem, state: State) -> bool:
    """Whether Newton's method squares the residual at the start, as it does where the rank is constant."""
    return _surface(numeric, state).nearby(state.q) is not None


def _surface(numeric: NumericSystem, state: State) -> projection.Surface:
    return projection.Surface(numeric, state.t, state.p, initial.metric_at(numeric, state))


def _walk(numeric: NumericSystem, state: State, whole: list[int]) -> list[State]:
    """The start, and points of the surface that random tangent steps reach, each projected back."""
    random = np.random.default_rng(SEED)
    points = [state]
    for _ in range(POINTS):
        here: State | None = points[-1]
        for _ in range(WALK_STEPS):
            here = None if here is None else _tangent_step(numeric, here, whole, random)
        if here is None:
            break
        points.append(here)
    return points


def _tangent_step(
    numeric: NumericSystem, here: State, whole: list[int], random: np.random.Generator
) -> State | None:
    """The point after one random step along the kernel of the rows, as long as the curvature allows."""
    B = np.array(numeric.rows(here.t, here.q, here.v, here.p)[0])[whole]
    tangent = rank.null_basis(_unit(B))
    if tangent.shape[1] == 0:
        return here
    direction = tangent @ random.standard_normal(tangent.shape[1])
    step = STEP * _size(here.q) * direction / np.abs(direction).max()
    surface = _surface(numeric, here)
    for halvings in range(MAX_HALVINGS):
        there = surface.nearby(here.q + step / 2**halvings)
        if there is not None and _is_finite(numeric, dataclasses.replace(here, q=there)):
            return dataclasses.replace(here, q=there)
    return None


def _size(q: Floats) -> float:
    """How large the configuration is, or 1 where all of it is at zero."""
    return float(np.abs(q).max(initial=0.0)) or 1.0


def _beside(system: System, state: State) -> list[State]:
    """Points near the start that satisfy nothing, in time too, for the rank at generic points."""
    random = np.random.default_rng(SEED + 1)
    aside = ASIDE * _size(state.q)
    later = ASIDE * (system.model.simulation.duration or 1.0)
    found = [state]
    for _ in range(POINTS):
        q = state.q + aside * random.standard_normal(state.q.size)
        found.append(dataclasses.replace(state, q=q, t=state.t + later * random.random()))
    return found


def _ranks(numeric: NumericSystem, points: list[State], whole: list[int]) -> _Ranks:
    """Ranks at the points, of which the first is known to be finite."""
    found = _Ranks([], [])
    for point in points:
        if _is_finite(numeric, point):
            rows = _normalized_rows(numeric, point)
            found.everything.append(rank.rank(rows))
            complete = len(whole) == rows.count
            found.whole.append(found.everything[-1] if complete else rank.rank(rows.take(whole)))
    return found


def _is_finite(numeric: NumericSystem, point: State) -> bool:
    """Whether rows and inertia are finite at a point."""
    B = numeric.rows(point.t, point.q, point.v, point.p)[0]
    M = numeric.inertia(point.t, point.q, point.v, point.p)
    return bool(np.isfinite(B.nonzeros()).all() and np.isfinite(M.nonzeros()).all())


def _normalized_rows(numeric: NumericSystem, point: State) -> MetricRows:
    B = numeric.rows(point.t, point.q, point.v, point.p)[0]
    return MetricRows(B, initial.metric_at(numeric, point))


def _unit(rows: Floats) -> Floats:
    """Rows of length one; a row that vanishes stays zero."""
    largest = np.abs(rows).max(axis=1, initial=0.0)
    scaled = rows / np.where(largest > 0, largest, 1.0)[:, None]  # squares of large numbers overflow
    lengths = np.linalg.norm(scaled, axis=1)
    return np.asarray(scaled / np.where(lengths > 0, lengths, 1.0)[:, None])
