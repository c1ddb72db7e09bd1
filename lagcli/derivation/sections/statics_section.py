"""The lines about points of rest: the equations of motion with q' = q'' = 0, which are the recipe for f = V (D.25)."""

from __future__ import annotations

from collections.abc import Iterator

from lagcli.derivation.sections.derivation_page import Line
from lagcli.derivation.sections.page_sections import NIL, Sections, joined, terms_of, triple
from lagcli.derivation.symbolic.symbolic_system import Symbolic
from lagcli.derivation.symbolic.tidy import tidy
from lagcli.pfaffian.forms.notation import ZERO

TITLE = "Points of rest  F + Bᵀλ = 0"


def lines(system: Symbolic, parts: Sections) -> Iterator[Line]:
    """F_k + sum_i lambda_i B_ik = 0 of each particle, and of each coordinate with the inertial terms that are left; and
    the rows that must not move."""
    signs = parts.signs
    still = dict.fromkeys(system.v, ZERO)
    every = system.all_closed
    h = tuple(tidy(value.xreplace(still)) for value in system.h)
    if any(str(symbol).startswith("product ") for value in h for symbol in value.free_symbols):
        return  # products of velocities that have letters of their own
    for number in system.newton:
        first = system.place(number)
        F = signs.vector(triple(h, first))
        terms = ([] if F == NIL else terms_of(F)) + parts.reaction(first, every.lam)
        if terms:
            family = system.world.particles.names[number].partition("[")[0]
            yield Line("D.25", (joined(terms), NIL), kind="rest", family=family)
    for i in system.lagrange:
        pulls = (row.B.get(i, ZERO) * lam for row, lam in zip(every.rows, every.lam, strict=True))
        total = tidy(h[i] + sum(pulls, ZERO))
        if total != 0:
            yield Line("D.25", (signs.node(total), NIL), kind="rest")
    for row in system.rows:
        if row.b != 0:
            yield Line("D.6", (signs.node(tidy(row.b)), NIL), kind="rest row", family=row.family)
