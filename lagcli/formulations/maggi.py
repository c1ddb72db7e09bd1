"""Independent quantities in place of dependent coordinates: the equations of Maggi, without multipliers.

At a reference the velocities that the rows allow are those of the null space of B, with a basis Z that is orthonormal
in the mass metric. Near it, with G = Z^T M of the reference,

    xi = G_h (q - q_ref)    n - s independent coordinates (G_h: the same of the holonomic rows alone)
    u  = G v                n - rank independent quasi-velocities

and [B; G] v = [-b; u] gives v, [B_h; G_h] (q - q_ref) = [..; xi] with f(q, t) = 0 gives q. With N the columns of
[B; G]^-1 that belong to u, so that B N = 0 and G N = 1, virtual displacements are N du, and (D.26) becomes

    N^T (M a - h) = 0,    a = N u' + a_p,    B a_p = gamma

which has no multiplier in it. Afterwards B^T lambda = M a - h tells them (D.24).
"""

from __future__ import annotations

import dataclasses

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.compiled import numeric, parts
from lagcli.compiled.bound_function import BoundFunction
from lagcli.equations.system import System
from lagcli.linear import decompositions, rank
from lagcli.simulation.run_state.between_steps import Turns
from lagcli.smoothness import time_functions
from lagcli.smoothness.sized_function import SizedFunction

Floats = npt.NDArray[np.float64]

# Newton's iterations for q, and the change, as a part of the size, that ends them.
ITERATIONS, ARRIVED = 16, 2 * doubles.EPS
# Steps that do not shrink to SLOW of the one before ask for new derivatives; small ones that do not halve are rounding.
SLOW, HALF = 0.1, 0.5


class ChartError(Exception):
    """The chart ends here: no configuration is found, or the rows are dependent."""


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class DensePoint:
    """The values that depend on t and q: f (s,), B (C, n) and b (C,); the arrays are the caller's own."""

    f: Floats
    B: Floats
    b: Floats


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class DenseForces:
    """The values that depend on the velocities too: M (n, n), h (n,), gamma (C,)."""

    M: Floats
    h: Floats
    gamma: Floats
    is_diagonal: bool

    def times(self, X: Floats) -> Floats:
        """M X for X (n,) or (n, k)."""
        return np.asarray((self.M.diagonal() * X.T).T if self.is_diagonal else self.M @ X)


class DenseFunctions:
    """A system at numbers, dense, at one set of parameters p. Nothing in it knows of multipliers."""

    def __init__(self, system: System, p: Floats) -> None:
        symbols, rows, dynamics = system.symbols, system.rows, system.dynamics
        self.n, self.rows, self.holonomic = symbols.q.numel(), len(rows.rows), int(rows.f.numel())
        self._t, self._q, self._v = np.zeros(1), np.zeros(self.n), np.zeros(self.n)
        self._turns, self._last = Turns(system), np.array(p)
        inputs = [symbols.t, symbols.q, system.p]
        outputs = [ca.densify(part) for part in (system.f, rows.B, rows.b)]
        point = SizedFunction("point", inputs, outputs)
        self._point = BoundFunction(point, [self._t, self._q, self._last])
        inputs = [symbols.t, symbols.q, symbols.v, system.p]
        outputs = [ca.densify(part) for part in (dynamics.M, dynamics.h, rows.gamma)]
        forces = SizedFunction("forces", inputs, outputs)
        self._forces = BoundFunction(forces, [self._t, self._q, self._v, np.array(p)])
        self._is_diagonal = bool(dynamics.M.sparsity().is_diag())
        self._record = numeric.table(system, parts.build(system))
        self._p = p
        self.timed = time_functions.functions(system.model)

    def settle(self, t: float, q: Floats) -> None:
        """Angles with a cut are counted on from where they are at t, q (n,), a state of the motion."""
        self._turns.settle(t, q, self._last)

    def point(self, t: float, q: Floats) -> DensePoint:
        """The rows at t, q (n,)."""
        self._t[0], self._q[:] = t, q
        self._point.trigger()
        f, B, b = self._point.results
        return DensePoint(f.copy(), B.reshape(self.rows, self.n).copy(), b.copy())

    def forces(self, t: float, q: Floats, v: Floats) -> DenseForces:
        """Inertia, forces and bias at t, q, v (n,)."""
        self._t[0], self._q[:], self._v[:] = t, q, v
        self._forces.trigger()
        M, h, gamma = self._forces.results
        return DenseForces(M.reshape(self.n, self.n).copy(), h.copy(), gamma.copy(), self._is_diagonal)

    def row(self, t: float, state: tuple[Floats, Floats, Floats], lam: Floats) -> Floats:
        """One row of the table, t first, of q, v, a (n,) and lambda (C,)."""
        q, v, a = state
        y, rate = np.concatenate([q, v, [0.0]]), np.concatenate([v, a, [0.0]])
        values = np.array(self._record(t, y, rate, lam, self._p)[0]).ravel()
        return np.concatenate([[t], values])


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class ReducedMotion:
    """A point of the chart in full: q, v, a (n,), with (xi', u'), and how far the null space of all rows has turned
    (1: not)."""

    q: Floats
    v: Floats
    a: Floats
    rate: Floats
    turned: float


class Chart:
    """Independent quantities y = (xi, u) around a reference t, q, v. Raises `ChartError`."""

    def __init__(self, functions: DenseFunctions, t: float, q: Floats, v: Floats) -> None:
        self._functions, self._q_ref = functions, q
        here = functions.point(t, q)
        M = functions.forces(t, q, v).M
        try:
            lower: Floats = np.asarray(np.linalg.cholesky(M))
        except np.linalg.LinAlgError:
            raise ChartError("the inertia is not positive definite") from None
        self._lower = lower
        s = functions.holonomic
        self._mix, self._G = _split(here.B, lower)
        self._mix_h, self._G_h = _split(here.B[:s], lower)
        self._guess = q
        self._inverse_h = _inverse(np.vstack([self._mix_h @ here.B[:s], self._G_h]))
        self._size = float(np.abs(q).max(initial=0.0)) or 1.0
        self.freedoms, self.rank = len(self._G), len(self._mix)
        self.y = np.concatenate([np.zeros(len(self._G_h)), self._G @ v])
        lengths = np.concatenate([lower.T @ q, [1e-300]])
        self.sizes = np.concatenate([np.full(len(self._G_h), np.abs(lengths).max()), np.zeros(len(self._G))])

    def stand(self, q: Floats) -> None:
        """Look for configurations from q (n,) on: a trial that was given up may have led to another branch."""
        self._guess = q

    def at(self, t: float, y: Floats) -> ReducedMotion:
        """The motion at y (n - s + n - rank,). Raises `ChartError`."""
        d = len(self._G_h)
        q, here = self._position(t, y[:d])
        functions, r = self._functions, self.rank
        inverse = _inverse(np.vstack([self._mix @ here.B, self._G]))
        v = inverse @ np.concatenate([-self._mix @ here.b, y[d:]])
        forces = functions.forces(t, q, v)
        if functions.holonomic == functions.rows:
            self._inverse_h = inverse
        N, a_p = inverse[:, r:], inverse[:, :r] @ (self._mix @ forces.gamma)
        reduced = N.T @ forces.times(N)
        try:
            w = np.linalg.solve(reduced, N.T @ (forces.h - forces.times(a_p)))
        except np.linalg.LinAlgError:
            raise ChartError("the inertia of the independent motions is singular") from None
        a = N @ w + a_p
        if not np.isfinite(a).all():
            raise ChartError("the accelerations are not finite")
        return ReducedMotion(q, v, a, np.concatenate([self._G_h @ v, w]), self._grown(N))

    def turned(self, t: float, motion: ReducedMotion) -> float:
        """The size of a basis of the null space at a motion (1: not turned), the larger of that of all rows and of the
        holonomic ones, which may allow what the others do not."""
        functions, s = self._functions, self._functions.holonomic
        if s == functions.rows:
            return motion.turned
        rows = self._mix_h @ functions.point(t, motion.q).B[:s]
        try:
            N_h = _inverse(np.vstack([rows, self._G_h]))[:, len(rows) :]
        except ChartError:
            return np.inf
        return max(motion.turned, self._grown(N_h))

    def _grown(self, N: Floats) -> float:
        """The size of a basis (n, d) that has size 1 at the reference."""
        return float(np.linalg.norm(self._lower.T @ N) / np.sqrt(max(1, N.shape[1])))

    def _position(self, t: float, xi: Floats) -> tuple[Floats, DensePoint]:
        """The configuration on f = 0 with these xi, and the rows there.

        By Newton's method from the last one, with the derivatives of an earlier point as long as they serve.
        """
        functions, s, q = self._functions, self._functions.holonomic, self._guess
        before = np.inf
        for _ in range(ITERATIONS):
            here = functions.point(t, q)
            residual = np.concatenate([self._mix_h @ here.f, self._G_h @ (q - self._q_ref) - xi])
            step = self._inverse_h @ residual
            moved = self._part(step)
            if moved > SLOW * before and moved > doubles.VALUE:
                self._inverse_h = _inverse(np.vstack([self._mix_h @ here.B[:s], self._G_h]))
                step = self._inverse_h @ residual
                moved = self._part(step)
            if not np.isfinite(moved):
                break
            q = q - step
            if moved <= ARRIVED or (moved >= HALF * before and moved <= doubles.VALUE):
                self._guess = q
                return q, functions.point(t, q)
            before = moved
        self._guess = self._q_ref
        raise ChartError("no configuration with these independent coordinates is near")

    def _part(self, step: Floats) -> float:
        """The largest entry of a step as a part of the size of the configuration."""
        return float(np.abs(step).max(initial=0.0)) / self._size


def reactions(functions: DenseFunctions, t: float, motion: ReducedMotion) -> tuple[Floats, Floats]:
    """lambda (C,) with B^T lambda = R, of dependent rows those with the least sum of lambda_i^2 B_i M^-1 B_i^T, and
    R = M a - h (n,), the forces of constraint without multipliers (D.23, D.24)."""
    forces = functions.forces(t, motion.q, motion.v)
    R = forces.times(motion.a) - forces.h
    if not functions.rows:
        return np.zeros(0), R
    lower = np.linalg.cholesky(forces.M)
    white = np.linalg.solve(lower, functions.point(t, motion.q).B.T).T
    return rank.multipliers(white, np.linalg.solve(lower, R), decompositions.lengths(white)), R


def _split(B: Floats, lower: Floats) -> tuple[Floats, Floats]:
    """Independent combinations of rows, (rank, C), and Z^T M of the null space of B (C, n), (n - rank, n).

    Raises `ChartError` where the rank is undecided.
    """
    white: Floats = np.asarray(np.linalg.solve(lower, B.T).T)
    lengths = decompositions.lengths(white)
    found = rank.space(white / lengths[:, None])
    if found.value is None:
        raise ChartError("the rank of the rows is undecided")
    return found.combinations / lengths, found.kernel.T @ lower.T


def _inverse(matrix: Floats) -> Floats:
    try:
        return np.asarray(np.linalg.inv(matrix))
    except np.linalg.LinAlgError:
        raise ChartError("the rows are dependent") from None
