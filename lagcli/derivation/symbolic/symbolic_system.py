"""M, h, f, B, b, gamma of a model in SymPy symbols, from its own expressions (D.5-D.7, D.23, D.30, D.53)."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence

import sympy

from lagcli.derivation.symbolic.calculus import NOTHING, Triple
from lagcli.derivation.symbolic.symbol_table import SymbolTable, view
from lagcli.derivation.symbolic.tidy import polynomial, shorter, tidy
from lagcli.equations import rigid
from lagcli.errors import diagnostics
from lagcli.model import model as nouns
from lagcli.pfaffian.forms.notation import TIME, ZERO

MAX_PRODUCTS = 30_000  # dr_k/dq_i . dr_k/dq_j that are written out for T of dependent particles
MAX_EXPANDED = 20_000  # operations up to which a force is ordered by rates


@dataclasses.dataclass(frozen=True, slots=True)
class SymbolicRow:
    """A scalar row: f (None for a differential one), B by number of coordinate, b, gamma = -(B' v + b')."""

    name: str
    family: str
    f: sympy.Expr | None
    B: dict[int, sympy.Expr]
    b: sympy.Expr
    gamma: sympy.Expr


@dataclasses.dataclass(frozen=True, slots=True)
class SymbolicContacts:
    """The K inequalities g >= 0: rows with f = g, their lambda, and their coefficients of restitution."""

    rows: tuple[SymbolicRow, ...] = ()
    lam: tuple[sympy.Symbol, ...] = ()
    restitution: tuple[float, ...] = ()


@dataclasses.dataclass(frozen=True, slots=True)
class Symbolic:
    """The system M a = h + B^T lambda in symbols, with the abbreviations of `table.calculus`.

    names, q, v, a (n): coordinates as in the compiled system. M by numbers of coordinates, i <= j, without zeros.
    newton: numbers of the Cartesian particles whose coordinates enter neither T of dependent particles nor the
    `lagrangian`, which obey Newton's equations by themselves; lagrange: numbers of all other coordinates. general: T of
    the dependent particles, extra: the `lagrangian`, potentials: the terms of V, forces: the other F_k by particle;
    Q (n): of forces without a potential; contacts: the inequalities, which are no rows here.
    """

    table: SymbolTable
    names: tuple[str, ...]
    q: tuple[sympy.Symbol, ...]
    v: tuple[sympy.Symbol, ...]
    a: tuple[sympy.Symbol, ...]
    newton: tuple[int, ...]
    lagrange: tuple[int, ...]
    general: sympy.Expr
    extra: sympy.Expr
    potentials: tuple[sympy.Expr, ...]
    forces: dict[int, Triple]
    Q: dict[int, sympy.Expr]
    M: dict[tuple[int, int], sympy.Expr]
    h: tuple[sympy.Expr, ...]
    rows: tuple[SymbolicRow, ...]
    lam: tuple[sympy.Symbol, ...]
    contacts: SymbolicContacts

    def closed(self, numbers: Sequence[int]) -> Symbolic:
        """The system in which these contacts are rows after the others, and there are no further ones."""
        rows = (*self.rows, *(self.contacts.rows[j] for j in numbers))
        lam = (*self.lam, *(self.contacts.lam[j] for j in numbers))
        return dataclasses.replace(self, rows=rows, lam=lam, contacts=SymbolicContacts())

    @property
    def all_closed(self) -> Symbolic:
        return self.closed(range(len(self.contacts.rows)))

    @property
    def free(self) -> dict[int, int]:
        """The particles that obey Newton's equations, by the numbers of their coordinates x."""
        names = self.table.particles.names
        return {self.names.index(f"{names[number]}.x"): number for number in self.newton}

    def velocity(self, row: SymbolicRow) -> sympy.Expr:
        """B v + b of a row."""
        return sum((slope * self.v[i] for i, slope in row.B.items()), row.b)

    def matrix(self, i: int, j: int) -> sympy.Expr:
        return self.M.get((min(i, j), max(i, j)), ZERO)

    def inertial(self, i: int, a: Sequence[sympy.Expr], rest: sympy.Expr = ZERO) -> sympy.Expr:
        """sum_j M_ij a_j, and `rest`."""
        pairs = ((self.matrix(i, j), each) for j, each in enumerate(a))
        return sum((m * each for m, each in pairs if m != 0), rest)

    def pull(self, i: int, factors: Sequence[sympy.Expr]) -> sympy.Expr:
        """sum_r factor_r B_ri of rows on a coordinate, of those of `lam` Q'_i."""
        pairs = zip(self.rows, factors, strict=True)
        return sum((row.B[i] * factor for row, factor in pairs if i in row.B), ZERO)


def symbolic(
    model: nouns.Model, bodies: tuple[rigid.Geometry, ...], values: frozenset[str] = frozenset()
) -> Symbolic:
    """The system of a model. `values`: parameters to put in as numbers. Raises `diagnostics.ModelError`."""
    table = SymbolTable(model, values)
    calculus, names, index = table.calculus, tuple(table.coordinates), table.index
    rows = tuple(_rows(table, bodies))
    # The terms of V: declared potentials, and -F.r of constant forces
    potentials: list[sympy.Expr] = []
    for force in model.forces:
        if isinstance(force, nouns.Potential):
            for member in range(force.members.count):
                potentials.append(table.evaluated(force.expression, view(force.members, member)))
        elif isinstance(force, nouns.ParticleForce) and force.constant:
            for number, F in _on_particles(table, force):
                r = table.position(number)
                potentials.append(-sum((f * x for f, x in zip(F, r, strict=True)), ZERO))
    forces, Q = _forces(table)
    general = _kinetic(table)
    extra = ZERO if model.lagrangian is None else table.evaluated(model.lagrangian)
    through = calculus.symbols(general + extra)
    newton: list[int] = []
    M, h = _lagrange(table, general + extra)
    free = [number for number in range(len(table.particles)) if not table.is_dependent(number)]
    for number in free:
        own = [f"{table.particles.names[number]}.{axis}" for axis in "xyz"]
        if not any({table.coordinates[c], table.rates[c]} & through for c in own):
            newton.append(number)
        for i in map(names.index, own):
            M[i, i] = M.get((i, i), ZERO) + table.mass(number)
    alone = {names.index(f"{table.particles.names[number]}.{axis}") for number in newton for axis in "xyz"}
    for i, push in Q.items():
        h[i] += push
    for term in potentials:
        for x in calculus.symbols(term) & index.keys():
            h[index[x]] -= calculus.partial(term, x)
    walls = ((law.members.base, row) for law in model.inequality for row in _values(table, law))
    contacts = [_holonomic(table, (name, base), value) for base, (name, value) in walls]
    return Symbolic(
        table=table,
        names=names,
        q=tuple(index),
        v=tuple(table.rates.values()),
        a=tuple(table.accelerations.values()),
        newton=tuple(newton),
        lagrange=tuple(i for i in range(len(names)) if i not in alone),
        general=general,
        extra=extra,
        potentials=tuple(potentials),
        forces=forces,
        Q=Q,
        M=M,
        h=tuple(h),
        rows=rows,
        lam=_multipliers(rows),
        contacts=SymbolicContacts(tuple(contacts), _multipliers(contacts), tuple(model.restitution.tolist())),
    )


def _multipliers(rows: Sequence[SymbolicRow]) -> tuple[sympy.Symbol, ...]:
    return tuple(sympy.Symbol(f"lambda.{row.name}", real=True) for row in rows)


def _on_particles(table: SymbolTable, force: nouns.ParticleForce) -> Iterator[tuple[int, Triple]]:
    for target, acting in zip(force.action.targets.tolist(), force.action.acting.tolist(), strict=True):
        # `m`, `r`, `v` of the particle in the force on it
        own = {"m": table.mass(target), "r": table.position(target), "v": table.velocity(target)}
        yield target, table.triple(force.force, view(force.members, acting, own))


def _forces(table: SymbolTable) -> tuple[dict[int, Triple], dict[int, sympy.Expr]]:
    """F_k of forces without a potential, and Q_j = sum_k F_k . dr_k/dq_j (D.30) with the generalized ones."""
    forces: dict[int, Triple] = {}
    Q: dict[int, sympy.Expr] = {}
    index = table.index
    first = len(index) - len(table.generalized)
    for force in table.model.forces:
        if isinstance(force, nouns.ParticleForce) and not force.constant:
            for number, F in _on_particles(table, force):
                x, y, z = forces.get(number, NOTHING)
                forces[number] = (x + F[0], y + F[1], z + F[2])
        elif isinstance(force, nouns.GeneralizedForce):
            action = force.action
            for target, acting in zip(action.targets.tolist(), action.acting.tolist(), strict=True):
                value = table.evaluated(force.force, view(force.members, acting))
                Q[first + target] = Q.get(first + target, ZERO) + value
    for number, F in forces.items():
        for f, x in zip(F, table.position(number), strict=True):
            for symbol in table.calculus.symbols(x) & index.keys():
                i = index[symbol]
                Q[i] = Q.get(i, ZERO) + f * table.calculus.partial(x, symbol)
    rates = tuple(table.rates.values())
    for i, value in Q.items():  # ordered by rates, where that is shorter
        Q[i] = value if value.count_ops() > MAX_EXPANDED else shorter(tidy(value), polynomial(value, rates))
    return forces, Q


def _kinetic(table: SymbolTable) -> sympy.Expr:
    """T of the dependent particles, quadratic in the rates, with every coefficient tidied.

    M_ij = sum_k m_k dr_k/dq_i . dr_k/dq_j, with the parts of a moving base.
    """
    calculus, products = table.calculus, 0
    moving = {**calculus.moving, TIME: sympy.Integer(1)}
    sums: dict[tuple[sympy.Symbol, sympy.Symbol], list[sympy.Expr]] = {}
    for number in filter(table.is_dependent, range(len(table.particles))):
        position = table.position(number)
        present = frozenset().union(*(calculus.symbols(part) for part in position))
        slopes = [(x, [calculus.partial(part, x) for part in position]) for x in moving if x in present]
        products += len(slopes) ** 2
        if products > MAX_PRODUCTS:
            particle = next(p for p in table.model.particles if p.is_dependent)
            message = (
                "the equations cannot be written out: T of the particles has more than"
                f" {MAX_PRODUCTS} products of slopes from `{table.particles.names[number]}` on"
            )
            hint = "Cartesian particles with rows have equations of bounded length"
            raise diagnostics.error("too-large-to-derive", message, particle.location, hint)
        half = table.mass(number) / 2
        for i, (x, u) in enumerate(slopes):
            for y, w in slopes[i:]:
                term = sum((a * b for a, b in zip(u, w, strict=True)), ZERO)
                if term != 0:
                    sums.setdefault((x, y), []).append(half * term * (1 if x == y else 2))
    total = [tidy(sympy.Add(*terms)) * moving[x] * moving[y] for (x, y), terms in sums.items()]
    return sympy.Add(*total)


def _lagrange(
    table: SymbolTable, L: sympy.Expr
) -> tuple[dict[tuple[int, int], sympy.Expr], list[sympy.Expr]]:
    """M and h of T + the `lagrangian`: d/dt dL/dv - dL/dq = M a - h."""
    calculus = table.calculus
    moving = list(calculus.moving.items())
    M: dict[tuple[int, int], sympy.Expr] = {}
    h = [ZERO] * len(moving)
    present = calculus.symbols(L)
    rates = tuple(v for _, v in moving)
    for i, (x, v) in enumerate(moving):
        if v in present:
            momentum = calculus.partial(L, v)
            inside = calculus.symbols(momentum)
            for j, (_, other) in enumerate(moving[i:], i):
                if other in inside and (entry := tidy(calculus.partial(momentum, other))) != 0:
                    M[i, j] = entry
            h[i] -= calculus.rate(momentum)
        if x in present:
            h[i] += calculus.partial(L, x)
        if h[i] != 0 and h[i].count_ops() < MAX_EXPANDED:
            h[i] = polynomial(h[i], rates)
    return M, h


def _rows(table: SymbolTable, bodies: tuple[rigid.Geometry, ...]) -> Iterator[SymbolicRow]:
    """All rows in the order of the multipliers; the constants of rigid bodies are noted with their numbers."""
    rates = {v: i for i, v in enumerate(table.rates.values())}
    for law in table.model.holonomic:
        for name, value in _values(table, law):
            yield _holonomic(table, (name, law.members.base), value)
    for body, geometry in zip(table.model.rigid, bodies, strict=True):
        for number, value in enumerate(_rigid(table, body, geometry), 1):
            yield _holonomic(table, (f"{body.name}.{number}", body.name), value)
    for rule in table.model.differential:
        for name, value in _values(table, rule):
            B, b = _slopes(table, value, rates), _at_rest(table, value)
            gamma = tidy(-table.calculus.rate(value))
            yield SymbolicRow(name, rule.members.base, None, B, tidy(b), gamma)


def _values(
    table: SymbolTable, law: nouns.Holonomic | nouns.Differential | nouns.Inequality
) -> Iterator[tuple[str, sympy.Expr]]:
    """The names of the rows of a law with left - right."""
    each = len(law.rows) // max(1, law.members.count)
    for member in range(law.members.count):
        parts = table.difference(law.equation, view(law.members, member))
        yield from zip(law.rows[member * each : (member + 1) * each], parts, strict=True)


def _holonomic(table: SymbolTable, names: tuple[str, str], f: sympy.Expr) -> SymbolicRow:
    """A row f = 0, with its name and that of its family."""
    rate = table.calculus.rate(f)
    B, b = _slopes(table, f, table.index), _at_rest(table, rate)
    return SymbolicRow(*names, f, B, tidy(b), tidy(-table.calculus.rate(rate)))


def _slopes(table: SymbolTable, value: sympy.Expr, index: dict[sympy.Symbol, int]) -> dict[int, sympy.Expr]:
    """The partial derivatives that do not vanish, by the numbers of their symbols."""
    present = table.calculus.symbols(value)
    slopes = ((i, table.calculus.partial(value, x)) for x, i in index.items() if x in present)
    return {i: tidy(slope) for i, slope in slopes if slope != 0}


def _at_rest(table: SymbolTable, value: sympy.Expr) -> sympy.Expr:
    """The part of a rate that is left where nothing moves: the term beside dt."""
    calculus = table.calculus
    moving = frozenset(calculus.moving.values())
    still = dict.fromkeys(calculus.symbols(value) & moving, ZERO)
    for symbol in calculus.symbols(value) & calculus.known.keys():
        known = calculus.known[symbol]
        if not known.is_root and calculus.symbols(known.inner) & moving:
            still[symbol] = ZERO
    return value.xreplace(still)


def _rigid(table: SymbolTable, body: nouns.RigidBody, geometry: rigid.Geometry) -> Iterator[sympy.Expr]:
    """The rows of a rigid body: distances in its base, then x, y, z of each further particle."""
    positions = [table.position(number) for number in body.particles]
    names = [table.particles.names[number] for number in body.particles]
    base = [positions[k] for k in geometry.base]

    def constant(name: str, value: float, positive: bool = False) -> sympy.Symbol:
        symbol = sympy.Symbol(name, real=True, positive=True if positive else None)
        table.body_constants[symbol] = value
        return symbol

    for (i, j), value in zip(geometry.pairs, geometry.distances, strict=True):
        x, y, z = (u - w for u, w in zip(base[i], base[j], strict=True))
        label = f"{names[geometry.base[i]]},{names[geometry.base[j]]}"
        length = constant(f"length {body.name} {label}", value, positive=True)
        yield table.root(x**2 + y**2 + z**2, (x, y, z)) - length
    for row, k in enumerate(geometry.further):
        labels = (f"weight {body.name} {names[k]},{names[b]}" for b in geometry.base)
        weights = [constant(*one) for one in zip(labels, geometry.alpha[row].tolist(), strict=True)]
        height = None
        if geometry.gamma.size:
            height = constant(f"height {body.name} {names[k]}", float(geometry.gamma[row]))
            (a, b, c), (x, y, z) = ([p - q for p, q in zip(base[i], base[0], strict=True)] for i in (1, 2))
            normal = b * z - c * y, c * x - a * z, a * y - b * x  # (r_2 - r_1) x (r_3 - r_1)
        for axis in range(3):
            point = sum((w * r[axis] for w, r in zip(weights, base, strict=True)), ZERO)
            if height is not None:
                point += height * normal[axis]
            yield positions[k][axis] - point
