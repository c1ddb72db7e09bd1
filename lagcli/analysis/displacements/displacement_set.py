"""The displacements at an instant, as a whole."""

from __future__ import annotations

import dataclasses
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli.analysis.displacements import bases, components, internal_forces
from lagcli.analysis.displacements.bases import Bases
from lagcli.analysis.displacements.components import Components
from lagcli.analysis.displacements.internal_forces import Internal
from lagcli.compiled import NumericSystem
from lagcli.equations.system import System
from lagcli.start.assembly_moves import Moves
from lagcli.start.initial import State

Floats = npt.NDArray[np.float64]

# A basis of so many coordinates has some ten million numbers.
MOST_COORDINATES = 4000


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Displacements:
    """Allowed and virtual displacements at the time t and the configuration q (n,) that moves with v (n,).

    virtual_r (N, 3, n - rank) and allowed_r (N, 3): the same of the particles, dr_k = sum_j dr_k/dq_j dq_j (D.28),
    and dr_k/dt for dt = 1. assembled: what assembly changed in the start; notes: initial velocities that violate rows.
    """

    t: float
    q: Floats
    v: Floats
    particles: tuple[str, ...]
    bases: Bases
    virtual_r: Floats
    allowed_r: Floats
    components: Components
    internal: tuple[Internal, ...]
    assembled: Moves | None = None
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return (
            f"<Displacements at t = {self.t:g}: {self.bases.dimension} virtual, of {self.q.size} coordinates and"
            f" {self.bases.rows} rows>"
        )

    def as_json(self) -> dict[str, Any]:
        """The object of `displacements --json`."""
        found, parts = self.bases, self.components
        named = [{"name": n, "number": k} for n, k in zip(parts.names, parts.numbers, strict=True)]
        assembled = {} if self.assembled is None else {"assembled": self.assembled.as_json()}
        return {
            **assembled,
            "t": self.t,
            "coordinates": list(parts.names),
            "q": self.q.tolist(),
            "v": self.v.tolist(),
            "rows": found.rows,
            "rank": found.rank,
            "dimension": found.dimension,
            "metric": found.metric,
            "virtual": found.virtual.T.tolist(),
            "allowed": {"dt": 1.0, "displacement": found.allowed.tolist()},
            "residual": found.residual,
            "allowed_residual": found.allowed_residual,
            "particles": {
                name: {"virtual": self.virtual_r[k].T.tolist(), "allowed": self.allowed_r[k].tolist()}
                for k, name in enumerate(self.particles)
            },
            "dependent": [named[i] for i in parts.dependent],
            "independent": [named[i] for i in parts.independent],
            "T": parts.T.tolist(),
            "tau": parts.tau.tolist(),
            "internal_forces": [
                {**dataclasses.asdict(one), "central": one.is_central} for one in self.internal
            ],
        }


def displacements(system: System, numeric: NumericSystem, state: State) -> Displacements:
    """The displacements at a state whose configuration satisfies the rows; its velocities enter forces alone."""
    found = bases.bases(numeric, state)
    s, model = system.symbols, system.model
    J = ca.Function("J", [s.t, s.q, s.p], [ca.jacobian(system.r, s.q), ca.jtimes(system.r, s.t, ca.SX(1))])
    slope, drift = (np.array(part) for part in J(state.t, state.q, state.p[: s.p.numel()]))
    count = len(model.particle_names)
    B, b = numeric.rows(state.t, state.q, state.v, state.p)
    M = np.array(numeric.inertia(state.t, state.q, state.v, state.p)).diagonal()
    sizes = 1 / np.sqrt(M) if (M > 0).all() else np.ones(M.size)
    parts = components.components(model, (np.array(B), np.array(b).ravel()), found.rank, sizes)
    return Displacements(
        state.t,
        state.q,
        state.v,
        model.particle_names,
        found,
        (slope @ found.virtual).reshape(count, 3, found.dimension),
        (slope @ found.allowed + drift.ravel()).reshape(count, 3),
        parts,
        internal_forces.internal(system, state),
    )
