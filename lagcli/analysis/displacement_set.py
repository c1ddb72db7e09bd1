"""Allowed and virtual displacements at an instant (D.6, D.8, D.9), and their dependent and independent components (D.16
to D.21).

Components are numbered, x_n with n = 3(k - 1) + j for the axis j of particle k, and generalized coordinates after them.
As many as the rank are dependent, those that the rows are solved for best; all allowed displacements are
dx_dependent = T dx_independent + tau dt, and with dt = 0 the virtual ones.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import casadi as ca
import numpy as np

from lagcli import doubles
from lagcli.analysis import contact_directions, internal_forces
from lagcli.analysis.contact_directions import ContactDirections
from lagcli.analysis.internal_forces import Internal
from lagcli.arrays import Floats
from lagcli.compiled import NumericSystem
from lagcli.equations.system import System
from lagcli.linear import decompositions, independent_rows, rank
from lagcli.linear.metric import Metric, NotDefiniteError
from lagcli.linear.metric_rows import LocalRows
from lagcli.model.model import Model
from lagcli.smoothness.sized_function import SizedFunction
from lagcli.start import initial, projection
from lagcli.start.consistent_start import Moves
from lagcli.start.initial import State

# A basis of so many coordinates has some ten million numbers.
MOST_COORDINATES = 4000
# A column whose rest is at least this part of the largest may be the pivot; of those the last is
# (`test_of_components_that_serve_alike_the_last_depends` fails at 1 - 1e-7 and 1 - 1e-11).
EQUAL = 1 - doubles.ZERO


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Bases:
    """Displacements dq with B dq + b dt = 0.

    virtual (n, n - rank): a basis for dt = 0, orthonormal in the mass metric, dq^T M dq = 1, or plainly, dq^T dq = 1,
    where some coordinates have no inertia (`metric`). allowed (n,): the shortest one for dt = 1. residual,
    allowed_residual: the largest |B_i dq| and |B_i dq + b_i| of them, for rows of length one and displacements of
    length one, or the size of b_i. rows: C.
    """

    rows: int
    rank: int
    metric: str
    virtual: Floats
    allowed: Floats
    residual: float
    allowed_residual: float
    is_certain: bool

    @property
    def dimension(self) -> int:
        """n - rank, the dimension of the virtual displacements: 3N - rank for Cartesian particles."""
        return int(self.virtual.shape[1])


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Components:
    """names (n,) of the components with their numbers (None for generalized coordinates); indices among them of the
    dependent (rank,) and independent (n - rank,) ones; T (rank, n - rank) and tau (rank,)."""

    names: tuple[str, ...]
    numbers: tuple[int | None, ...]
    dependent: tuple[int, ...]
    independent: tuple[int, ...]
    T: Floats
    tau: Floats


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Displacements:
    """Allowed and virtual displacements at the time t and the configuration q (n,) that moves with v (n,).

    virtual_r (N, 3, n - rank) and allowed_r (N, 3): the same of the particles, dr_k = sum_j dr_k/dq_j dq_j (D.28),
    and dr_k/dt for dt = 1. contacts: what the closed ones leave of them; allowed_r is that of `allowed` there, None
    where none is. assembled: what assembly changed in the start; notes: initial velocities that violate rows.
    """

    t: float
    q: Floats
    v: Floats
    particles: tuple[str, ...]
    bases: Bases
    virtual_r: Floats
    allowed_r: Floats | None
    components: Components
    internal: tuple[Internal, ...]
    contacts: ContactDirections
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
        allowed, allowed_r = self.contacts.allowed, self.allowed_r
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
            "allowed": {"dt": 1.0, "displacement": None if allowed is None else allowed.tolist()},
            "residual": found.residual,
            "allowed_residual": found.allowed_residual,
            "particles": {
                name: {
                    "virtual": self.virtual_r[k].T.tolist(),
                    "allowed": None if allowed_r is None else allowed_r[k].tolist(),
                }
                for k, name in enumerate(self.particles)
            },
            "dependent": [named[i] for i in parts.dependent],
            "independent": [named[i] for i in parts.independent],
            "T": parts.T.tolist(),
            "tau": parts.tau.tolist(),
            "internal_forces": [
                {**dataclasses.asdict(one), "central": one.is_central} for one in self.internal
            ],
            **self.contacts.as_json(parts.names),
        }


def displacements(system: System, numeric: NumericSystem, state: State) -> Displacements:
    """The displacements at a state whose configuration satisfies the rows; its velocities enter forces alone."""
    try:  # the metric of `projection.rows`, and its name
        metric, name = Metric(numeric.inertia(state.t, state.q, state.v, state.p)), "mass"
    except NotDefiniteError:
        metric, name = initial.metric_at(numeric, state), "plain"
    rows = projection.rows(numeric, state)
    ranked = rank.estimate(rows)
    B, bias = numeric.rows(state.t, state.q, state.v, state.p)
    b, plain = np.array(bias).ravel(), LocalRows(B)
    # In the metric the rest of an orthonormal basis belongs to displacements M^-1/2 z.
    right = decompositions.axes(rows.dense)[1][: ranked.low]
    basis = decompositions.axes(right)[1][len(right) :]
    virtual = np.array([metric.unwhitened(z) for z in basis]).reshape(-1, state.q.size).T
    allowed = rows.correction(b) if rows.count and b.any() else np.zeros(state.q.size)
    lengths = np.linalg.norm(virtual, axis=0)
    residuals = [
        float(np.abs(plain.times(column) / plain.divisors).max(initial=0.0)) / length
        for column, length in zip(virtual.T, lengths, strict=True)
    ]
    size = float((np.abs(b) / plain.divisors).max(initial=0.0)) or 1.0
    rest = float((np.abs(plain.times(allowed) + b) / plain.divisors).max(initial=0.0)) / size
    residual = max(residuals, default=0.0)
    is_certain = ranked.value is not None
    found = Bases(rows.count, ranked.low, name, virtual, allowed, residual, rest, is_certain)
    contacts = contact_directions.directions(system, numeric, state, metric, virtual, allowed)
    s, model = system.symbols, system.model
    J = SizedFunction("J", [s.t, s.q, s.p], [ca.jacobian(system.r, s.q), ca.jtimes(system.r, s.t, ca.SX(1))])
    slope, drift = (np.array(part) for part in J(state.t, state.q, state.p[: s.p.numel()]))
    count = len(model.particle_names)
    M = np.array(numeric.inertia(state.t, state.q, state.v, state.p)).diagonal()
    # Parts of the largest: only ratios count, and squares stay numbers.
    sizes = np.sqrt(M.min(initial=np.inf) / M) if (M > 0).all() else np.ones(M.size)
    parts = _components(model, (np.array(B), b), found.rank, sizes)
    return Displacements(
        state.t,
        state.q,
        state.v,
        model.particle_names,
        found,
        (slope @ found.virtual).reshape(count, 3, found.dimension),
        None if contacts.allowed is None else (slope @ contacts.allowed + drift.ravel()).reshape(count, 3),
        parts,
        internal_forces.internal(system, state),
        contacts,
    )


def _components(model: Model, rows: tuple[Floats, Floats], rank: int, sizes: Floats) -> Components:
    """The components for rows B (C, n) and b (C,) of this rank; sizes (n,): a length of each coordinate, to compare
    them by."""
    B, b = rows
    lengths = decompositions.lengths(B * sizes)
    B, b = B / lengths[:, None], b / lengths
    # Columns that span the range, each the farthest from those before it, the last of several
    from_last = independent_rows.farthest((B * sizes).T[::-1], rank, nearly=EQUAL)
    dependent = sorted(B.shape[1] - 1 - k for k in from_last)
    independent = [i for i in range(B.shape[1]) if i not in set(dependent)]
    right = -np.column_stack([B[:, independent] * sizes[independent], b])
    solved = decompositions.least_squares(B[:, dependent] * sizes[dependent], right)
    solved = np.where(np.abs(solved) < doubles.VALUE * np.abs(solved).max(initial=0.0), 0.0, solved)
    solved = solved * sizes[dependent][:, None]
    # n = 3(k - 1) + j of each coordinate, with k among all particles of the file.
    flags = [p.is_dependent for p in model.particles for _ in range(p.members.count)]
    found: list[int | None] = [
        3 * k + j for k, is_dependent in enumerate(flags) if not is_dependent for j in (1, 2, 3)
    ]
    return Components(
        model.coordinate_names,
        (*found, *(None for _ in model.generalized_names)),
        tuple(dependent),
        tuple(independent),
        solved[:, :-1] / sizes[independent] + 0.0,
        solved[:, -1] + 0.0,
    )
