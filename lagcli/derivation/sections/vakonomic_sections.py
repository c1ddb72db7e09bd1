"""The lines about the other principle: Lagrange's equations of L + sum_i mu_i (A_i v + b_i), over differential rows.

M a + ... + A^T mu' = ... + J^T lambda + mu . (curl of the rows) v, beside (D.53).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import sympy

from lagcli.derivation.sections.derivation_page import Line
from lagcli.derivation.sections.page_sections import Sections
from lagcli.derivation.symbolic.signs import Signs
from lagcli.derivation.symbolic.symbolic_system import Symbolic
from lagcli.derivation.symbolic.tidy import polynomial, tidy
from lagcli.derivation.writing import formula as f
from lagcli.pfaffian.forms.notation import ZERO

TITLE = "The other principle: vakonomic motion"


class Vakonomic:
    """The lines of the vakonomic equations of one system; none where they are (D.53) or there is no action."""

    def __init__(self, system: Symbolic, signs: Signs, parts: Sections) -> None:
        self._system, self._signs, self._parts = system, signs, parts
        self._rows = tuple(row for row in system.rows if row.f is None)
        self._mu: dict[str, sympy.Symbol] = {}
        self._mu_rate: dict[str, sympy.Symbol] = {}

    def lines(self) -> Iterator[Line]:
        """L + sum mu_i phi_i and its equations, coordinate by coordinate."""
        if not self._rows:
            return
        if self._system.contacts.rows:
            yield Line(
                note="Not written out: one-sided constraints push without being equations of the paths."
            )
            return
        # A force without a declared potential that depends on more than time may have none
        system, moving = self._system, {*self._system.q, *self._system.v}
        acting = [*system.Q.values(), *(part for force in system.forces.values() for part in force)]
        if any(not moving.isdisjoint(system.table.calculus.symbols(part)) for part in acting):
            yield Line(
                note="Not written out: a force that is declared without a potential depends on more than time, and"
                " may be in no action; `compare --vakonomic` tells whether it has a potential."
            )
            return
        signs = self._signs
        for row in self._rows:
            mu = self._mu[row.name] = sympy.Symbol(f"mu.{row.name}", real=True)
            rate = self._mu_rate[row.name] = sympy.Symbol(f"mu'.{row.name}", real=True)
            signs.show(mu, Signs.of_row("μ", row.name), f"mu.{row.name}")
            signs.show_as(rate, dataclasses.replace(signs.sign(mu), dots=1), mu)
        yield Line(
            note="Stationary action among the paths that satisfy the rows, d'Alembert's motion only where they can be"
            " integrated (`compare --vakonomic`). With L + Σ μᵢ (Aᵢ v + bᵢ) over the differential rows:"
        )
        for first in map(system.first_index, system.newton):
            own = range(first, first + 3)
            if any(i in row.B for row in self._rows for i in own) or any(self._curls(i) != 0 for i in own):
                yield from map(self._equation, own)
        for i in system.lagrange:
            yield self._equation(i)
        yield Line(
            note="These, with the rows differentiated once, give accelerations, λ of the holonomic rows and μ̇; μ needs"
            " a value at the start."
        )

    def _equation(self, i: int) -> Line:
        """d/dt d(L + mu phi)/dq' - d(L + mu phi)/dq = sum lambda_j df_j/dq of one coordinate."""
        system, signs = self._system, self._signs
        accelerated = ((system.matrix(i, j), a) for j, a in enumerate(system.a))
        inertial = sum((m * a for m, a in accelerated if m != 0), ZERO) + polynomial(-system.h[i], system.v)
        carried = ZERO
        for row in self._rows:
            if i in row.B:  # A mu', with the sign before it
                rate, slope = self._mu_rate[row.name], row.B[i]
                carried += -(rate * -slope) if slope.could_extract_minus_sign() else rate * slope
        left = inertial + carried - self._curls(i)
        pairs = zip(system.rows, system.lam, strict=True)
        right = sum((row.B[i] * lam for row, lam in pairs if row.f is not None and i in row.B), ZERO)
        number = "D.53" if any(row.f is not None for row in system.rows) else "D.39"
        sides = signs.node(left), signs.node(tidy(right))
        return Line(number, sides, kind="vakonomic", family=f.family(system.names[i]))

    def _curls(self, i: int) -> sympy.Expr:
        """sum of mu_r (d(A_r v + b_r)/dq_i - dA_ri/dt)."""
        system, calculus, total = self._system, self._system.table.calculus, ZERO
        for row in self._rows:
            phi = sum((slope * system.v[j] for j, slope in row.B.items()), row.b)
            turned = calculus.rate(row.B[i]) if i in row.B else ZERO
            curl = tidy(calculus.partial(phi, system.q[i]) - turned)
            total += self._mu[row.name] * polynomial(curl, system.v)
        return total
