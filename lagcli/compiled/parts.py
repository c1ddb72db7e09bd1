"""The expressions that all compiled functions are made of, with their common subexpressions shared."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from lagcli import doubles
from lagcli.compiled import dop853_tableau
from lagcli.compiled import selection as choice
from lagcli.compiled.selection import Selection
from lagcli.equations import system as mechanics
from lagcli.equations.rows import ContactRows
from lagcli.equations.system import System
from lagcli.frozen import frozen
from lagcli.smoothness.sized_function import SizedFunction

if TYPE_CHECKING:
    from lagcli.equations.level_functions import LevelExpression

# Nodes of a graph in which common subexpressions are looked for.
SHARED_NODES = 20_000
# So many contacts have few sets: each has functions of its own.
FEW_CONTACTS = 4


@frozen
class Parts:
    """The expressions of (D.24), their common subexpressions shared where the graph `is_small`.

    cartesian: how many of q are components of Cartesian particles; they come first.
    g (k,), dg (k, n): first integrals of differential rows less their values at the start, which the projection of
    positions brings to zero besides f, and their gradients by q.
    contacts: the K rows after the C of B; those that are closed act as holonomic ones do.
    selection: the independent rows among all C + K; lambda is that of these rows, unless said otherwise.
    switches (K,), at the end of p, or none: contacts whose switch is 0 are open all the same.
    """

    t: ca.SX
    y: ca.SX
    p: ca.SX
    v: ca.SX
    f: ca.SX
    B: ca.SX
    b: ca.SX
    gamma: ca.SX
    M: ca.SX
    h: ca.SX
    power: ca.SX
    is_small: bool
    g: ca.SX
    dg: ca.SX
    contacts: ContactRows
    selection: Selection
    cartesian: int
    switches: ca.SX

    @cached_property
    def force(self) -> ca.Function:
        q = self.y[: self.v.numel()]
        return SizedFunction("force", [self.t, q, self.v, self.p], [self.h, self.gamma, self.power])

    def moving(self, v: ca.SX) -> Parts:
        """The parts at another velocity, but for M."""
        h, gamma, power = self.force(self.t, self.y[: v.numel()], v, self.p)
        return dataclasses.replace(self, v=v, h=h, gamma=gamma, power=power)

    def reaction(self, lam: ca.SX) -> ca.SX:
        """B^T lambda, (n,)."""
        return mechanics.reaction(self.B_independent, lam)

    @cached_property
    def has_time(self) -> bool:
        """True if t occurs in what moves the system: rows, integrals that are enforced, inertia, forces, power."""
        entries = [self.B.nz[:], self.M.nz[:], self.dg.nz[:]]
        rest = [self.f, self.b, self.gamma, self.h, self.power, self.g, self.contacts.g]
        whole = ca.vertcat(*(ca.vec(each) for each in entries), *(ca.densify(each) for each in rest))
        return bool(ca.depends_on(whole, self.t))

    @property
    def inputs(self) -> list[ca.SX]:
        return [self.t, self.y, self.p]

    @cached_property
    def inertia(self) -> choice.Solve:
        """h -> M^-1 h."""
        return choice.solver(self.M)

    @cached_property
    def acting(self) -> ContactRows:
        """The contacts, with rows of zeros in place of those that are switched off."""
        contacts, on = self.contacts, self.switches
        if not on.numel():
            return contacts
        rows = np.asarray(contacts.G.sparsity().row(), dtype=np.int64).tolist()
        G = ca.SX(contacts.G.sparsity(), ca.if_else(ca.vec(on[rows]), ca.vec(contacts.G.nz[:]), 0))
        g, g_t, gamma = (
            ca.if_else(on, ca.densify(value), 0) for value in (contacts.g, contacts.g_t, contacts.gamma)
        )
        return dataclasses.replace(contacts, g=g, G=G, g_t=g_t, gamma=gamma)

    @cached_property
    def MB(self) -> ca.SX:
        """M^-1 B^T of the independent rows."""
        return self.inertia(self.B_independent.T)

    @cached_property
    def S(self) -> ca.SX:
        """B M^-1 B^T of the independent rows; one that is switched off has length one, and lies across all others."""
        S = self.B_independent @ self.MB
        if not self.switches.numel():
            return S
        equalities = len(self.selection.independent) - self.switches.numel()
        return S + ca.diag(ca.vertcat(ca.SX(equalities, 1), 1 - self.switches))

    @cached_property
    def S_enforced(self) -> ca.SX:
        """S of the rows that are `enforced`, (s + k, s + k)."""
        if self.g.numel():
            return self.enforced[1] @ self.inertia(self.enforced[1].T)
        independent, holonomic = self.selection.independent, set(self._holonomic)
        indices = [k for k, row in enumerate(independent) if row in holonomic]
        return self.S if len(indices) == len(independent) else self.S[indices, indices]

    @property
    def holonomic(self) -> tuple[ca.SX, ca.SX]:
        """f, and the rows of B that belong to it."""
        return self.f, self.B[: self.f.numel(), :]

    @property
    def _holonomic(self) -> list[int]:
        """The independent rows that are of f, or contacts."""
        return [i for i in self.selection.independent if i < self.f.numel() or i >= self.B.shape[0]]

    def of(self, numbers: Sequence[int], equalities: ca.SX, contacts: ca.SX) -> ca.SX:
        """Entries of rows by their ascending numbers, out of those of all equality rows (C,) and contacts (K,)."""
        C = self.B.shape[0]
        own = [i for i in numbers if i < C]
        found = equalities if len(own) == equalities.shape[0] else equalities[own, :]
        closed = [i - C for i in numbers if i >= C]
        return ca.vertcat(found, contacts[closed, :]) if closed else found

    @cached_property
    def B_independent(self) -> ca.SX:
        return self.of(self.selection.independent, self.B, self.acting.G)

    @cached_property
    def of_independent(self) -> tuple[ca.SX, ca.SX]:
        """b and gamma of the independent rows."""
        columns = (self.b, self.acting.g_t), (self.gamma, self.acting.gamma)
        b, gamma = (self.of(self.selection.independent, *column) for column in columns)
        return b, gamma

    @cached_property
    def enforced(self) -> tuple[ca.SX, ca.SX]:
        """Independent rows of f, closed contacts, and g, which are projected onto zero; and their gradients by q."""
        return self.positions(self._holonomic)

    def positions(self, numbers: Sequence[int]) -> tuple[ca.SX, ca.SX]:
        """Rows of f and contacts by their ascending numbers, and g; and their gradients by q."""
        own = zip(self.holonomic, (self.acting.g, self.acting.G), strict=True)
        f, B = (self.of(numbers, rows, contacts) for rows, contacts in own)
        return (ca.vertcat(f, self.g), ca.vertcat(B, self.dg)) if self.g.numel() else (f, B)

    @property
    def closed(self) -> list[int]:
        """The numbers of the contacts that act, each beyond C."""
        C = self.B.shape[0]
        return [i for i in self.selection.present if i >= C]

    def switched(self, selection: Selection) -> Parts | None:
        """The parts with all contacts of a selection, and switches at the end of p; None where the factors of S would
        cost more than the steps do without them, or where there are few sets of contacts."""
        count = self.contacts.count
        if count <= FEW_CONTACTS:
            return None
        B = self.of(selection.independent, self.B, self.contacts.G)
        pattern = ca.mtimes(B.sparsity(), self.inertia(B.T).sparsity())
        # A step adds up its stages of each number of the state.
        most = dop853_tableau.STAGES * self.y.numel()
        if pattern.nnz() > most or choice.operations(ca.SX(pattern)) > most:
            return None
        switches = ca.SX.sym("switch", count)
        return dataclasses.replace(
            self, selection=selection, switches=switches, p=ca.vertcat(self.p, switches)
        )

    @cached_property
    def multipliers(self) -> ca.Function:
        """multipliers(t, y, p, lambda) -> lambda of all rows, (C + K,)."""
        lam = ca.SX.sym("lam", len(self.selection.independent))
        if not self.selection.dependencies:
            every = ca.SX.zeros(self.selection.count)
            every[list(self.selection.independent)] = lam
            return SizedFunction("multipliers", [*self.inputs, lam], [every])
        return self._of_gram("multipliers", self.selection.shared, lam.numel(), choice.split)

    @cached_property
    def loads(self) -> ca.Function:
        """loads(t, y, p, lambda of all rows) -> `selection.loads`, (I,)."""
        return self._of_gram("loads", choice.spread(self.selection), self.selection.count, choice.loads)

    def _of_gram(
        self, name: str, rows: tuple[int, ...], count: int, result: Callable[[Selection, ca.MX, ca.MX], ca.MX]
    ) -> ca.Function:
        """(t, y, p, lambda (count,)) -> what follows from B M^-1 B^T of these rows and lambda."""
        B = self.of(rows, self.B, self.contacts.G)
        gram = SizedFunction("gram", self.inputs, [B @ self.inertia(B.T)])
        state = [ca.MX.sym(word, x.numel()) for word, x in zip("typ", self.inputs, strict=True)]
        lam = ca.MX.sym("lam", count)
        return SizedFunction(name, [*state, lam], [result(self.selection, gram(*state), lam)])

    def holding(self, charts: Sequence[LevelExpression]) -> Parts:
        """The parts with integrals enforced in these charts; p goes on with two constants of each, a and b: above and
        below at the start over their hypotenuse. g = above b - below a; with a period above - a less whole periods."""
        c = ca.SX.sym("c", 2 * len(charts))
        each, g = ca.vertsplit(c), []
        for chart, a, b in zip(charts, each[::2], each[1::2], strict=True):
            if chart.period is None:
                g.append(chart.above * b - chart.below * a)
            else:
                turned = chart.above - a
                g.append(turned - chart.period * ca.floor(turned / chart.period + 0.5))
        levels = ca.densify(ca.vertcat(*g)) if g else ca.SX(0, 1)
        dg = ca.jacobian(levels, self.y[: self.v.numel()])
        return dataclasses.replace(self, p=ca.vertcat(self.p, c), g=levels, dg=dg)


def build(system: System) -> Parts:
    """The shared expressions of a system."""
    rows, dynamics = system.rows, system.dynamics
    t, v = system.symbols.t, system.symbols.v
    y = ca.vertcat(system.symbols.q, v, ca.SX.sym("W"))
    B, M = rows.B, dynamics.M
    contacts = system.contacts
    G = contacts.G
    expressions = [system.f, B.nz[:], rows.b, rows.gamma, M.nz[:], dynamics.h, dynamics.power]
    expressions += [contacts.g, G.nz[:], contacts.g_t, contacts.gamma]
    # Before the factorizations, which are large and have nothing left to share. The search takes time that grows
    # faster than the model, and sees the entries of matrices alone.
    graph = ca.vertcat(ca.vec(B.nz[:]), rows.gamma, dynamics.h, ca.vec(G.nz[:]), contacts.gamma)
    is_small = B.nnz() + G.nnz() <= SHARED_NODES and int(ca.n_nodes(graph)) <= SHARED_NODES
    if is_small:
        expressions = ca.cse(expressions)
    f, B_entries, b, gamma, M_entries, h, power, g, G_entries, g_t, gamma_g = expressions
    B, M, G = (
        ca.SX(matrix.sparsity(), entries)
        for matrix, entries in ((B, B_entries), (M, M_entries), (G, G_entries))
    )
    contacts = dataclasses.replace(contacts, g=g, G=G, g_t=g_t, gamma=gamma_g)
    nothing, no_rows, C = ca.SX(0, 1), ca.SX(0, v.numel()), B.shape[0]
    open_ = Selection(tuple(range(C)), inactive=tuple(range(C, C + contacts.count)))
    cartesian = v.numel() - len(system.model.generalized_names)
    equations = (f, B, b, gamma, M, h, power)
    return Parts(
        t, y, system.p, v, *equations, is_small, nothing, no_rows, contacts, open_, cartesian, nothing
    )


def state_rate(parts: Parts, a: ca.SX, lam: ca.SX) -> ca.SX:
    """y' = (v, a, power - lambda . b)."""
    return ca.densify(ca.vertcat(parts.v, a, parts.power - ca.dot(lam, parts.of_independent[0])))


def responded(parts: Parts, f: ca.SX, free: ca.SX, x: ca.SX) -> ca.SX:
    """(3,): f x, f M^-1 f with free = M^-1 f, and the largest B_i x for rows and x of length one, which is rounding."""
    square = ca.dot(f, free)
    left = ca.SX(0)
    if parts.selection.independent:
        left = ca.mmax(ca.fabs(parts.B_independent @ x) / ca.sqrt(ca.diag(parts.S) * square + doubles.TINY))
    return ca.densify(ca.vertcat(ca.dot(f, x), square, left))


def residuals(parts: Parts) -> tuple[ca.SX, ca.SX]:
    """The largest |f_i| / |B_i| and |g_j| / |dg_j|, lengths where q are; and the largest |B_i v + b_i| / |B_i| of
    equality rows and closed contacts, of a row without a gradient |b_i|."""
    f, B = parts.positions([*range(parts.f.numel()), *parts.closed])
    position = ca.mmax(ca.fabs(f) / _row_norms(B)) if f.numel() else ca.SX(0)
    every, velocity = [*range(parts.B.shape[0]), *parts.closed], ca.SX(0)
    if every:
        B, b = parts.of(every, parts.B, parts.acting.G), parts.of(every, parts.b, parts.acting.g_t)
        empty = np.bincount(B.sparsity().row(), minlength=B.shape[0]) == 0
        velocity = ca.mmax(ca.fabs(B @ parts.v + b) / (_row_norms(B) + ca.DM(empty.astype(float))))
    return position, velocity


@frozen
class Sizes:
    """Sizes in which positions, velocities and accelerations are small or large, whatever the units. units (n,):
    M_ii^(-1/2), so that an angle of a long arm counts as much as the way of its end; all components of Cartesian
    particles have that of the heaviest. q, v, a: the largest |q_i|, |v_i|, |h_i| / M_ii in these units."""

    units: ca.SX
    q: ca.SX
    v: ca.SX
    a: ca.SX

    @property
    def packed(self) -> ca.SX:
        """One column (n + 3,): units, then q, v and a."""
        return ca.densify(ca.vertcat(self.units, self.q, self.v, self.a))


def sizes(parts: Parts, v: ca.SX, h: ca.SX, M: ca.SX) -> Sizes:
    """The sizes at a velocity, with h and M there."""
    inertia = ca.fabs(ca.densify(ca.diag(M))) + doubles.TINY
    heaviest = ca.mmax(inertia[: parts.cartesian]) if parts.cartesian else ca.SX(0, 1)
    of_all = ca.vertcat(ca.repmat(heaviest, parts.cartesian, 1), inertia[parts.cartesian :])
    units = 1 / ca.sqrt(of_all)
    largest = [
        ca.mmax(ca.fabs(x / units)) if x.numel() else ca.SX(0) for x in (parts.y[: v.numel()], v, h / inertia)
    ]
    return Sizes(units, *largest)


def roundings(parts: Parts, inputs: list[ca.SX]) -> ca.SX:
    """(2, 3): q, v and a of `Sizes`, and what rounding makes of them: that of the rows in which t occurs, of a that of
    h too, in units of rounding; inputs: t, q, v, p."""
    from lagcli.equations import operation_rules

    own, every = sizes(parts, parts.v, parts.h, parts.M), [*range(parts.B.shape[0]), *parts.closed]
    contacts, n = parts.acting, parts.v.numel()
    lengths = _row_norms(parts.of(every, parts.B, contacts.G), own.units) if every else ca.SX(0, 1)
    f = ca.vertcat(parts.f, ca.SX(parts.B.shape[0] - parts.f.numel(), 1))
    columns = ((f, contacts.g), (parts.b, contacts.g_t), (parts.gamma, contacts.gamma))
    values = [ca.densify(parts.of(every, *each)) for each in columns]
    moved = [np.flatnonzero(ca.which_depends(x, parts.t, 1, True)).tolist() if every else [] for x in values]
    of_rows = [x[rows] for x, rows in zip(values, moved, strict=True) if rows]
    terms = ca.vertcat(ca.densify(parts.h), *of_rows)
    off = ca.vertsplit(operation_rules.roundings(terms, inputs), np.cumsum([0, n, *map(len, moved)]).tolist())
    found = [
        ca.mmax(ca.vertcat(0, x / lengths[rows])) if rows else ca.SX(0)
        for x, rows in zip(off[1:], moved, strict=True)
    ]
    found[2] = ca.fmax(found[2], sizes(parts, parts.v, off[0], parts.M).a)
    return ca.densify(ca.blockcat([[own.q, own.v, own.a], found]))


def status(parts: Parts, smallest_angle: ca.SX | float, v: ca.SX, sizes: Sizes) -> ca.SX:
    """(3,) at a velocity v: the residual, and `rank_margin`. The residual is the larger of what is left of the rows, as
    a part of the size of q, and, do they still follow, of B_i v + b_i of rows left out, as a part of its terms."""
    f, B = parts.positions([*range(parts.f.numel()), *parts.closed])
    residual = ca.SX(0)
    if f.numel():
        residual = ca.mmax(ca.fabs(f) / _row_norms(B, sizes.units)) / (sizes.q + doubles.TINY)
    departure = ca.SX(0)
    rest = [dependency[0] for dependency in parts.selection.dependencies]
    if rest:
        B, b = parts.of(rest, parts.B, parts.contacts.G), parts.of(rest, parts.b, parts.contacts.g_t)
        slope, by_time = ca.jacobian(b, parts.y[: v.numel()]), ca.densify(ca.jacobian(b, parts.t))
        # Where b depends on q it has the errors of q even where nothing moves; t has rounding alone. At rest that of
        # velocities is a part of those that the forces would make over the size of q.
        speed = sizes.v + doubles.ROOT * ca.sqrt(sizes.a * sizes.q) + doubles.TINY
        size = _row_norms(B, sizes.units) * speed + doubles.ROOT * ca.fabs(by_time * parts.t)
        if slope.nnz():
            size += _row_norms(slope, sizes.units) * sizes.q
        departure = ca.mmax(ca.fabs(B @ v + b) / size)
    residual = ca.fmax(residual, departure)
    return ca.densify(ca.vertcat(residual, rank_margin(parts, smallest_angle)))


def rank_margin(parts: Parts, smallest_angle: ca.SX | float) -> ca.SX:
    """(2,): the smallest angle of the rows, and the least diagonal entry of S, which vanishes with a row."""
    diagonal, K = ca.diag(parts.S), parts.switches.numel()
    if K:
        # Rows that are switched off vanish no more.
        diagonal = ca.vertcat(diagonal[:-K], diagonal[-K:] / parts.switches)
    smallest_diagonal = ca.mmin(diagonal) if parts.selection.independent else 1.0
    return ca.densify(ca.vertcat(smallest_angle, smallest_diagonal))


def _row_norms(B: ca.SX, units: ca.SX | None = None) -> ca.SX:
    if units is not None:
        B = B @ ca.diag(units)
    return ca.sqrt(ca.sum2(B * B)) + doubles.TINY
