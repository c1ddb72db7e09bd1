"""Formulas as presentation MathML, which browsers show without a library."""

from __future__ import annotations

import html
from collections.abc import Callable

from lagcli.derivation.writing import formula as f

_DOTS = {1: "˙", 2: "¨"}


def mathml(node: f.FormulaNode) -> str:
    """The formula as one MathML element."""
    return _WRITERS[type(node)](node)


def sign(node: f.Sign) -> str:
    """A sign with dots and subscripts."""
    style = ' mathvariant="normal"' if len(node.base) > 1 else ""
    base = f"<mi{style}>{html.escape(node.base)}</mi>"
    if node.vector:
        base = f'<mi class="vector" mathvariant="normal">{html.escape(node.base)}</mi>'
    if node.dots and len(node.base) > 1 and node.base[0] == "δ":
        # The rate of a deviation has its dots on the letter.
        inner = sign(f.Sign(node.base[1:], dots=node.dots))
        base = f"<mrow><mi>δ</mi>{inner}</mrow>"
    elif node.dots:
        base = f'<mover accent="true">{base}<mo>{_DOTS[node.dots]}</mo></mover>'
    after = f"<mo>{html.escape(node.sup.replace('-', '−'))}</mo>" if node.sup else ""
    if not node.sub:
        return f"<msup>{base}{after}</msup>" if after else base
    below = f"<mtext>{html.escape(','.join(node.sub))}</mtext>"
    return f"<msubsup>{base}{below}{after}</msubsup>" if after else f"<msub>{base}{below}</msub>"


def _row(*parts: str) -> str:
    return f"<mrow>{''.join(parts)}</mrow>"


def _operator(text: str) -> str:
    return f"<mo>{html.escape(text)}</mo>"


def _closed(*parts: str) -> str:
    return _row(_operator("("), *parts, _operator(")"))


def _listed(parts: tuple[f.FormulaNode, ...]) -> list[str]:
    found: list[str] = []
    for part in parts:
        found += [_operator(","), mathml(part)] if found else [mathml(part)]
    return found


def _sum(terms: tuple[tuple[int, f.FormulaNode], ...]) -> str:
    parts = []
    for index, (sign_, term) in enumerate(terms):
        if index or sign_ < 0:
            parts.append(_operator("−" if sign_ < 0 else "+"))
        parts.append(_closed(mathml(term)) if isinstance(term, f.FormulaSum) else mathml(term))
    return _row(*parts)


def _spaced(factors: tuple[f.FormulaNode, ...]) -> list[str]:
    found: list[str] = []
    for factor in factors:
        found += ['<mspace width="0.17em"/>', _factor(factor)] if found else [_factor(factor)]
    return found


def _factor(node: f.FormulaNode) -> str:
    return _closed(mathml(node)) if isinstance(node, f.SUMS) else mathml(node)


def _grouped(node: f.FormulaNode) -> str:
    return _closed(mathml(node)) if isinstance(node, f.COMPOSED) else mathml(node)


def _apply(node: f.Apply) -> str:
    name = f'<mi mathvariant="normal">{html.escape(node.name)}</mi>'
    if node.power is not None:
        name = f"<msup>{name}{mathml(node.power)}</msup>"
    if len(node.arguments) == 1 and isinstance(node.arguments[0], (f.Sign, f.FormulaNumber)):
        return _row(name, "<mo>&#x2061;</mo>", '<mspace width="0.17em"/>', mathml(node.arguments[0]))
    return _row(name, "<mo>&#x2061;</mo>", _closed(*_listed(node.arguments)))


def _number(node: f.FormulaNumber) -> str:
    digits, letter, exponent = node.text.partition("e")
    written = f"<mn>{html.escape(digits)}</mn>"
    if not letter:
        return written
    return _row(written, _operator("·"), f"<msup><mn>10</mn><mn>{html.escape(exponent)}</mn></msup>")


def _slope(node: f.Slope) -> str:
    letter = f"<mo>{'d' if node.total else '∂'}</mo>"
    top = _row(letter, mathml(node.above)) if node.above else _row(letter)
    return f"<mfrac>{top}{_row(letter, mathml(node.below))}</mfrac>"


_WRITERS: dict[type[f.FormulaNode], Callable[..., str]] = {
    f.Sign: sign,
    f.FormulaNumber: _number,
    f.FormulaText: lambda node: f"<mtext>{html.escape(node.text)}</mtext>",
    f.FormulaSum: lambda node: _sum(node.terms),
    f.FormulaProduct: lambda node: _row(*_spaced(node.factors)),
    f.Fraction: lambda node: f"<mfrac>{mathml(node.above)}{mathml(node.below)}</mfrac>",
    f.FormulaPower: lambda node: f"<msup>{_grouped(node.base)}{mathml(node.exponent)}</msup>",
    f.Root: lambda node: f"<msqrt>{mathml(node.inner)}</msqrt>",
    f.Bars: lambda node: _row(_operator("|"), mathml(node.inner), _operator("|")),
    f.Apply: _apply,
    f.Triple: lambda node: _closed(*_listed(node.parts)),
    f.Slope: _slope,
    f.Dot: lambda node: _row(_factor(node.left), _operator("·"), _factor(node.right)),
}
