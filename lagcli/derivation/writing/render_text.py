"""Formulas as Unicode text for a terminal, and where their lines are broken."""

from __future__ import annotations

import itertools
import unicodedata
from collections.abc import Callable

from lagcli.derivation.writing import formula as f

_SUB = str.maketrans("0123456789,", "₀₁₂₃₄₅₆₇₈₉,")
_SUPER = str.maketrans("0123456789-+", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁺")
_DOTS = {0: "", 1: "\u0307", 2: "\u0308"}
_HALVES = {("1", "2"): "½", ("1", "3"): "⅓", ("2", "3"): "⅔", ("1", "4"): "¼", ("3", "4"): "¾"}

# No line is broken before so many characters.
EARLY = 24
# How tightly a text holds together: a sum, a product or quotient, one function applied, a single sign.
SUM, PRODUCT, APPLIED, ATOM = range(4)


def width(text: str) -> int:
    """Columns on a terminal: marks above letters take none."""
    return sum(1 for letter in text if not unicodedata.combining(letter))


def text(node: f.FormulaNode) -> str:
    """The formula on one line."""
    return _write(node)[0]


def columns(node: f.FormulaNode) -> int:
    """Columns of the formula on one line."""
    return width(text(node))


def _sign(node: f.Sign) -> tuple[str, int]:
    """A sign with dots and subscripts: θ̇₁, ẋ_a."""
    base = node.base
    if node.dots:
        if len(base.removeprefix("δ")) == 1:
            base = unicodedata.normalize("NFC", base + _DOTS[node.dots])
        else:
            for _ in range(node.dots):
                base = f"rate({base})"
    after = node.sup.translate(_SUPER)
    sub = ",".join(node.sub)
    if sub.replace(",", "").isdecimal() and sub.isascii():
        sub = sub.translate(_SUB)
    elif sub:
        sub = f"_{sub}"
    return base + sub + after, ATOM


def _write(node: f.FormulaNode) -> tuple[str, int]:
    """The text and how tightly it holds together."""
    return _WRITERS[type(node)](node)


def _grouped(node: f.FormulaNode, least: int) -> str:
    """In parentheses where it holds together less than that."""
    written, hold = _write(node)
    return written if hold >= least else f"({written})"


def _sum(node: f.FormulaSum) -> tuple[str, int]:
    parts = []
    for index, (sign_, term) in enumerate(node.terms):
        written = _grouped(term, PRODUCT)
        if index == 0:
            parts.append(f"−{written}" if sign_ < 0 else written)
        else:
            parts.append(f" {'−' if sign_ < 0 else '+'} {written}")
    return "".join(parts), SUM


def _product(node: f.FormulaProduct) -> tuple[str, int]:
    parts = []
    for index, (factor, following) in enumerate(itertools.zip_longest(node.factors, node.factors[1:])):
        # A differential: sin θ dφ is read right
        moves = isinstance(following, f.Sign) and len(following.base) == 2 and following.base[0] in "dδ"
        if isinstance(factor, f.Apply) and not (following is None or isinstance(following, f.Apply) or moves):
            # "sin θ r" would be read as sin(θ r).
            parts.append(_apply(factor, closed=True)[0])
        elif isinstance(factor, f.Fraction) and index == 0 and _small(factor):
            parts.append(_write(factor)[0])
        else:
            parts.append(_grouped(factor, APPLIED))
    return " ".join(parts), PRODUCT


def _small(node: f.Fraction) -> str | None:
    """The single letter for a half and the like, or None."""
    if isinstance(node.above, f.FormulaNumber) and isinstance(node.below, f.FormulaNumber):
        return _HALVES.get((node.above.text, node.below.text))
    return None


def _raised(exponent: f.FormulaNode) -> str:
    """A whole exponent in raised digits; empty for another."""
    digits = text(exponent).replace("−", "-")
    return digits.translate(_SUPER) if digits.lstrip("-").isdecimal() and digits.isascii() else ""


def _apply(node: f.Apply, closed: bool = False) -> tuple[str, int]:
    name = node.name
    if node.power is not None:
        name += _raised(node.power) or "^" + text(node.power).replace("−", "-")
    if len(node.arguments) == 1 and not closed and isinstance(node.arguments[0], (f.Sign, f.FormulaNumber)):
        inner, hold = _write(node.arguments[0])
        if hold == ATOM:
            return f"{name} {inner}", APPLIED
    return f"{name}({', '.join(map(text, node.arguments))})", APPLIED


def _number(node: f.FormulaNumber) -> tuple[str, int]:
    digits, letter, exponent = node.text.partition("e")
    return (f"{digits}·10{exponent.translate(_SUPER)}", APPLIED) if letter else (digits, ATOM)


def _slope(node: f.Slope) -> tuple[str, int]:
    letter = "d" if node.total else "∂"
    return f"{letter}{text(node.above) if node.above else ''}/{letter}{text(node.below)}", APPLIED


# Each part of a formula is written once: written twice at every level, a nested one would take 2^depth steps.
_WRITERS: dict[type[f.FormulaNode], Callable[..., tuple[str, int]]] = {
    f.Sign: _sign,
    f.FormulaNumber: _number,
    f.FormulaText: lambda node: (node.text, ATOM),
    f.FormulaSum: _sum,
    f.FormulaProduct: _product,
    f.Fraction: lambda node: (
        _small(node) or f"{_grouped(node.above, PRODUCT)}/{_grouped(node.below, APPLIED)}",
        PRODUCT,
    ),
    f.FormulaPower: lambda node: (
        _grouped(node.base, ATOM) + (_raised(node.exponent) or f"^{_grouped(node.exponent, ATOM)}"),
        ATOM,
    ),
    f.Root: lambda node: (f"√{_grouped(node.inner, ATOM)}", ATOM),
    f.Bars: lambda node: (f"|{text(node.inner)}|", ATOM),
    f.Apply: _apply,
    f.Triple: lambda node: (f"({', '.join(map(text, node.parts))})", ATOM),
    f.Slope: _slope,
    f.Dot: lambda node: (f"{_grouped(node.left, PRODUCT)}·{_grouped(node.right, PRODUCT)}", PRODUCT),
}


def wrapped(line: str, columns: int, indent: int) -> list[str]:
    """The rows of a formula. Broken before signs, outside of parentheses where that leaves no short lines, and never
    between bars."""
    rows: list[str] = []
    start = used = depth = bars = 0
    breaks: dict[int, int] = {}  # depth -> the last index at which a new line may begin
    for index, letter in enumerate(line):
        depth += (letter == "(") - (letter == ")")
        bars ^= letter == "|"
        is_sign = letter in "+−=≤≥⊥" and line[index - 1 : index + 2] == f" {letter} "
        if is_sign and not bars and (letter != "=" or used > EARLY):
            breaks[depth] = index
        used += width(letter)
        if used <= columns:
            continue
        # The outermost break that does not leave most of the line empty.
        good = (at for deep, at in sorted(breaks.items()) if at - start > (2 * EARLY if deep else EARLY))
        if (at := next(good, None)) is not None:
            rows.append((" " * indent if rows else "") + line[start:at].rstrip())
            used = indent + width(line[at : index + 1])
            start, breaks = at, {deep: other for deep, other in breaks.items() if other > at}
    rows.append((" " * indent if rows else "") + line[start:])
    return rows


def folded(words: str, columns: int) -> list[str]:
    """The rows of a sentence."""
    rows = [""]
    for word in words.split(" "):
        if rows[-1] and width(rows[-1]) + 1 + width(word) > columns:
            rows.append("")
        rows[-1] += (" " if rows[-1] else "") + word
    return rows
