"""Rows and their ranks -> the count of degrees of freedom, with names (3N - s; n - s with generalized coordinates).

The rank of the holonomic rows is taken at several points of the constraint surface that a walk from the start
reaches, and at points beside it. Where it is higher beside the surface than on it (three collinear particles
with all their distances), the rank on the surface proves nothing, and the count is undecided.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, Literal

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli import rank
from lagcli.classification import Alone
from lagcli.compile import NumericSystem
from lagcli.integrate import initial, projection
from lagcli.integrate.initial import State
from lagcli.mechanics.system import System

Floats = npt.NDArray[np.float64]
Proof = Literal["symbolic", "numeric", "none"]

POINTS = 4  # on the surface, besides the start
WALK_STEPS = 3
STEP, ASIDE = 0.12, 0.05  # of the size of the configuration
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
    """Ranks over points: of the rows that count as holonomic on the surface and beside it, and of all rows."""

    whole: list[rank.Rank]
    aside: list[rank.Rank]
    everything: list[rank.Rank]


def count(system: System, numeric: NumericSystem, alone: Mapping[str, Alone]) -> DofCount:
    """Counts at the nearest consistent configuration. `alone`: verdict of each differential row, by row name.

    Raises `diagnostics.ModelError` where no consistent configuration is found.
    """
    state = initial.declared(system)
    initial.inertia(system, numeric, state)
    state = initial.assemble(system, numeric, state, ()).state
    names = [row.name for row in system.rows.rows]
    s = system.holonomic_count
    integrable = [i for i in range(s, len(names)) if alone[names[i]] in ("exact", "integrable")]
    whole = [*range(s), *integrable]
    points = _walk(numeric, state, whole)
    ranks = _ranks(numeric, state, points, whole)
    on, total = _highest(ranks.whole), _highest(ranks.everything)
    reason = _undecided_rank(ranks, on) or _undecided_rows(system, numeric, alone, points, state)
    n = system.symbols.q.numel()
    flags = _redundant(numeric, points[-1], state)
    redundant_rows = tuple(name for name, flag in zip(names, flags, strict=True) if flag)
    decided = reason == ""
    return DofCount(
        particles=len(system.model.particles),
        coordinates=n,
        holonomic=on if decided else None,
        nonholonomic=total - on if decided else None,
        redundant=len(names) - total if decided else None,
        configuration_dof=n - on if decided else None,
        velocity_dof=n - total if decided else None,
        proof="numeric" if decided else "none",
        bounds=(max(0, n - max(total, _highest(ranks.aside))), n - on),
        reason=reason,
        redundant_rows=redundant_rows,
        start_rank=ranks.everything[0].value,
        notes=_notes(ranks, total),
    )


def _highest(ranks: list[rank.Rank]) -> int:
    """The rank at generic points: the highest that is certain."""
    return max((r.low for r in ranks), default=0)


def _notes(ranks: _Ranks, total: int) -> tuple[str, ...]:
    at_start = ranks.everything[0].value
    if at_start is not None and at_start < total:
        return (
            f"the start is a special configuration: the rows have rank {at_start} there and {total} nearby",
        )
    return ()


def _undecided_rank(ranks: _Ranks, on: int) -> str:
    if any(r.high > _highest(group) for group in (ranks.whole, ranks.everything) for r in group):
        return "no gap in the singular values of the constraint rows decides their rank"
    off = max((r.high for r in ranks.aside), default=0)
    if off > on:
        return (
            f"the rows have rank {on} wherever the constraints hold and {off} beside it,"
            " so the rank does not prove the dimension"
        )
    return ""


def _undecided_rows(
    system: System, numeric: NumericSystem, alone: Mapping[str, Alone], points: list[State], state: State
) -> str:
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
    s = system.symbols
    row = system.rows.B.shape[0] - 1
    A = ca.densify(ca.horzcat(system.rows.B[row, :], system.rows.b[row]).T)
    J = ca.jacobian(A, ca.vertcat(s.q, s.t))
    everything = ca.densify(ca.horzcat(system.rows.B, system.rows.b))
    curvature = ca.Function("curvature", [s.t, s.q, s.v, system.p], [J - J.T, everything])
    for point in points:
        Omega, rows = (np.array(part) for part in curvature(point.t, point.q, point.v, point.p))
        basis = rank.null_basis(rank.normalized(rows, np.eye(rows.shape[1])))
        value = np.abs(basis.T @ Omega @ basis).max(initial=0.0)
        if value > rank.LARGE * max(1e-300, np.abs(Omega).max(initial=0.0)):
            return True
    return False


def _scales(system_size: int, q: Floats) -> Floats:
    """How far coordinates may be moved to stay near: the size of the configuration, or 1 at zero."""
    largest = float(np.abs(q).max(initial=0.0))
    return np.full(system_size, largest if largest > 0 else 1.0)


def _walk(numeric: NumericSystem, state: State, whole: list[int]) -> list[State]:
    """Points of the surface that a walk from the start reaches: random tangent steps, each projected back."""
    random = np.random.default_rng(SEED)
    points = [state]
    scale = _scales(state.q.size, state.q)
    for _ in range(POINTS):
        here = points[-1]
        for _ in range(WALK_STEPS):
            here = _tangent_step(numeric, here, whole, scale, random) or here
        points.append(here)
    return points


def _tangent_step(
    numeric: NumericSystem, here: State, whole: list[int], scale: Floats, random: np.random.Generator
) -> State | None:
    M = np.array(numeric.inertia(here.t, here.q, here.v, here.p))
    B = np.array(numeric.rows(here.t, here.q, here.v, here.p)[0])[whole]
    if not (np.isfinite(M).all() and np.isfinite(B).all()):
        return None
    tangent = rank.null_basis(rank.normalized(B, np.eye(B.shape[1])))
    if tangent.shape[1] == 0:
        return None
    direction = tangent @ random.standard_normal(tangent.shape[1])
    step = STEP * scale * direction / np.linalg.norm(direction) * np.sqrt(direction.size / 3)
    try:
        q = projection.Surface(numeric, here.t, here.p, np.eye(here.q.size)).feasible(here.q + step)
    except projection.NoConfiguration:
        return None
    return dataclasses.replace(here, q=q)


def _ranks(numeric: NumericSystem, state: State, points: list[State], whole: list[int]) -> _Ranks:
    random = np.random.default_rng(SEED + 1)
    scale = _scales(state.q.size, state.q)
    found = _Ranks([], [], [])
    for point in points:
        rows = _normalized_rows(numeric, point)
        if rows is None:
            continue
        found.whole.append(rank.rank(rows[whole]))
        found.everything.append(rank.rank(rows))
        beside = dataclasses.replace(point, q=point.q + ASIDE * scale * random.standard_normal(point.q.size))
        rows = _normalized_rows(numeric, beside)
        if rows is not None:
            found.aside.append(rank.rank(rows[whole]))
    return found


def _normalized_rows(numeric: NumericSystem, point: State) -> Floats | None:
    """Rows at a point, or None where they or the inertia are not finite or not definite there."""
    B = np.array(numeric.rows(point.t, point.q, point.v, point.p)[0])
    M = np.array(numeric.inertia(point.t, point.q, point.v, point.p))
    if not (np.isfinite(B).all() and np.isfinite(M).all()):
        return None
    try:
        return rank.normalized(B, M)
    except np.linalg.LinAlgError:
        return None


def _redundant(numeric: NumericSystem, point: State, state: State) -> npt.NDArray[np.bool_]:
    rows = _normalized_rows(numeric, point)
    if rows is None:
        rows = _normalized_rows(numeric, state)
    assert rows is not None  # the start was checked to be finite
    return rank.redundant(rows)
