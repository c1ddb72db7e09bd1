"""The lines about small oscillations: M dq'' + C dq' + K dq = B^T dlambda and its rows, about a reference motion."""

from __future__ import annotations

from collections.abc import Iterator

import sympy

from lagcli.derivation.sections.derivation_page import Line
from lagcli.derivation.sections.page_sections import NIL, joined, terms_of
from lagcli.derivation.symbolic.linear_matrices import LinearPoint, Matrices, NotLinearizedError, matrices
from lagcli.derivation.symbolic.signs import Signs
from lagcli.derivation.symbolic.symbolic_system import Symbolic
from lagcli.derivation.writing import formula as f
from lagcli.derivation.writing import paper_names

Symbols = tuple[sympy.Symbol, ...]
TITLE = "Small oscillations  M δq̈ + C δq̇ + K δq = Bᵀ δλ"
ABOUT = {
    "equilibrium": "About the declared start, an equilibrium; what is zero there is put in.",
    "steady": "About the declared start, an instant of a steady motion; what is zero there is put in.",
    "accelerated": (
        "About the motion from the declared start, which is uniformly accelerated: no steady motion, but its linear"
        " equations have constant coefficients; what is zero there is put in."
    ),
    "general": (
        "The declared start is no equilibrium and no steady motion. About any point of rest, with the coordinates and λ"
        " of that point (the command equilibrium finds them):"
    ),
}


def lines(whole: Symbolic, signs: Signs, point: LinearPoint) -> Iterator[Line]:
    """The linear equations coordinate by coordinate and row by row, then the values at the start of what is in them;
    or why they are not written."""
    if point.reason:
        yield Line(note=f"Not written out: {point.reason}.")
        return
    system = whole.closed(point.closed)
    try:
        linear = matrices(system, point)
    except NotLinearizedError as error:
        general = "the declared start is no equilibrium and no steady motion, and about any point of rest "
        yield Line(note=f"Not written out: {general if point.kind == 'general' else ''}{error}.")
        return
    is_accelerated = point.kind == "steady" and any(point.numbers[2])
    yield Line(note=ABOUT["accelerated" if is_accelerated else point.kind])
    if point.closed:
        names = ", ".join(whole.contacts.rows[j].name for j in point.closed)
        yield Line(note=f"Contacts that press count as rows: {names}.")
    elif whole.contacts.rows:
        yield Line(note="No contact counts as a row: they are open.")
    if not (linear.C or linear.K or linear.B or linear.D):
        yield Line(note="C and K are zero, and there are no rows: M δq̈ = 0, deviations drift.")
        return
    yield from _equations(system, signs, linear)
    if point.kind != "general":
        yield from _values(system, signs, linear, point)


def _equations(system: Symbolic, signs: Signs, linear: Matrices) -> Iterator[Line]:
    """The equations of motion by coordinate; B dq = 0 of holonomic rows, A dq' + D dq = 0 of differential rows."""
    # Symbols of dq, dq', dq'' by coordinate, and of dlambda by row, with their signs
    levels: list[Symbols] = []
    for dots, letters in enumerate((system.q, system.q, system.q, system.lam)):
        symbols = tuple(sympy.Symbol(f"deviation {dots} {letter}") for letter in letters)
        for symbol, letter in zip(symbols, letters, strict=True):
            signs.show_deviation(symbol, letter, dots % 3)
        levels.append(symbols)
    dq, dv, da, dlam = levels
    for i, name in enumerate(system.names):
        left = [
            *_terms(signs, linear.M, i, da),
            *_terms(signs, linear.C, i, dv),
            *_terms(signs, linear.K, i, dq),
        ]
        right: list[tuple[int, f.FormulaNode]] = []
        for r, lam in enumerate(dlam):
            if (r, i) in linear.B:
                right += terms_of(signs.node(linear.B[r, i] * lam))
        yield Line(sides=(joined(left), joined(right)), kind="deviation", family=paper_names.family(name))
    for r, row in enumerate(system.rows):
        is_holonomic = row.f is not None
        left = _terms(signs, linear.B, r, dq if is_holonomic else dv)
        left += [] if is_holonomic else _terms(signs, linear.D, r, dq)
        if left:
            yield Line(sides=(joined(left), NIL), kind="deviation row", family=row.family)


def _terms(
    signs: Signs, part: dict[tuple[int, int], sympy.Expr], i: int, symbols: Symbols
) -> list[tuple[int, f.FormulaNode]]:
    """The terms of one row of a matrix times deviations."""
    terms: list[tuple[int, f.FormulaNode]] = []
    for j, symbol in enumerate(symbols):
        if (i, j) in part:
            terms += terms_of(signs.node(part[i, j] * symbol))
    return terms


def _values(system: Symbolic, signs: Signs, linear: Matrices, point: LinearPoint) -> Iterator[Line]:
    """The values of letters at the start, as far as they are in the equations."""
    present = linear.symbols
    for letters, numbers in zip((system.q, system.v, system.a, system.lam), point.numbers, strict=True):
        for letter, number in zip(letters, numbers, strict=True):
            if letter in present:
                value: f.FormulaNode = f.FormulaNumber(f"{abs(number):.10g}")
                yield Line(
                    sides=(signs.node(letter), f.negative(value) if number < 0 else value),
                    kind="at the start",
                    family="start",
                )
