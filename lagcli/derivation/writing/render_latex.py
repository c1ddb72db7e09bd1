"""Formulas as LaTeX; every name is escaped, whatever it is made of."""

from __future__ import annotations

import re
from collections.abc import Callable

from lagcli.derivation.writing import formula as f
from lagcli.derivation.writing.paper_names import LETTERS
from lagcli.expression import functions
from lagcli.output.latex_text import RESERVED

_SCRIPT = {"𝒯": "T", "𝒱": "V", "ℒ": "L"}
_KNOWN = frozenset(row.written or row.name for row in functions.ROWS if row.has_latex)
_DOTS = {0: "{}", 1: r"\dot{{{}}}", 2: r"\ddot{{{}}}"}
_RELATIONS = {"=": "=", "≥": r"\ge", "≤": r"\le", "⊥": r"\perp"}


def latex(node: f.FormulaNode) -> str:
    """The formula in LaTeX's math mode."""
    return _WRITERS[type(node)](node)


def relation(sign_: str) -> str:
    """The sign between two sides."""
    return _RELATIONS[sign_]


def escaped(text: str) -> str:
    """Plain text that LaTeX prints as it is."""
    return "".join(RESERVED.get(letter, letter) for letter in text)


def word(text: str) -> str:
    """A letter in italics, a longer word upright."""
    if text.endswith("'") and len(text) > 1:
        return word(text[:-1]) + "'"
    if text in LETTERS:
        return "\\" + LETTERS[text]
    if len(text) == 1 and text.isascii() and text.isalnum():
        return text
    if text in _SCRIPT:
        return rf"\mathcal{{{_SCRIPT[text]}}}"
    return rf"\mathrm{{{_math(text)}}}"


def _math(text: str) -> str:
    """Words in math mode: Greek letters keep their commands; what is not ASCII stands as text."""
    return "".join(
        f"\\{LETTERS[letter]} "
        if letter in LETTERS
        else RESERVED.get(letter, letter)
        if letter.isascii()
        else rf"\text{{{letter}}}"
        for letter in text
    ).strip()


def sign(node: f.Sign) -> str:
    """A sign with dots and subscripts."""
    # The rate of a deviation has its dots on the letter.
    deviates = node.dots > 0 and len(node.base) > 1 and node.base[0] == "δ"
    base = word(node.base[1:] if deviates else node.base)
    if node.vector:
        base = rf"\mathbf{{{base}}}" if base.isalpha() else rf"\boldsymbol{{{base}}}"
    base = (r"\delta " if deviates else "") + _DOTS[node.dots].format(base)
    if node.sub:
        base += rf"_{{{','.join(word(part) for part in node.sub)}}}"
    return base + (f"^{{{node.sup}}}" if node.sup else "")


def _sum(terms: tuple[tuple[int, f.FormulaNode], ...]) -> str:
    parts = []
    for index, (sign_, term) in enumerate(terms):
        written = _closed(latex(term)) if isinstance(term, f.FormulaSum) else latex(term)
        plus = "" if index == 0 else " + "
        minus = "-" if index == 0 else " - "
        parts.append((minus if sign_ < 0 else plus) + written)
    return "".join(parts)


def _closed(text: str) -> str:
    return rf"\left({text}\right)"


def _factor(node: f.FormulaNode) -> str:
    return _closed(latex(node)) if isinstance(node, f.SUMS) else latex(node)


def _grouped(node: f.FormulaNode) -> str:
    return _closed(latex(node)) if isinstance(node, f.COMPOSED) else latex(node)


def _apply(node: f.Apply) -> str:
    name = "\\" + node.name if node.name in _KNOWN else rf"\operatorname{{{escaped(node.name)}}}"
    if node.power is not None:
        name += f"^{{{latex(node.power)}}}"
    if len(node.arguments) == 1 and isinstance(node.arguments[0], (f.Sign, f.FormulaNumber)):
        return f"{name} {{{latex(node.arguments[0])}}}"
    return name + _closed(", ".join(map(latex, node.arguments)))


def words(text: str) -> str:
    """A sentence with single mathematical letters in it."""
    return _ACCENTED.sub("", "".join(_in_words(text[i], text[i + 1 : i + 2]) for i in range(len(text))))


def _in_words(letter: str, after: str) -> str:
    """A letter of a sentence; `after` may be the combining dots of a rate, which LaTeX knows in math mode alone."""
    if after in _ACCENTS:
        return rf"${_ACCENTS[after]}{{{letter}}}$"
    if letter in LETTERS:
        return rf"$\{LETTERS[letter]}$"
    return _IN_WORDS.get(letter) or RESERVED.get(letter, letter)


_ACCENTS = {"\u0307": r"\dot", "\u0308": r"\ddot"}
_ACCENTED = re.compile("[\u0307\u0308]")
_IN_WORDS = {
    "…": r"\dots{}",
    "ᵀ": r"$^{T}$",
    "⁻": r"$^{-}$",
    "¹": r"$^{1}$",
    "−": "$-$",
    "·": r"$\cdot$",
    "Σ": r"$\sum$",
    "≤": r"$\le$",
    "≥": r"$\ge$",
    "⊥": r"$\perp$",
    "ġ": r"$\dot{g}$",
}


def _number(node: f.FormulaNumber) -> str:
    digits, letter, exponent = node.text.partition("e")
    return rf"{digits} \cdot 10^{{{exponent}}}" if letter else digits


def _slope(node: f.Slope) -> str:
    letter = "d" if node.total else r"\partial "
    above = latex(node.above) if node.above else ""
    return rf"\frac{{{letter}{above}}}{{{letter}{latex(node.below)}}}"


def _power(node: f.FormulaPower) -> str:
    base = node.base
    grouped = sign(base) if isinstance(base, f.Sign) and not base.dots else _grouped(base)
    return f"{{{grouped}}}^{{{latex(node.exponent)}}}"


_WRITERS: dict[type[f.FormulaNode], Callable[..., str]] = {
    f.Sign: sign,
    f.FormulaNumber: _number,
    f.FormulaText: lambda node: rf"\text{{{escaped(node.text)}}}",
    f.FormulaSum: lambda node: _sum(node.terms),
    f.FormulaProduct: lambda node: r" \, ".join(map(_factor, node.factors)),
    f.Fraction: lambda node: rf"\frac{{{latex(node.above)}}}{{{latex(node.below)}}}",
    f.FormulaPower: _power,
    f.Root: lambda node: rf"\sqrt{{{latex(node.inner)}}}",
    f.Bars: lambda node: rf"\left|{latex(node.inner)}\right|",
    f.Apply: _apply,
    f.Triple: lambda node: _closed(r",\; ".join(map(latex, node.parts))),
    f.Slope: _slope,
    f.Dot: lambda node: rf"{_factor(node.left)} \cdot {_factor(node.right)}",
}
