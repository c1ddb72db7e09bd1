"""The contents of the table of a point of rest: columns, the potential, and multipliers that are not unique.

Of all multipliers that balance, those of least weighted norm are given, as in a run; contacts only push. The potential
is the one whose stationary points are the points of rest, where the forces have one.
"""

from __future__ import annotations

from typing import Literal

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.contact import complementarity
from lagcli.equations.system import System
from lagcli.linear import decompositions
from lagcli.smoothness.sized_function import SizedFunction
from lagcli.statics.static_problem import StaticProblem

Floats = npt.NDArray[np.float64]
Origin = Literal["declared", "integrated", "none"]

# Points that are looked at.
SAMPLES = (0.0, 0.1, 0.5, 1.0, 2.0)


class PointColumns:
    """Positions and reactions of one system at rest, at one time and for one p."""

    def __init__(self, system: System, t: float, p: Floats) -> None:
        self._system, self._t, self._p = system, t, p
        s, n = system.symbols, system.symbols.q.numel()
        zeros = ca.SX.zeros(n)
        R = ca.substitute([system.R, system.Q_R], [s.v, system.a], [zeros, zeros])
        positions = SizedFunction("positions", [s.t, s.q, system.p], [system.r])
        reactions = SizedFunction(
            "reactions", [s.t, s.q, system.lam, system.p], [ca.densify(part) for part in R]
        )
        self._positions, self._reactions = positions, reactions

    def at(self, q: Floats) -> dict[str, float]:
        """Positions of all particles, then the generalized coordinates."""
        model = self._system.model
        names = [f"{name}.{axis}" for name in model.particle_names for axis in "xyz"]
        positions = self._positions(self._t, q, self._p).full().ravel().tolist()
        own = q[q.size - len(model.generalized_names) :].tolist()
        return _named((*names, *model.generalized_names), [*positions, *own])

    def reactions(self, q: Floats, lam: Floats) -> dict[str, float]:
        """R of all particles, then of the generalized coordinates; lam (C + K,)."""
        model = self._system.model
        R, Q = (part.full().ravel().tolist() for part in self._reactions(self._t, q, lam, self._p))
        names = [f"R.{name}.{axis}" for name in model.particle_names for axis in "xyz"]
        generalized = model.generalized_names
        return _named((*names, *(f"R.{name}" for name in generalized)), [*R, *Q[len(Q) - len(generalized) :]])

    def row_reactions(self, q: Floats, lam: Floats) -> dict[str, float]:
        """The sum of lambda_i times the gradients, by the columns of the coordinates."""
        Q = self._reactions(self._t, q, lam, self._p)[1].full().ravel().tolist()
        return _named([f"R.{name}" for name in self._system.model.coordinate_names], Q)


def _named(names: tuple[str, ...] | list[str], values: list[float]) -> dict[str, float]:
    return {name: value + 0.0 for name, value in zip(names, values, strict=True)}


def potential_origin(problem: StaticProblem) -> Origin:
    """The potential of the forces at rest: as declared, of forces that have one by their gradient, or none.

    Functions are told from zero by their values at random points.
    """
    random = np.random.default_rng(7)
    size = float(np.abs(problem.begin).max(initial=0.0)) or 1.0
    found: Origin = "declared"
    for part in SAMPLES:
        q = problem.begin + part * size * random.standard_normal(problem.n)
        driving, gradient = problem.driving(q)
        F = problem.at(problem.t, q, problem.nothing).F
        if not np.isfinite(driving).all() or not np.isfinite(gradient).all():
            continue
        largest = np.abs(F).max(initial=0.0)
        if np.abs(driving).max(initial=0.0) <= doubles.ZERO * max(largest, doubles.TINY):
            continue  # a Lagrangian written at length leaves rounding, whose gradient is of any shape
        found = "integrated"
        if not decompositions.is_symmetric(gradient):
            return "none"
    return found


def potential(problem: StaticProblem, source: Origin, q: Floats) -> float | None:
    """The potential at q; of forces without a declared one less their work from the start, along a straight way."""
    if source == "none":
        return None
    declared = problem.value(q)
    if source == "declared":
        return declared + 0.0
    from scipy import integrate

    way = q - problem.begin

    def along(part: float) -> float:
        return float(problem.driving(problem.begin + part * way)[0] @ way)

    # With its full output it warns of nothing: the error that it gives is judged here.
    work, error = integrate.quad(along, 0.0, 1.0, epsabs=0.0, epsrel=1e-12, limit=200, full_output=1)[:2]
    return declared - work if np.isfinite(work) and error <= 1e-9 * max(1.0, abs(work)) else None


def pushing_multipliers(rows: Floats, lam: Floats, M: Floats, equalities: int) -> tuple[Floats, bool]:
    """lambda (C,) with the same rows^T lambda, no less than 0 after the first `equalities`, of least norm in the mass
    metric, and whether it is the only one: the same as in a run. rows (C, n), M (n, n)."""
    unit, size = _in_metric(rows, M)
    shared, same = complementarity.shared(unit, lam * size, equalities)
    return np.asarray(np.divide(shared, size, out=np.zeros_like(lam), where=size > 0)), bool(same.all())


def _in_metric(rows: Floats, M: Floats) -> tuple[Floats, Floats]:
    """Rows (C, n) of length one in the mass metric and their lengths, in the plain metric where M is singular."""
    try:
        found = np.linalg.solve(np.linalg.cholesky((M + M.T) / 2), rows.T).T
    except np.linalg.LinAlgError:
        found = rows
    size = np.linalg.norm(found, axis=1)
    return np.asarray(found / np.where(size > 0, size, 1.0)[:, None]), size


def row_lengths(rows: Floats, M: Floats) -> Floats:
    """sqrt(B_i M^-1 B_i^T) of rows (C, n), by the plain metric where M is singular."""
    if not len(rows):
        return np.zeros(0)
    try:
        solved = np.linalg.solve(M, rows.T)
    except np.linalg.LinAlgError:
        solved = rows.T
    squares = np.einsum("ij,ji->i", rows, solved)
    if not np.isfinite(squares).all() or (squares < 0).any():
        squares = np.einsum("ij,ij->i", rows, rows)
    return np.asarray(np.sqrt(squares))
