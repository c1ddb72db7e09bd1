"""The lines about the other principle: Lagrange's equations of L + sum_i mu_i (A_i v + b_i), over differential rows.

M a + ... + A^T mu' = ... + J^T lambda + mu . (curl of the rows) v, beside (D.53).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import sympy

from lagcli.derivation.sections.derivation_page import Line
from lagcli.derivation.symbolic.signs import Signs
from lagcli.derivation.symbolic.symbolic_system import Symbolic
from lagcli.derivation.symbolic.tidy import polynomial, tidy
from lagcli.derivation.writing import formula as f
from lagcli.pfaffian.forms.notation import ZERO

TITLE = "The other principle: vakonomic motion"


def lines(system: Symbolic, signs: Signs) -> Iterator[Line]:
    """L + sum mu_i phi_i and its equations, coordinate by coordinate; none where they are (D.53) or there is no
    action."""
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
    mus, rates = (
        [sympy.Symbol(f"{letter}.{row.name}", real=True) for row in rows] for letter in ("mu", "mu'")
    )
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
        accelerated = ((system.matrix(i, j), a) for j, a in enumerate(system.a))
        inertial = sum((m * a for m, a in accelerated if m != 0), ZERO) + polynomial(-system.h[i], system.v)
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
