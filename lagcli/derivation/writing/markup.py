"""Formulas as LaTeX and as presentation MathML, which browsers show without a library.

What both write alike, the order of parts and the parentheses, stands once; every name is escaped, whatever it is.
"""

from __future__ import annotations

import dataclasses
import html
from collections.abc import Callable

from lagcli.derivation.writing import formula as f
from lagcli.expression import functions
from lagcli.output.latex_text import RESERVED


@dataclasses.dataclass(frozen=True, slots=True)
class Markup:
    """The words of one language.

    number: of digits and a power of ten; name: of a function and its power, or ""; row: what stands side by side, as
    one; applied, called: a name and its argument, without and with parentheses of its own; leading: a minus sign with
    nothing before it; commas: between arguments, and between components.
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

    def grouped(self, node: f.FormulaNode, kinds: tuple[type[f.FormulaNode], ...] = f.SUMS) -> str:
        """A part of a formula, in parentheses where it is of one of these kinds."""
        return self.closed(self.write(node)) if isinstance(node, kinds) else self.write(node)

    def listed(self, nodes: tuple[f.FormulaNode, ...], comma: str) -> str:
        return comma.join(map(self.write, nodes))


def _sum(to: Markup, node: f.FormulaSum) -> str:
    written = ""
    for index, (sign, term) in enumerate(node.terms):
        written += (to.minus if index else to.leading) if sign < 0 else to.plus if index else ""
        written += to.grouped(term, (f.FormulaSum,))
    return to.row(written)


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
    f.FormulaProduct: lambda to, node: to.row(to.space.join(map(to.grouped, node.factors))),
    f.Fraction: lambda to, node: to.fraction(to.write(node.above), to.write(node.below)),
    f.FormulaPower: lambda to, node: to.power(to.grouped(node.base, f.COMPOSED), to.write(node.exponent)),
    f.Root: lambda to, node: to.root(to.write(node.inner)),
    f.Bars: lambda to, node: to.bars(to.write(node.inner)),
    f.Apply: _apply,
    f.Triple: lambda to, node: to.closed(to.listed(node.parts, to.commas[1])),
    f.Slope: _slope,
    f.Dot: lambda to, node: to.row(to.grouped(node.left) + to.dot + to.grouped(node.right)),
}

# LaTeX's math mode.
_LETTERS = {letter: name for name, letter in f.GREEK.items()}
_LETTERS |= {"λ": "lambda", "π": "pi", "ℓ": "ell", "∂": "partial"}
_SCRIPT = {"𝒯": "T", "𝒱": "V", "ℒ": "L"}
_KNOWN = frozenset(row.written or row.name for row in functions.ROWS if row.has_latex)
_DOTS = ("{}", r"\dot{{{}}}", r"\ddot{{{}}}")
RELATIONS = {"=": "=", "≥": r"\ge", "≤": r"\le", "⊥": r"\perp"}
"""The signs between two sides in LaTeX."""


def _escaped(text: str) -> str:
    return "".join(RESERVED.get(letter, letter) for letter in text)


def _word(text: str) -> str:
    """A letter in italics, a longer word upright, in which Greek letters keep their commands."""
    if text.endswith("'") and len(text) > 1:
        return _word(text[:-1]) + "'"
    if text in _LETTERS:
        return "\\" + _LETTERS[text]
    if len(text) == 1 and text.isascii() and text.isalnum():
        return text
    if text in _SCRIPT:
        return rf"\mathcal{{{_SCRIPT[text]}}}"
    written = ""
    for letter in text:
        if letter in _LETTERS:
            written += f"\\{_LETTERS[letter]} "
        else:
            written += RESERVED.get(letter, letter) if letter.isascii() else rf"\text{{{letter}}}"
    return rf"\mathrm{{{written.strip()}}}"


def _latex_sign(node: f.Sign) -> str:
    # The rate of a deviation has its dots on the letter.
    deviates = node.dots > 0 and len(node.base) > 1 and node.base[0] == "δ"
    base = _word(node.base[1:] if deviates else node.base)
    if node.vector:
        base = rf"\mathbf{{{base}}}" if base.isalpha() else rf"\boldsymbol{{{base}}}"
    base = (r"\delta " if deviates else "") + _DOTS[node.dots].format(base)
    if node.sub:
        base += rf"_{{{','.join(map(_word, node.sub))}}}"
    return base + (f"^{{{node.sup}}}" if node.sup else "")


def _latex_name(name: str, power: str) -> str:
    written = "\\" + name if name in _KNOWN else rf"\operatorname{{{_escaped(name)}}}"
    return f"{written}^{{{power}}}" if power else written


latex = Markup(
    sign=_latex_sign,
    number=lambda digits, exponent: rf"{digits} \cdot 10^{{{exponent}}}" if exponent else digits,
    text=lambda text: rf"\text{{{_escaped(text)}}}",
    name=_latex_name,
    row=lambda text: text,
    closed=lambda text: rf"\left({text}\right)",
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

_ACCENTS = {"\u0307": r"\dot", "\u0308": r"\ddot"}
_COMMANDS = r"\dots{} $^{T}$ $^{-}$ $^{1}$ $-$ $\cdot$ $\sum$ $\le$ $\ge$ $\perp$ $\dot{g}$"
_IN_WORDS = dict(zip("…ᵀ⁻¹−·Σ≤≥⊥ġ", _COMMANDS.split(), strict=True))


def latex_words(text: str) -> str:
    """A sentence with mathematical letters in it; LaTeX knows the combining dots of a rate in math mode alone."""
    written = ""
    for letter, after in zip(text, (*text[1:], ""), strict=True):
        if after in _ACCENTS:
            written += rf"${_ACCENTS[after]}{{{letter}}}$"
        elif letter in _LETTERS:
            written += rf"$\{_LETTERS[letter]}$"
        elif letter not in _ACCENTS:
            written += _IN_WORDS.get(letter) or RESERVED.get(letter, letter)
    return written


_SPACE, _APPLIED = '<mspace width="0.17em"/>', "<mo>&#x2061;</mo>"


def _mathml_sign(node: f.Sign) -> str:
    style = ' mathvariant="normal"' if len(node.base) > 1 else ""
    base = f"<mi{style}>{html.escape(node.base)}</mi>"
    if node.vector:
        base = f'<mi class="vector" mathvariant="normal">{html.escape(node.base)}</mi>'
    if node.dots and len(node.base) > 1 and node.base[0] == "δ":
        # The rate of a deviation has its dots on the letter.
        inner = _mathml_sign(f.Sign(node.base[1:], dots=node.dots))
        base = f"<mrow><mi>δ</mi>{inner}</mrow>"
    elif node.dots:
        base = f'<mover accent="true">{base}<mo>{"˙" if node.dots == 1 else "¨"}</mo></mover>'
    after = f"<mo>{html.escape(node.sup.replace('-', '−'))}</mo>" if node.sup else ""
    if not node.sub:
        return f"<msup>{base}{after}</msup>" if after else base
    below = f"<mtext>{html.escape(','.join(node.sub))}</mtext>"
    return f"<msubsup>{base}{below}{after}</msubsup>" if after else f"<msub>{base}{below}</msub>"


def _row(inner: str) -> str:
    return f"<mrow>{inner}</mrow>"


def _mathml_number(digits: str, exponent: str) -> str:
    written = f"<mn>{html.escape(digits)}</mn>"
    power = f"<msup><mn>10</mn><mn>{html.escape(exponent)}</mn></msup>"
    return _row(f"{written}<mo>·</mo>{power}") if exponent else written


def _mathml_name(name: str, power: str) -> str:
    written = f'<mi mathvariant="normal">{html.escape(name)}</mi>'
    return f"<msup>{written}{power}</msup>" if power else written


mathml = Markup(
    sign=_mathml_sign,
    number=_mathml_number,
    text=lambda text: f"<mtext>{html.escape(text)}</mtext>",
    name=_mathml_name,
    row=_row,
    closed=lambda inner: _row(f"<mo>(</mo>{inner}<mo>)</mo>"),
    root=lambda inner: f"<msqrt>{inner}</msqrt>",
    bars=lambda inner: _row(f"<mo>|</mo>{inner}<mo>|</mo>"),
    fraction=lambda above, below: f"<mfrac>{above}{below}</mfrac>",
    power=lambda base, exponent: f"<msup>{base}{exponent}</msup>",
    applied=lambda name, argument: _row(f"{name}{_APPLIED}{_SPACE}{argument}"),
    called=lambda name, arguments: _row(f"{name}{_APPLIED}{arguments}"),
    leading="<mo>−</mo>",
    minus="<mo>−</mo>",
    plus="<mo>+</mo>",
    space=_SPACE,
    dot="<mo>·</mo>",
    commas=("<mo>,</mo>", "<mo>,</mo>"),
    differentials=("<mo>d</mo>", "<mo>∂</mo>"),
).write
"""The formula as one MathML element."""
