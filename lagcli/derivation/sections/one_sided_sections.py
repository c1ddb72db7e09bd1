"""The lines about inequalities: conditions and gradients, contact, and the law of impact of the theory.

0 <= lambda_j  _|_  g_j >= 0,   while closed   0 <= lambda_j  _|_  d2g_j/dt2 >= 0
M (v+ - v-) = B^T Lambda + G^T Lambda_G,   B v+ + b = 0,   0 <= Lambda_j  _|_  g'_j+ + e_j min(g'_j-, 0) >= 0
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping

import sympy

from lagcli.derivation.sections.derivation_page import Line
from lagcli.derivation.sections.page_sections import NIL, Sections
from lagcli.derivation.symbolic import multiplier_equations
from lagcli.derivation.symbolic.multiplier_equations import Equation
from lagcli.derivation.symbolic.signs import Signs
from lagcli.derivation.symbolic.symbolic_system import Symbolic, SymbolicRow
from lagcli.derivation.symbolic.tidy import tidy
from lagcli.derivation.writing import formula as f
from lagcli.pfaffian.forms.notation import ZERO

COMPLEMENTARY = ("≤", "⊥", "≥")
TITLE = "Contact  0 ≤ λ ⊥ G a − γ ≥ 0"


class OneSided:
    """The lines of the inequalities of one system."""

    def __init__(self, system: Symbolic, signs: Signs, parts: Sections) -> None:
        self._system, self._signs, self._parts = system, signs, parts
        self._every, self._contacts = system.all_closed, system.contacts
        self._impulses = tuple(sympy.Symbol(f"impulse.{row.name}", real=True) for row in self._every.rows)
        self._contact_impulses = self._impulses[len(system.rows) :]
        self._letters: dict[str, f.Sign] = {}
        if self._contacts.rows:
            for symbol, row in zip(self._impulses, self._every.rows, strict=True):
                signs.show(symbol, Signs.of_row("Λ", row.name), f"impulse.{row.name}")
            for row in self._contacts.rows:
                for letter, word in (("g", "gap"), ("e", "restitution")):
                    symbol, name = sympy.Symbol(f"{word} {row.name}"), f"{word}.{row.name}"
                    self._letters[symbol.name] = signs.show(symbol, Signs.of_row(letter, row.name), name)

    def _g(self, row: SymbolicRow, dots: int = 0, sup: str = "") -> f.Sign:
        return dataclasses.replace(self._letters[f"gap {row.name}"], dots=dots, sup=sup)

    def conditions(self) -> Iterator[Line]:
        """g >= 0, and lambda only where g = 0."""
        for row in self._contacts.rows:
            assert row.f is not None
            defined = (self._g(row), self._signs.node(tidy(row.f)), NIL)
            yield Line("", defined, kind="g", family=row.family, signs=("=", "≥"))
        if self._contacts.rows:
            yield Line(note="A contact pushes and never pulls, and only where it touches:")
        for row, lam in zip(self._contacts.rows, self._contacts.lam, strict=True):
            sides = (NIL, self._signs.node(lam), self._g(row), NIL)
            yield Line("", sides, kind="complementarity", family=row.family, signs=COMPLEMENTARY)

    def rows(self) -> Iterator[Line]:
        """G_jk and G_jt, the gradients of g, and dg/dt."""
        signs = self._signs
        for row in self._contacts.rows:
            for pair in self._parts.gradients("G", row):
                yield self._line(pair, "G", row)
        for row in self._contacts.rows:
            assert row.f is not None
            rate = tidy(self._system.table.calculus.rate(row.f))
            yield self._line((self._g(row, 1), signs.node(rate)), "rate", row)

    @staticmethod
    def _line(sides: tuple[f.FormulaNode, ...], kind: str, row: SymbolicRow) -> Line:
        return Line("", sides, kind=f"contact {kind}", family=row.family)

    def contact(self, equation: Equation | None) -> Iterator[Line]:
        """d2g/dt2 of closed contacts, with S lambda - right of `equation` where that is written out."""
        if not self._contacts.rows:
            return
        others = "with those of the rows " if self._system.rows else ""
        yield Line(
            note="Closed contacts (g = 0, ġ = 0) have the λ, found together "
            f"{others}for all of them at once, with which none is pressed in. Open ones have λ = 0."
        )
        every = self._every
        for r, row in enumerate(self._contacts.rows, len(self._system.rows)):
            # In lambda, or in accelerations
            if equation is not None:
                terms = (equation.S.get((r, k), ZERO) * lam for k, lam in enumerate(every.lam))
                second = sum(terms, -equation.right[r])
            else:
                second = sum((slope * every.a[i] for i, slope in row.B.items()), -row.gamma)
            yield self._line((self._g(row, 2), self._signs.node(second)), "second", row)
        for row, lam in zip(self._contacts.rows, self._contacts.lam, strict=True):
            sides = (NIL, self._signs.node(lam), self._g(row, 2), NIL)
            yield Line("", sides, kind="contact", family=row.family, signs=COMPLEMENTARY)
        yield Line(note="A contact opens at the instant at which its λ would become negative.")

    def impact(self) -> Iterator[Line]:
        if not self._contacts.rows:
            return
        yield Line(
            note="At the instant at which contacts with g = 0 have ġ < 0, velocities jump and positions do not. All"
            " rows and all contacts with g = 0 take part; + is just after and - just before."
        )
        # M (v+ - v-) = B^T Lambda + G^T Lambda_G
        signs, system = self._signs, self._system
        for first, number in system.free.items():
            if terms := self._parts.reaction(first, self._impulses):
                name = system.table.particles.names[number]
                jump = _beside(-1, signs.of_particle("r", name, dots=1))
                left = f.FormulaProduct((signs.node(system.table.mass(number)), jump))
                yield Line("", (left, f.joined(terms)), kind="jump", family=f.family(name))
        jumps = tuple(sympy.Symbol(f"jump {name}", real=True) for name in system.names)
        for i in system.lagrange:
            signs.show_as(jumps[i], _beside(-1, signs.sign(system.v[i])), system.a[i])
        for i in system.lagrange:
            total = sum((system.matrix(i, j) * jumps[j] for j in system.lagrange), ZERO)
            right = self._every.pull(i, self._impulses)
            yield Line("", (signs.node(total), signs.node(right)), kind="jump")
        # B v+ + b = 0 of the rows that are equations
        for row in system.rows:
            if row.f is not None:
                rate = dataclasses.replace(signs.of_row("f", row.name), dots=1, sup="+")
                yield Line("", (rate, NIL), kind="kept", family=row.family)
                continue
            total = row.b
            for i, slope in row.B.items():
                after = sympy.Symbol(f"after {system.names[i]}", real=True)
                signs.show_as(after, dataclasses.replace(signs.sign(system.v[i]), sup="+"), system.v[i])
                total += slope * after
            yield Line("", (signs.node(total), NIL), kind="kept", family=row.family)
        contacts = list(zip(self._contacts.rows, self._contacts.restitution, strict=True))
        for (row, e), impulse in zip(contacts, self._contact_impulses, strict=True):
            rebound: f.FormulaNode = self._g(row, 1, "+")  # g'+ + e min(g'-, 0)
            if e:
                met = f.Apply("min", (self._g(row, 1, "-"), NIL))
                given = f.FormulaProduct((self._letters[f"restitution {row.name}"], met))
                rebound = f.FormulaSum(((1, rebound), (1, given)))
            sides = (NIL, signs.node(impulse), rebound, NIL)
            yield Line("", sides, kind="impact", family=row.family, signs=COMPLEMENTARY)
        for row, e in contacts:
            if e:
                letter = self._letters[f"restitution {row.name}"]
                yield self._line((letter, f.FormulaNumber(f"{e:g}")), "e", row)
        yield Line(
            note="So a contact gives back the part e of the ġ it is met with, 0 where none is written, and there is"
            " an impulse only where it would be pressed in without."
        )
        if all(row.b == 0 for row in self._every.rows):
            # T+ - T- = 1/2 sum of Lambda_j (g'_j+ + g'_j-)
            half = f.Fraction(f.ONE, f.FormulaNumber("2"))
            factors = half, f.Sign("Σ", ("j",)), f.Sign("Λ", ("j",)), _beside(1, f.Sign("g", ("j",), 1))
            taken = _beside(-1, signs.energies["T"]), f.FormulaProduct(factors)
            yield Line("", taken, kind="energy")
            yield Line(
                note="An impact takes energy or none. With different e at one instant this could be positive, and"
                " that is refused."
            )

    def alone(self, j: int, equation: Equation, on: Mapping[sympy.Symbol, sympy.Expr]) -> Iterator[Line]:
        """Lambda of an impact on contact j alone, -(1 + e) g'- / (G P G^T), with what the rows say put in."""
        first = len(self._system.rows)
        if first >= multiplier_equations.MAX_ROWS:
            return
        chosen = [*range(first), first + j]
        matrix = sympy.Matrix([[equation.S.get((r, k), ZERO) for k in chosen] for r in chosen])
        matrix = matrix.applyfunc(lambda value: tidy(multiplier_equations.put(self._system, value, dict(on))))
        determinant = tidy(matrix[:first, :first].det(method="berkowitz")) if first else sympy.Integer(1)
        if determinant == 0:
            return
        pressed = tidy(tidy(matrix.det(method="berkowitz")) / determinant)
        if pressed == 0 or pressed.count_ops() > multiplier_equations.MAX_OPERATIONS:
            return
        row, e = self._contacts.rows[j], self._contacts.restitution[j]
        one = f.FormulaSum(((1, f.ONE), (1, self._letters[f"restitution {row.name}"])))
        factors = (self._signs.node(tidy(1 / pressed)), *((one,) if e else ()), self._g(row, 1, "-"))
        value = f.negative(f.FormulaProduct(factors))
        yield Line(note=f"An impact on {row.name} alone has the impulse")
        yield Line("", (self._signs.node(self._contact_impulses[j]), value), kind="impulse")


def _beside(sign: int, node: f.Sign) -> f.FormulaSum:
    """A value just after an impact plus or minus that just before."""
    return f.FormulaSum(((1, dataclasses.replace(node, sup="+")), (sign, dataclasses.replace(node, sup="-"))))
