"""The linear equations of small deviations, with the matrices by exact differentiation.

M dq'' + C dq' + K dq = B^T dlambda, rows B dq = 0 (holonomic) and A dq' + D dq = 0 (differential rows). With
h the forces and inertial terms of (D.24)

    K = d(M a - h - B^T lambda)/dq,    C = d(M a - h)/dv,    D = d(A v + b)/dq

at constant a and lambda, so that what the reference loads (prestress) is in K.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.arrays import Flags, Floats
from lagcli.equations import level_functions, operation_rules, system
from lagcli.equations.system import System
from lagcli.linear.metric_rows import LocalRows
from lagcli.model.invariant import FirstIntegral
from lagcli.smoothness.sized_function import SizedFunction

if TYPE_CHECKING:
    from scipy import sparse


# Points at which a function is looked at, and how far they are spread.
POINTS, SPREAD = 4, 0.1
# Of linear equations, by sparse factors.
SOLVER = "qr"
# A number below this or above its inverse has no square that is a normal double.
SMALLEST = math.sqrt(doubles.TINY)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Reference:
    """An instant of the motion that is looked at: t, q, v, a (n,), lam (C + K,) of all rows and contacts, p."""

    t: float
    q: Floats
    v: Floats
    a: Floats
    lam: Floats
    p: Floats


class LinearMatrices(NamedTuple):
    """The matrices of `Linear` as CasADi has them."""

    M: ca.DM
    C: ca.DM
    K: ca.DM
    B: ca.DM
    A: ca.DM
    D: ca.DM
    D_holonomic: ca.DM


class Linear:
    """M, C, K (n, n), B (h, n) with B dq = 0, A, D (d, n) with A dq' + D dq = 0, sparse; D_holonomic
    (h, n): d(B v + b)/dq of the holonomic rows but for leaves; `residual` (n,) is
    M a - h - B^T lambda, `load` (n,) the sizes of its terms; cyclic (n,): coordinates that occur nowhere in them.

    Matrices of SciPy, which loads slowly, are made where they are asked for.
    """

    def __init__(self, matrices: LinearMatrices, residual: Floats, load: Floats, cyclic: Flags) -> None:
        self.matrices = matrices
        self.residual, self.load, self.cyclic = residual, load, cyclic

    M = cached_property(lambda self: _sparse(self.matrices.M))
    C = cached_property(lambda self: _sparse(self.matrices.C))  # damping and gyroscopic terms
    K = cached_property(lambda self: _sparse(self.matrices.K))  # stiffness, prestress and circulatory terms
    B = cached_property(lambda self: _sparse(self.matrices.B))
    A = cached_property(lambda self: _sparse(self.matrices.A))
    D = cached_property(lambda self: _sparse(self.matrices.D))
    D_holonomic = cached_property(lambda self: _sparse(self.matrices.D_holonomic))

    @cached_property
    def inertia(self) -> Floats:
        """The square roots of the diagonal of M, (n,): forces over them, and velocities times them, have one unit."""
        return np.asarray(np.sqrt(np.array(ca.densify(ca.diag(self.matrices.M)), dtype=float).ravel()))

    @cached_property
    def values(self) -> Floats:
        """All entries in one column, for two of them to be compared."""
        return np.concatenate([np.zeros(0), *(part.nonzeros() for part in self.matrices)])

    def in_units(self, unit: Linear) -> Iterator[tuple[Floats, npt.NDArray[np.intp], int]]:
        """The entries of each matrix in units of the masses and rows of `unit`, their rows, and power of frequency."""
        own = unit.matrices
        whitening = ca.diag(ca.DM(1 / unit.inertia))
        B, A = (LocalRows(ca.mtimes(part, whitening)).divisors for part in (own.B, own.A))
        lengths = (unit.inertia, unit.inertia, unit.inertia, B, A, A, B)
        for matrix, length, order in zip(self.matrices, lengths, (0, 1, 2, 0, 0, 1, 1), strict=True):
            rows = LocalRows(ca.mtimes(matrix, whitening))
            yield rows.values / length[rows.row], rows.row, order


class LinearizedFunctions:
    """The matrices as functions of a reference; closed: contacts that count as rows, by number; integrals: of
    differential rows, whose leaf through the reference counts as holonomic rows."""

    def __init__(
        self, built: System, closed: Sequence[int] = (), integrals: Sequence[FirstIntegral] = ()
    ) -> None:
        s, C = built.symbols, len(built.rows.rows)
        q, v, a = s.q, s.v, built.a
        numbers = list(closed)
        G = built.contacts.G[numbers, :]
        loaded = [*range(C), *(C + j for j in numbers)]
        every = ca.sparsify(ca.vertcat(built.rows.B, G))
        lam = built.lam[loaded] if loaded else ca.SX(0, 1)  # no choice would have the shape (1, 0)
        reaction = system.reaction(every, lam)
        M, h = built.dynamics.M, built.dynamics.h
        inertial = ca.densify(M @ a) - h
        residual = inertial - reaction
        holonomic = built.holonomic_count
        A, b = built.rows.B[holonomic:, :], built.rows.b[holonomic:, :]
        rates = ca.densify(A @ v) + b
        K, damping, D = ca.jacobian(residual, q), ca.jacobian(inertial, v), ca.jacobian(rates, q)
        B = ca.sparsify(ca.vertcat(built.rows.B[:holonomic, :], G))
        b_holonomic = ca.vertcat(built.rows.b[:holonomic, :], built.contacts.g_t[numbers, :])
        D_holonomic = ca.jacobian(ca.densify(B @ v) + b_holonomic, q)
        self.system, self.closed = built, tuple(numbers)
        # The gradients of the ratios above/below of the charts of each integral, one row each
        self._charts = []
        for each in integrals:
            slopes = []
            for chart in level_functions.charts(built, each.charts).charts:
                above, below = (ca.jacobian(part, q) for part in (chart.above, chart.below))
                ratio = above if chart.period is not None else above * chart.below - chart.above * below
                slopes.append(ca.densify(ratio))
            self._charts.append(SizedFunction("leaf", [s.t, q, built.p], [ca.vertcat(*slopes)]))
        inputs = [s.t, q, v, built.p]
        self._inputs = [s.t, q, v, a, built.lam, built.p]
        # Where forces cancel within h, or reactions within their sum, what is left does not tell how large they are.
        terms = operation_rules.term_sizes(h, inputs)
        load = ca.fabs(ca.densify(M @ a)) + terms + ca.mtimes(ca.fabs(every).T, ca.fabs(lam))
        self._at = SizedFunction(
            "linearized", self._inputs, [M, damping, K, B, A, D, D_holonomic, ca.densify(residual), load]
        )
        self._K, self._loaded = K, loaded
        occurring = {int(j) for part in (K, D) for j in part.sparsity().get_col()}
        self.cyclic = np.array([j not in occurring for j in range(int(q.numel()))], dtype=bool)
        d = built.dynamics
        f_t = ca.densify(ca.jacobian(built.rows.f, s.t))
        vanishing = ca.vertcat(ca.densify(d.power), ca.densify(built.rows.b), f_t)
        sizes = operation_rules.term_sizes(vanishing, inputs)
        self._powers = SizedFunction("powers", inputs, [ca.densify(d.driving), vanishing, sizes])

    def at(self, here: Reference) -> Linear:
        """The matrices at a reference."""
        found = self._at(here.t, here.q, here.v, here.a, here.lam, here.p)
        M, C, K, B, A, D, D_holonomic = found[:7]
        # Of each leaf the first gradient that is finite and does not vanish
        leaves = []
        for chart in self._charts:
            for row in np.array(chart(here.t, here.q, here.p)):
                largest = float(np.abs(row).max(initial=0.0))
                if np.isfinite(row).all() and largest > 0:
                    if not SMALLEST < largest < 1 / SMALLEST:  # whose squares are no doubles
                        row = row / largest
                    leaves.append(ca.DM(row[None] / np.linalg.norm(row)))
                    break
        residual, load = (np.array(part).ravel() for part in found[7:])
        matrices = LinearMatrices(M, C, K, ca.vertcat(B, *leaves), A, D, D_holonomic)
        return Linear(matrices, residual, load, self.cyclic)

    def values(self, here: Reference) -> Floats:
        """All entries of the matrices at a reference in one column."""
        found = self._at(here.t, here.q, here.v, here.a, here.lam, here.p)
        return np.concatenate([np.zeros(0), *(part.nonzeros() for part in found[:7])])

    def is_on_rows(self, here: Reference) -> bool:
        """True if a reference satisfies the rows and contacts that press, and is on the allowed side of others, but for
        rounding of their terms and of what the whole configuration, or all speeds, could make of them."""
        found = self._rows(here.t, here.q, here.v, here.p)
        values, terms, scales = (np.array(part).ravel() for part in found)
        off, apart = np.abs(values), values.size - (self.system.contacts.count - len(self.closed))
        off[apart:] = -values[apart:]
        return bool((off <= doubles.ZERO * terms + doubles.VALUE * scales).all())

    def stiffness_terms(self, here: Reference, linear: Linear) -> Floats:
        """The sizes of the terms of K (n, n), with multipliers as large as all forces could make them."""
        m, s = linear.matrices, self.system.holonomic_count
        rows = ca.vertcat(m.B[:s, :], m.A, m.B[s : s + len(self.closed), :])
        lengths = LocalRows(ca.mtimes(rows, ca.diag(ca.DM(1 / linear.inertia)))).divisors
        lam = np.abs(here.lam)
        lam[self._loaded] += np.linalg.norm(linear.load / linear.inertia) / lengths
        sizes = operation_rules.term_sizes(ca.densify(ca.vec(self._K.nz[:])), self._inputs)
        function = SizedFunction("stiffness_terms", self._inputs, [ca.SX(self._K.sparsity(), sizes)])
        return np.array(function(here.t, here.q, here.v, here.a, lam, here.p))

    @cached_property
    def _rows(self) -> ca.Function:
        """Rates B v + b of all rows and contacts that press, their positions, and contacts that do not press; what they
        are sums of; and what they could be, by |B_i v| <= |B_i| |v| in the metric of the masses."""
        built, closed = self.system, list(self.closed)
        s, contacts, holonomic = built.symbols, built.contacts, built.holonomic_count
        apart = [j for j in range(contacts.count) if j not in closed]
        B, G = ca.vertcat(built.rows.B, contacts.G[closed, :]), contacts.G[apart, :]
        rates = ca.densify(B @ s.v) + ca.vertcat(built.rows.b, contacts.g_t[closed, :])
        levels = ca.vertcat(built.rows.f, contacts.g[closed, :], contacts.g[apart, :])
        slopes = ca.vertcat(built.rows.B[:holonomic, :], contacts.G[closed, :], G)
        inertia = ca.densify(ca.diag(built.dynamics.M))
        far, fast = (ca.sqrt(ca.dot(inertia, x**2)) for x in (s.q, s.v))
        lengths = [ca.sqrt(ca.densify(ca.mtimes(part**2, 1 / inertia))) for part in (slopes, B)]
        values = ca.vertcat(rates, ca.densify(levels))
        inputs = [s.t, s.q, s.v, built.p]
        sizes = operation_rules.term_sizes(values, inputs)
        scales = ca.vertcat(fast * lengths[1], far * lengths[0])
        return SizedFunction("rows_and_sizes", inputs, [values, sizes, scales])

    def keeps_energy(self, here: Reference) -> bool:
        """True if the forces have a potential as they are written, and no force, position or row knows the time: what
        is zero as a function is so at points around."""
        random = np.random.default_rng(3)
        size = float(np.abs(here.q).max(initial=0.0)) or 1.0
        for _ in range(POINTS):
            t = here.t + random.standard_normal()
            q = here.q + SPREAD * size * random.standard_normal(here.q.size)
            v = random.standard_normal(here.q.size)
            driving, left, terms = (np.array(part).ravel() for part in self._powers(t, q, v, here.p))
            if driving.any() or not (np.abs(left) <= doubles.ZERO * terms).all():
                return False
        return True

    def acceleration(self, here: Reference) -> Floats:
        """a (n,) of M a = h + B^T lambda with the lambda of a reference, not finite where M is singular."""
        found = self._at(here.t, here.q, here.v, np.zeros_like(here.v), here.lam, here.p)
        try:
            return np.array(ca.solve(found[0], -found[7], SOLVER)).reshape(-1)
        except RuntimeError:  # what CasADi raises where the factorization fails
            return np.full(here.v.size, np.nan)


def _sparse(matrix: ca.DM) -> sparse.csc_array:
    """A CasADi matrix of numbers as one of SciPy, with its structural entries kept."""
    from scipy import sparse

    pattern = matrix.sparsity()
    # The factorizations of older SciPy take indices of 32 bits alone.
    indices, starts = (np.array(part, dtype=np.int32) for part in (pattern.row(), pattern.colind()))
    return sparse.csc_array((np.array(matrix.nonzeros(), dtype=float), indices, starts), shape=matrix.shape)
