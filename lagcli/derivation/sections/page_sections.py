"""The contents of the page, with the numbers of the text: positions, rows, reactions, energies, motion."""

from __future__ import annotations

import dataclasses
import random
from collections.abc import Iterator, Mapping, Sequence

import sympy

from lagcli.derivation.sections.derivation_page import Line
from lagcli.derivation.symbolic.calculus import NOTHING, Key, Triple
from lagcli.derivation.symbolic.multiplier_equations import part
from lagcli.derivation.symbolic.signs import Signs
from lagcli.derivation.symbolic.symbolic_system import Symbolic, SymbolicRow
from lagcli.derivation.symbolic.tidy import polynomial, shorter, tidy
from lagcli.derivation.writing import formula as f
from lagcli.pfaffian.forms.notation import ZERO

NIL = f.ZERO
VAKONOMIC = "The other principle: vakonomic motion"
MAX_SORTED = 2000  # operations up to which V is multiplied out to find what its terms share
# Above so many operations the identity (D.31) is not expanded but tried with numbers.
MAX_OPERATIONS = 1500
POINTS, DIGITS = 2, 30
AGREED = sympy.Float("1e-20", DIGITS)


class Sections:
    """The lines of each section of one system."""

    def __init__(self, system: Symbolic, signs: Signs) -> None:
        self._system, self.signs, self._table = system, signs, system.table
        self._every = system.all_closed
        entries = (p for p in self._table.model.particles for _ in range(p.members.count))
        self._families = [p.members.base if p.members.count > 1 else "" for p in entries]

    def positions(self) -> Iterator[Line]:
        """x_n(q, t) of dependent particles (D.27) and their virtual displacements (D.28)."""
        signs, calculus = self.signs, self._table.calculus
        for number, name in enumerate(self._table.particles.names):
            if not self._table.is_dependent(number):
                continue
            position = self._table.position(number)
            family = self._families[number]
            r = signs.of_particle("r", name)
            yield Line("D.27", (r, signs.vector(position)), kind="r", family=family)
            terms: list[tuple[int, f.FormulaNode]] = []
            present = frozenset().union(*(calculus.symbols(x) for x in position))
            for i, q in enumerate(self._system.q):
                if q in present:
                    slope: Triple = tuple(tidy(calculus.partial(x, q)) for x in position)
                    if (vector := signs.vector(slope)) != NIL:
                        terms.append((1, f.FormulaProduct((vector, signs.with_prefix("δ", i)))))
            delta = f.Sign("δr", r.sub, vector=True)
            yield Line("D.28", (delta, f.joined(terms)), kind="δr", family=family)

    def constraints(self) -> Iterator[Line]:
        """f = 0 (D.2), and the differential rows as they are written (D.3, D.4)."""
        signs, system = self.signs, self._system
        forms = {n: law.form for law in self._table.model.differential for n in law.rows}
        for row in system.rows:
            if row.f is not None:
                left = signs.of_row("f", row.name)
                yield Line("D.2", (left, signs.node(tidy(row.f)), NIL), kind="f", family=row.family)
            elif forms[row.name] == "velocities":
                sides = signs.node(polynomial(system.velocity(row), system.v)), NIL
                yield Line("D.4", sides, kind="f", family=row.family)
            else:
                terms = [_times(signs.node(slope), signs.with_prefix("d", i)) for i, slope in row.B.items()]
                terms += [_times(signs.node(row.b), f.Sign("dt"))] if row.b != 0 else []
                yield Line("D.3", (f.FormulaSum(tuple(terms)), NIL), kind="f", family=row.family)

    def lengths(self) -> Iterator[Line]:
        """The meanings of the abbreviations."""
        for symbol, meaning in self.signs.definitions():
            yield Line(sides=(symbol, meaning), kind="where", family="lengths")

    def rows(self) -> Iterator[Line]:
        """B_ik and B_it (D.7), and the rows in velocities (D.6)."""
        signs, system = self.signs, self._system
        for row in system.rows:
            for sides in self.gradients("B", row):
                yield Line("D.7", sides, kind="B", family=row.family)
        still = [row.name for row in system.rows if row.b == 0]
        if still:
            every = len(still) == len(system.rows)
            rows = "every row i" if every else "the other rows i"
            yield Line("D.7", (f.Sign("B", ("it",)), NIL), note=f"for {rows}", kind="still")
        for row in system.rows:
            if row.f is not None:
                rate = tidy(self._table.calculus.rate(row.f))
                left = f.Sign("f", (f.subscript(row.name),), dots=1)
                yield Line("D.6", (left, signs.node(rate), NIL), kind="rate", family=row.family)

    def gradients(self, letter: str, row: SymbolicRow) -> Iterator[tuple[f.FormulaNode, f.FormulaNode]]:
        """The slopes of a row with what they are: by particles, by other coordinates, by t."""
        signs = self.signs
        free = self._system.free
        for first in dict.fromkeys(i - i % 3 for i in row.B if i - i % 3 in free):
            name = f.subscript(self._table.particles.names[free[first]])
            yield signs.of_row(letter, row.name, name), signs.vector(part(row.B, first))
        for i, slope in row.B.items():
            if i - i % 3 not in free:
                yield signs.of_row(letter, row.name, signs.label(i)), signs.node(slope)
        if row.b != 0:
            yield signs.of_row(letter, row.name, "t"), signs.node(row.b)

    def reactions(self) -> Iterator[Line]:
        """R_k = sum_i lambda_i B_ik (D.22), and Q'_n = sum_i lambda_i A_in (D.53)."""
        signs, system = self.signs, self._every
        for first, number in self._system.free.items():
            name = self._table.particles.names[number]
            R = f.joined(self.reaction(first, system.lam))
            yield Line("D.22", (signs.of_particle("R", name), R), kind="R", family=self._families[number])
        for i in system.lagrange:
            if any(i in row.B for row in system.rows):
                left = f.Sign("Q'", (signs.label(i),))
                pull = signs.node(system.pull(i, system.lam))
                yield Line("D.53", (left, pull), kind="Q'", family=self._kin(i))

    def reaction(
        self,
        first: int,
        factors: Sequence[sympy.Expr],
        lengths: Mapping[sympy.Symbol, sympy.Expr] | None = None,
    ) -> list[tuple[int, f.FormulaNode]]:
        """The terms of sum_i factor_i B_ik of rows and contacts on the particle whose x is coordinate number `first`.

        `lengths`: values of lengths that rows hold, to be put in.
        """
        terms: list[tuple[int, f.FormulaNode]] = []
        for row, factor in zip(self._every.rows, factors, strict=True):
            x, y, z = (slope.xreplace(lengths or {}) for slope in part(row.B, first))
            slopes = x, y, z
            if slopes != NOTHING and factor != 0:
                terms += self.signs.scaled(factor, slopes)
        return terms

    def energies(self) -> Iterator[Line]:
        """T, V and, with generalized coordinates, L (D.34-D.38)."""
        system, signs = self._system, self.signs
        letters = signs.energies
        T: sympy.Expr = system.general
        for number in range(len(self._table.particles)):
            if not self._table.is_dependent(number):
                if number in system.newton:
                    key: Key = ((f"v {self._table.particles.names[number]}", sympy.Integer(1)),), NOTHING
                    speed = self._table.product(key, key)
                else:
                    speed = sum((x**2 for x in self._table.velocity(number)), ZERO)
                T += self._table.mass(number) * speed / 2
        V = sympy.Add(*(tidy(term) for term in system.potentials))
        if V.count_ops() < MAX_SORTED:
            V = shorter(tidy(V), sympy.factor_terms(sympy.expand(V)))
        if len(self._table.particles):
            if system.general == T:
                grouped = polynomial(T, system.v)
            else:  # terms of equal coefficients together: m (v_a^2 + v_b^2)/2
                groups: dict[sympy.Expr, list[sympy.Expr]] = {}
                for term in sympy.Add.make_args(T):
                    speeds = [x for x in sympy.Mul.make_args(term) if str(x).startswith("product ")]
                    speed = speeds[0] if len(speeds) == 1 else sympy.Integer(1)
                    groups.setdefault(term / speed, []).append(speed)
                grouped = sympy.Add(*(c * sympy.Add(*members) for c, members in groups.items()))
            yield Line("D.34", (letters["T"], signs.node(grouped)), kind="T")
        if system.potentials:
            yield Line("D.35", (letters["V"], signs.node(V)), kind="V")
        if system.lagrange:
            sides: list[f.FormulaNode] = [letters["L"]]
            if len(self._table.particles) and system.extra == 0 and V != 0:
                sides.append(f.FormulaSum(((1, letters["T"]), (-1, letters["V"]))))
            yield Line("D.38", (*sides, signs.node(polynomial(T + system.extra, system.v) - V)), kind="L")

    def forces(self) -> Iterator[Line]:
        """Q_j of the forces without a potential (D.30)."""
        for i in self._system.lagrange:
            Q = self._system.Q.get(i, ZERO)
            if Q != 0:
                left = f.Sign("Q", (self.signs.label(i),))
                yield Line("D.30", (left, self.signs.node(Q)), kind="Q", family=self._kin(i))

    def newton(self) -> Iterator[Line]:
        """m_k a_k = F_k + sum_i lambda_i B_ik (D.23)."""
        signs, table = self.signs, self._table
        for first, number in self._system.free.items():
            name = table.particles.names[number]
            m = signs.node(table.mass(number))
            a = signs.of_particle("r", name, dots=2)
            left = a if table.mass(number) == 1 else f.FormulaProduct((m, a))
            terms = self._pulls(self._system.h, first)
            yield Line("D.23", (left, f.joined(terms)), kind="newton", family=self._families[number])

    def inertia(self) -> Iterator[Line]:
        """M_ij of the generalized coordinates."""
        signs = self.signs
        for (i, j), value in sorted(self._system.M.items()):
            if i in self._system.lagrange:
                comma = "," if max(len(signs.label(i)), len(signs.label(j))) > 1 else ""
                left = f.Sign("M", (f"{signs.label(i)}{comma}{signs.label(j)}",))
                yield Line("D.34", (left, signs.node(value)), kind="M", family=self._kin(i))

    def lagrange(self) -> Iterator[Line]:
        """d/dt dL/dq' - dL/dq = Q + sum_i lambda_i A_in (D.34, D.39, D.53)."""
        system, signs = self._system, self.signs
        bound = any(i in row.B for row in self._every.rows for i in system.lagrange)
        driven = any(system.Q.get(i, ZERO) != 0 for i in system.lagrange)
        number = "D.53" if bound else "D.34" if driven else "D.39"
        for i in system.lagrange:
            # h = Q - (what d/dt dL/dq' - dL/dq holds besides M a).
            inertial = polynomial(system.Q.get(i, ZERO) - system.h[i], system.v)
            left = inertial + system.inertial(i, system.a)
            right = system.Q.get(i, ZERO) + self._every.pull(i, self._every.lam)
            q, q_dot = signs.sign(system.q[i]), signs.sign(system.v[i])
            sides = f.lagrange(signs.energies["L"], q, q_dot), signs.node(left), signs.node(right)
            yield Line(number, sides, kind="lagrange", family=self._kin(i))

    def identity(self) -> Iterator[Line]:
        """The identity that leads from d'Alembert to Lagrange (D.31), verified for this model."""
        signs = self.signs
        for i, holds, method in identity(self._system):
            q, q_dot = signs.sign(self._system.q[i]), signs.sign(self._system.v[i])
            r = f.Sign("r", ("k",), vector=True)
            work = f.Dot(f.Sign("r", ("k",), 2, vector=True), f.Slope(r, q))
            left = f.FormulaProduct((f.Sign("Σ", ("k",)), f.Sign("m", ("k",)), work))
            note = f"holds {method}" if holds else f"DOES NOT HOLD {method}"
            sides = left, f.lagrange(signs.energies["T"], q, q_dot)
            yield Line("D.31", sides, note, "identity", self._kin(i))

    def gammas(self) -> Iterator[Line]:
        """gamma_i = -(B' v + b'), what B a must be."""
        for row in self._system.rows:
            left = self.signs.of_row("γ", row.name)
            yield Line("D.24", (left, self.signs.node(row.gamma)), kind="gamma", family=row.family)

    def _kin(self, i: int) -> str:
        return f.family(self._system.names[i])

    def _pulls(self, h: Sequence[sympy.Expr], first: int) -> list[tuple[int, f.FormulaNode]]:
        """The terms of F_k + sum_i lambda_i B_ik of a particle, F_k in h from the number of its x on."""
        F = self.signs.vector((h[first], h[first + 1], h[first + 2]))
        return ([] if F == NIL else f.terms_of(F)) + self.reaction(first, self._every.lam)

    def points_of_rest(self) -> Iterator[Line]:
        """The equations of motion with q' = q'' = 0, which are the recipe for f = V (D.25).

        F_k + sum_i lambda_i B_ik = 0 of each particle, and of each coordinate with the inertial terms that are left;
        and the rows that must not move.
        """
        system, signs = self._system, self.signs
        still = dict.fromkeys(system.v, ZERO)
        h = tuple(tidy(value.xreplace(still)) for value in system.h)
        if any(str(symbol).startswith("product ") for value in h for symbol in value.free_symbols):
            return  # products of velocities that have letters of their own
        for first, number in system.free.items():
            if terms := self._pulls(h, first):
                family = system.table.particles.names[number].partition("[")[0]
                yield Line("D.25", (f.joined(terms), NIL), kind="rest", family=family)
        for i in system.lagrange:
            total = tidy(h[i] + self._every.pull(i, self._every.lam))
            if total != 0:
                yield Line("D.25", (signs.node(total), NIL), kind="rest")
        for row in system.rows:
            if row.b != 0:
                yield Line("D.6", (signs.node(tidy(row.b)), NIL), kind="rest row", family=row.family)


def _times(coefficient: f.FormulaNode, factor: f.FormulaNode) -> tuple[int, f.FormulaNode]:
    """A term of a form: its sign, and coefficient and factor without it."""
    sign, coefficient = f.split(coefficient)
    if coefficient == f.ONE:
        return sign, factor
    if isinstance(coefficient, f.FormulaProduct):
        return sign, f.FormulaProduct((*coefficient.factors, factor))
    return sign, f.FormulaProduct((coefficient, factor))


def identity(system: Symbolic) -> Iterator[tuple[int, bool, str]]:
    """sum_k m_k a_k . dr_k/dq_j = d/dt dT/dq'_j - dT/dq_j (D.31) for every coordinate j that dependent particles move
    with: j, whether it holds, and how that is known.

    The left side comes from x_n(q, t) differentiated twice, the right side from the T that is printed.
    """
    calculus, table, T = system.table.calculus, system.table, system.general

    def rate(value: sympy.Expr) -> sympy.Expr:
        """d/dt of a function of coordinates, rates and time, along the accelerations."""
        total, present = calculus.rate(value), calculus.symbols(value)
        for v, a in zip(system.v, system.a, strict=True):
            if v in present:
                total += calculus.partial(value, v) * a
        return total

    left: dict[int, sympy.Expr] = {}
    for number in filter(table.is_dependent, range(len(table.particles))):
        position = table.position(number)
        acceleration = list(map(rate, table.velocity(number)))
        present = frozenset().union(*map(calculus.symbols, position))
        for j, q in enumerate(system.q):
            if q in present:
                slopes = (calculus.partial(part, q) for part in position)
                work = sum((a * slope for a, slope in zip(acceleration, slopes, strict=True)), ZERO)
                left[j] = left.get(j, ZERO) + table.mass(number) * work
    for j in sorted(left):
        right = rate(calculus.partial(T, system.v[j])) - calculus.partial(T, system.q[j])
        apart = calculus.expanded(left[j] - right)
        if apart.count_ops() <= MAX_OPERATIONS:
            # As exponentials multiplied out; no answer counts as no
            waves = apart.rewrite(sympy.exp) if apart.has(sympy.sin, sympy.cos, sympy.tan) else apart
            if sympy.expand(apart) == 0 or sympy.expand(sympy.powsimp(sympy.expand(waves))) == 0:
                yield j, True, "identically"
                continue
        # As numbers at random points
        source = random.Random(20060311)
        sides = calculus.expanded(left[j]), calculus.expanded(right)
        symbols = sorted(sides[0].free_symbols | sides[1].free_symbols, key=str)
        holds = True
        for _ in range(POINTS):
            point = {s: sympy.Rational(source.randint(200, 1800), 1000) for s in symbols}
            a, b = (sympy.N(side.xreplace(point), DIGITS) for side in sides)
            holds = holds and bool(a.is_number and b.is_number and abs(a - b) <= AGREED * (1 + abs(a)))
        yield j, holds, f"at {POINTS} random points, to 20 digits"


def vakonomic(system: Symbolic, signs: Signs) -> Iterator[Line]:
    """The other principle: Lagrange's equations of L + sum_i mu_i (A_i v + b_i), over differential rows; nothing where
    there are none.

    M a + ... + A^T mu' = ... + J^T lambda + mu . (curl of the rows) v, beside (D.53).
    """
    rows, calculus = [row for row in system.rows if row.f is None], system.table.calculus
    if not rows:
        return
    if system.contacts.rows:
        yield Line(note="Not written out: one-sided constraints push without being equations of the paths.")
        return
    # A force without a declared potential that depends on more than time may have none
    moving = {*system.q, *system.v}
    acting = [*system.Q.values(), *(part for force in system.forces.values() for part in force)]
    if any(not moving.isdisjoint(calculus.symbols(part)) for part in acting):
        yield Line(
            note="Not written out: a force that is declared without a potential depends on more than time, and"
            " may be in no action; `compare --vakonomic` tells whether it has a potential."
        )
        return
    names = [row.name for row in rows]
    mus, rates = ([sympy.Symbol(f"{mu}.{name}", real=True) for name in names] for mu in ("mu", "mu'"))
    for row, mu, rate in zip(rows, mus, rates, strict=True):
        signs.show(mu, Signs.of_row("μ", row.name), f"mu.{row.name}")
        signs.show_as(rate, dataclasses.replace(signs.sign(mu), dots=1), mu)

    def curls(i: int) -> sympy.Expr:
        """sum of mu_r (d(A_r v + b_r)/dq_i - dA_ri/dt)."""
        total = ZERO
        for row, mu in zip(rows, mus, strict=True):
            turned = calculus.rate(row.B[i]) if i in row.B else ZERO
            curl = tidy(calculus.partial(system.velocity(row), system.q[i]) - turned)
            total += mu * polynomial(curl, system.v)
        return total

    yield Line(
        note="Stationary action among the paths that satisfy the rows, d'Alembert's motion only where they can be"
        " integrated (`compare --vakonomic`). With L + Σ μᵢ (Aᵢ v + bᵢ) over the differential rows:"
    )
    chosen: list[int] = []
    for first in system.free:
        own = range(first, first + 3)
        if any(i in row.B for row in rows for i in own) or any(curls(i) != 0 for i in own):
            chosen += own
    number = "D.39" if len(rows) == len(system.rows) else "D.53"
    # d/dt d(L + mu phi)/dq' - d(L + mu phi)/dq = sum lambda_j df_j/dq of each coordinate
    for i in (*chosen, *system.lagrange):
        inertial = system.inertial(i, system.a) + polynomial(-system.h[i], system.v)
        carried = ZERO
        for row, rate in zip(rows, rates, strict=True):
            if i in row.B:  # A mu', with the sign before it
                slope = row.B[i]
                carried += -(rate * -slope) if slope.could_extract_minus_sign() else rate * slope
        pairs = zip(system.rows, system.lam, strict=True)
        right = sum((row.B[i] * lam for row, lam in pairs if row.f is not None and i in row.B), ZERO)
        sides = signs.node(inertial + carried - curls(i)), signs.node(tidy(right))
        yield Line(number, sides, kind="vakonomic", family=f.family(system.names[i]))
    yield Line(
        note="These, with the rows differentiated once, give accelerations, λ of the holonomic rows and μ̇; μ needs"
        " a value at the start."
    )
