"""Formulas as LaTeX; every name is escaped, whatever it is made of."""

from __future__ import annotations

from lagcli.derivation.writing import formula as f
from lagcli.derivation.writing.markup import Markup
from lagcli.derivation.writing.paper_names import LETTERS
from lagcli.expression import functions
from lagcli.output.latex_text import RESERVED

_SCRIPT = {"𝒯": "T", "𝒱": "V", "ℒ": "L"}
_KNOWN = frozenset(row.written or row.name for row in functions.ROWS if row.has_latex)
_DOTS = {0: "{}", 1: r"\dot{{{}}}", 2: r"\ddot{{{}}}"}
_RELATIONS = {"=": "=", "≥": r"\ge", "≤": r"\le", "⊥": r"\perp"}


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


def _name(name: str, power: str) -> str:
    written = "\\" + name if name in _KNOWN else rf"\operatorname{{{escaped(name)}}}"
    return f"{written}^{{{power}}}" if power else written


def _closed(text: str) -> str:
    return rf"\left({text}\right)"


latex = Markup(
    sign=sign,
    number=lambda digits, exponent: rf"{digits} \cdot 10^{{{exponent}}}" if exponent else digits,
    text=lambda text: rf"\text{{{escaped(text)}}}",
    name=_name,
    row=lambda text: text,
    closed=_closed,
    root=lambda inner: rf"\sqrt{{{inner}}}",
    bars=lambda inner: rf"\left|{inner}\right|",
    fraction=lambda above, below: rf"\frac{{{above}}}{{{below}}}",
    power=lambda base, exponent: f"{{{base}}}^{{{exponent}}}",
    applied=lambda name, argument: f"{name} {{{argument}}}",
    called=lambda name, arguments: name + arguments,
    leading="-",
    minus=" - ",
    plus=" + ",
    space=r" \, ",
    dot=r" \cdot ",
    commas=(", ", r",\; "),
    differentials=("d", r"\partial "),
).write
"""The formula in LaTeX's math mode."""


def words(text: str) -> str:
    """A sentence with mathematical letters in it; LaTeX knows the combining dots of a rate in math mode alone."""
    written = ""
    for letter, after in zip(text, (*text[1:], ""), strict=True):
        if after in _ACCENTS:
            written += rf"${_ACCENTS[after]}{{{letter}}}$"
        elif letter in LETTERS:
            written += rf"$\{LETTERS[letter]}$"
        elif letter not in _ACCENTS:
            written += _IN_WORDS.get(letter) or RESERVED.get(letter, letter)
    return written


_ACCENTS = {"\u0307": r"\dot", "\u0308": r"\ddot"}
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
