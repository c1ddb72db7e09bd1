"""The equation for the multipliers, and solutions: lambda and accelerations in closed form."""

from __future__ import annotations

from collections.abc import Iterator

import sympy

from lagcli.derivation.sections.derivation_page import Line
from lagcli.derivation.sections.one_sided_sections import TITLE, OneSided
from lagcli.derivation.sections.page_sections import Sections
from lagcli.derivation.symbolic import multiplier_equations
from lagcli.derivation.symbolic.calculus import NOTHING
from lagcli.derivation.symbolic.symbolic_system import Symbolic
from lagcli.derivation.symbolic.tidy import polynomial, tidy
from lagcli.derivation.writing import formula as f
from lagcli.pfaffian.forms.notation import ZERO

SHORT = 16  # operations up to which lambda is put into accelerations
MOST_CLOSED = 3  # contacts of which each is shown closed alone
COMPONENT = 40  # operations up to which a component of an acceleration has a longer lambda put in
FREE = multiplier_equations.ClosedForm({}, "", {})  # of a system without rows


def sections(
    system: Symbolic, parts: Sections, contacts: OneSided, solve: bool
) -> list[tuple[str, list[Line]]]:
    """The equation for lambda (D.24), what contacts and impacts ask for, and solutions where they are asked for."""
    every = system.all_closed
    if not every.rows:
        if not solve:
            return []
        inverted = multiplier_equations.inverse(system)
        note = "There is no constraint row, and so no multiplier."
        if inverted.entries is None:
            note = f"Accelerations in closed form are not written out: {inverted.reason}."
        lines = [Line(note=note)]
        lines += [] if inverted.entries is None else _accelerations(system, parts, inverted, FREE, {})
        return [("Solution", lines)]
    title = "Multiplier equation  (B M⁻¹ Bᵀ) λ = γ − B M⁻¹ h"
    lines = list(parts.gammas())
    inverted = multiplier_equations.inverse(system)
    equation = None
    if inverted.entries is not None:
        equation = multiplier_equations.equation(every, inverted.entries)
        for r, row in enumerate(system.rows):
            terms = (equation.S.get((r, j), ZERO) * lam for j, lam in enumerate(every.lam))
            sides = parts.signs.node(sum(terms, ZERO)), parts.signs.node(equation.right[r])
            lines.append(Line("D.24", sides, kind="S", family=row.family))
    elif system.rows:
        lines.append(Line(note=f"B M⁻¹ Bᵀ is not written out: {inverted.reason}."))
    drafts = [(title, lines), (TITLE, list(contacts.contact(equation))), ("Impact", list(contacts.impact()))]
    if solve and equation is None:
        note = f"λ in closed form is not written out: {inverted.reason}."
        drafts.append(("Solution", [Line(note=note)]))
    elif solve:
        drafts += _solutions(system, parts, contacts, inverted)
    return drafts


def _solutions(
    system: Symbolic, parts: Sections, contacts: OneSided, inverted: multiplier_equations.Inverse
) -> Iterator[tuple[str, list[Line]]]:
    """Solutions with all contacts open, and with each of the first few closed alone."""
    assert inverted.entries is not None
    names = [row.name for row in system.contacts.rows]
    for closed in ((), *((j,) for j in range(min(len(names), MOST_CLOSED)))):
        mode = system.closed(closed)
        own = Sections(mode, parts.signs) if names else parts
        while_ = f" while {names[closed[0]]} alone is closed" if closed else " while all contacts are open"
        title = f"Solution{while_ if names else ''}"
        if not mode.rows:
            yield title, list(_accelerations(mode, own, inverted, FREE, {}))
            continue
        equation = multiplier_equations.equation(mode, inverted.entries)
        solved, signs = multiplier_equations.solve(mode, equation), own.signs
        lines: list[Line] = []
        shown = [(x, value) for x, value in solved.on.items() if not str(x).startswith("product ")]
        if not solved.values:
            lines.append(Line(note=f"No closed form: {solved.reason}."))
        elif shown:
            left, right = (tuple(map(signs.node, side)) for side in zip(*shown, strict=True))
            lines.append(Line(note="On the constraints, where"))
            sides = (left[0], right[0]) if len(shown) == 1 else (f.Triple(left), f.Triple(right))
            lines.append(Line(sides=sides))
        for r, value in solved.values.items():
            lines.append(Line("D.24", (signs.node(mode.lam[r]), signs.node(value)), kind="lambda"))
        if solved.values and solved.reason:
            lines.append(Line(note=f"No closed form of the others: {solved.reason}."))
        if solved.values:
            put = {mode.lam[r]: value for r, value in solved.values.items()}
            lines.extend(_accelerations(mode, own, inverted, solved, put))
        if closed:
            whole = multiplier_equations.equation(system.all_closed, inverted.entries)
            lines.extend(contacts.alone(closed[0], whole, multiplier_equations.surface(mode)))
        yield title, lines
    if len(names) > MOST_CLOSED:
        note = f"Of {len(names)} contacts the first {MOST_CLOSED} are shown closed."
        yield "Other solutions", [Line(note=note)]


def _accelerations(
    system: Symbolic,
    parts: Sections,
    inverted: multiplier_equations.Inverse,
    solved: multiplier_equations.ClosedForm,
    put: dict[sympy.Symbol, sympy.Expr],
) -> Iterator[Line]:
    """Accelerations, with lambda put in where that stays short."""
    signs = parts.signs
    lengths = {x: value for x, value in solved.on.items() if str(x).startswith("root ")}
    h = list(system.h)
    for row, lam in zip(system.rows, system.lam, strict=True):
        for i, slope in row.B.items():
            h[i] += slope * lam
    for first, number in system.free.items():
        mass = system.table.mass(number)
        x, y, z = (tidy(value / mass) for value in system.h[first : first + 3])
        # A long lambda stays a lambda.
        short = {lam for lam in system.lam if lam in put and put[lam].count_ops() <= SHORT}
        factors = [tidy((put[lam] if lam in short else lam) / mass) for lam in system.lam]
        terms = [] if (x, y, z) == NOTHING else signs.scaled(sympy.Integer(1), (x, y, z))
        terms += parts.reaction(first, factors, lengths)
        left = signs.of_particle("r", system.table.particles.names[number], dots=2)
        yield Line("D.23", (left, f.joined(terms)), kind="acceleration")
        long = set(system.lam) & set().union(*(h[i].free_symbols for i in range(first, first + 3))) - short
        if long and long <= put.keys():
            for i in range(first, first + 3):
                value = _closed(system, h[i].xreplace(put) / mass, solved.on)
                if value.count_ops() <= COMPONENT:
                    yield Line("D.23", (signs.node(system.a[i]), signs.node(value)), kind="component")
    assert inverted.entries is not None
    for i in system.lagrange:
        value = sum((inverted.entries.get((i, j), ZERO) * h[j] for j in system.lagrange), ZERO)
        whole = _closed(system, value.xreplace(put), solved.on)
        if whole.count_ops() > multiplier_equations.MAX_OPERATIONS:
            whole = tidy(value)
        driven = any(system.Q.get(j, ZERO) != 0 for j in system.lagrange)
        equation = "D.53" if system.rows else "D.34" if driven else "D.39"
        yield Line(equation, (signs.node(system.a[i]), signs.node(whole)), kind="acceleration")


def _closed(system: Symbolic, value: sympy.Expr, on: dict[sympy.Symbol, sympy.Expr]) -> sympy.Expr:
    """The form of an acceleration that reads best, with what the rows say put in."""
    whole = tidy(multiplier_equations.put(system, value, on))
    small = whole.count_ops() <= 2 * multiplier_equations.MAX_OPERATIONS
    shorter = multiplier_equations.cancelled(whole, system.v) if small else []
    return min(*shorter, polynomial(whole, system.v), whole, key=multiplier_equations.complexity)
