"""Formulas in a markup language: what LaTeX and MathML write alike, and where parentheses stand."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

from lagcli.derivation.writing import formula as f


@dataclasses.dataclass(frozen=True, slots=True)
class Markup:
    """The words of one language.

    number: of digits and a power of ten; name: of a function and its power, each empty where there is none; row: what
    stands side by side, as one; applied, called: a name and its argument, without and with parentheses of its own.
    leading: a minus sign with nothing before it. Commas: between arguments, and between components.
    """

    sign: Callable[[f.Sign], str]
    number: Callable[[str, str], str]
    text: Callable[[str], str]
    name: Callable[[str, str], str]
    row: Callable[[str], str]
    closed: Callable[[str], str]
    root: Callable[[str], str]
    bars: Callable[[str], str]
    fraction: Callable[[str, str], str]
    power: Callable[[str, str], str]
    applied: Callable[[str, str], str]
    called: Callable[[str, str], str]
    leading: str
    minus: str
    plus: str
    space: str
    dot: str
    commas: tuple[str, str]
    differentials: tuple[str, str]

    def write(self, node: f.FormulaNode) -> str:
        """The formula in this language; each part of it is written once."""
        return _WRITERS[type(node)](self, node)

    def factor(self, node: f.FormulaNode) -> str:
        """A factor, in parentheses where it is a sum."""
        return self.closed(self.write(node)) if isinstance(node, f.SUMS) else self.write(node)

    def listed(self, nodes: tuple[f.FormulaNode, ...], comma: str) -> str:
        """Formulas with commas between them."""
        return comma.join(map(self.write, nodes))


def _sum(to: Markup, node: f.FormulaSum) -> str:
    written = ""
    for index, (sign, term) in enumerate(node.terms):
        written += (to.minus if index else to.leading) if sign < 0 else to.plus if index else ""
        written += to.closed(to.write(term)) if isinstance(term, f.FormulaSum) else to.write(term)
    return to.row(written)


def _power(to: Markup, node: f.FormulaPower) -> str:
    base = to.write(node.base)
    return to.power(to.closed(base) if isinstance(node.base, f.COMPOSED) else base, to.write(node.exponent))


def _apply(to: Markup, node: f.Apply) -> str:
    name = to.name(node.name, "" if node.power is None else to.write(node.power))
    if len(node.arguments) == 1 and isinstance(node.arguments[0], (f.Sign, f.FormulaNumber)):
        return to.applied(name, to.write(node.arguments[0]))
    return to.called(name, to.closed(to.listed(node.arguments, to.commas[0])))


def _slope(to: Markup, node: f.Slope) -> str:
    letter = to.differentials[not node.total]
    above = to.write(node.above) if node.above else ""
    return to.fraction(to.row(letter + above), to.row(letter + to.write(node.below)))


_WRITERS: dict[type[f.FormulaNode], Callable[..., str]] = {
    f.Sign: lambda to, node: to.sign(node),
    f.FormulaNumber: lambda to, node: to.number(*node.text.partition("e")[::2]),
    f.FormulaText: lambda to, node: to.text(node.text),
    f.FormulaSum: _sum,
    f.FormulaProduct: lambda to, node: to.row(to.space.join(map(to.factor, node.factors))),
    f.Fraction: lambda to, node: to.fraction(to.write(node.above), to.write(node.below)),
    f.FormulaPower: _power,
    f.Root: lambda to, node: to.root(to.write(node.inner)),
    f.Bars: lambda to, node: to.bars(to.write(node.inner)),
    f.Apply: _apply,
    f.Triple: lambda to, node: to.closed(to.listed(node.parts, to.commas[1])),
    f.Slope: _slope,
    f.Dot: lambda to, node: to.row(to.factor(node.left) + to.dot + to.factor(node.right)),
}
