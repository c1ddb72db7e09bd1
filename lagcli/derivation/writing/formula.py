"""A formula as it stands on paper: nodes without meaning, which every renderer can write, and names as signs.

`theta1` is a theta with a subscript, `a.x` an x of the particle a.
"""

from __future__ import annotations

import dataclasses
import re


@dataclasses.dataclass(frozen=True, slots=True)
class FormulaNode:
    """Anything that can stand on paper."""


@dataclasses.dataclass(frozen=True, slots=True)
class Sign(FormulaNode):
    """A letter or word with `sub`scripts and `dots` above it; `vector` is printed bold where there is bold type.

    sup: "+" or "-" for a value just after or just before an impact.
    """

    base: str
    sub: tuple[str, ...] = ()
    dots: int = 0
    vector: bool = False
    sup: str = ""


@dataclasses.dataclass(frozen=True, slots=True)
class FormulaNumber(FormulaNode):
    """Digits as they are printed."""

    text: str


@dataclasses.dataclass(frozen=True, slots=True)
class FormulaText(FormulaNode):
    """Plain words in a formula."""

    text: str


@dataclasses.dataclass(frozen=True, slots=True)
class FormulaSum(FormulaNode):
    """Terms with their signs, +1 or -1."""

    terms: tuple[tuple[int, FormulaNode], ...]


@dataclasses.dataclass(frozen=True, slots=True)
class FormulaProduct(FormulaNode):
    """Factors side by side; sums among them get parentheses."""

    factors: tuple[FormulaNode, ...]


@dataclasses.dataclass(frozen=True, slots=True)
class Fraction(FormulaNode):
    """above / below."""

    above: FormulaNode
    below: FormulaNode


@dataclasses.dataclass(frozen=True, slots=True)
class FormulaPower(FormulaNode):
    """base to the exponent."""

    base: FormulaNode
    exponent: FormulaNode


@dataclasses.dataclass(frozen=True, slots=True)
class Root(FormulaNode):
    """A square root."""

    inner: FormulaNode


@dataclasses.dataclass(frozen=True, slots=True)
class Bars(FormulaNode):
    """|inner|, an absolute value or the length of a vector."""

    inner: FormulaNode


@dataclasses.dataclass(frozen=True, slots=True)
class Apply(FormulaNode):
    """name(arguments); `power` as in sin^2."""

    name: str
    arguments: tuple[FormulaNode, ...]
    power: FormulaNode | None = None


@dataclasses.dataclass(frozen=True, slots=True)
class Triple(FormulaNode):
    """(x, y, z), or any other list in parentheses."""

    parts: tuple[FormulaNode, ...]


@dataclasses.dataclass(frozen=True, slots=True)
class Dot(FormulaNode):
    """left . right, of vectors."""

    left: FormulaNode
    right: FormulaNode


ZERO, ONE = FormulaNumber("0"), FormulaNumber("1")
# What stands in brackets as a factor, and as the base of a power or with a dot.
SUMS = (FormulaSum, Dot)
COMPOSED = (FormulaSum, FormulaProduct, Fraction, FormulaPower, Apply, Dot)


def negative(node: FormulaNode) -> FormulaNode:
    """-node."""
    if isinstance(node, FormulaSum):
        return FormulaSum(tuple((-sign, term) for sign, term in node.terms))
    return FormulaSum(((-1, node),))


def terms_of(node: FormulaNode) -> list[tuple[int, FormulaNode]]:
    """The terms of a sum with their signs; of anything else itself."""
    return list(node.terms) if isinstance(node, FormulaSum) else [(1, node)]


def split(node: FormulaNode) -> tuple[int, FormulaNode]:
    """The sign of a formula and the rest of it."""
    return node.terms[0] if isinstance(node, FormulaSum) and len(node.terms) == 1 else (1, node)


def joined(terms: list[tuple[int, FormulaNode]]) -> FormulaNode:
    """A sum of terms; 0 where there are none."""
    if not terms:
        return ZERO
    return terms[0][1] if len(terms) == 1 and terms[0][0] > 0 else FormulaSum(tuple(terms))


@dataclasses.dataclass(frozen=True, slots=True)
class Slope(FormulaNode):
    """d above / d below, partial or (`total`) the whole rate."""

    above: FormulaNode | None
    below: FormulaNode
    total: bool = False


def lagrange(letter: Sign, q: Sign, q_dot: Sign) -> FormulaNode:
    """d/dt dL/dq' - dL/dq, for L or T."""
    rate = FormulaProduct((Slope(None, Sign("t"), total=True), Slope(letter, q_dot)))
    return FormulaSum(((1, rate), (-1, Slope(letter, q))))


_NAMES = (
    "alpha beta gamma delta epsilon zeta eta theta iota kappa mu nu xi rho sigma tau phi chi psi omega"
    " Gamma Delta Theta Lambda Xi Pi Sigma Phi Psi Omega"
)
GREEK = dict(zip(_NAMES.split(), "αβγδεζηθικμνξρστφχψωΓΔΘΛΞΠΣΦΨΩ", strict=True))
_LETTER = re.compile(rf"({'|'.join(GREEK)}|[A-Za-z])(\d*)(?:_(.+))?")
_INDEX = re.compile(r"\[(-?\d+)\]")


def named(name: str, vector: bool = False) -> Sign:
    """The sign of a parameter or coordinate."""
    base, indices = name.partition("[")[0], tuple(_INDEX.findall(name))
    match = _LETTER.fullmatch(base)
    if match is None:
        return Sign(base, indices, vector=vector)
    letter, digits, rest = match.groups()
    sub = tuple(part for part in (digits, rest) if part) + indices
    return Sign(GREEK.get(letter, letter), sub, vector=vector)


def subscript(name: str) -> str:
    """A name as a subscript: `p[3][1]` is `p3,1`, Greek names become letters."""
    base, *indices = name.replace("]", "").split("[")
    return GREEK.get(base, base) + ",".join(indices)


def family(name: str) -> str:
    """The name of the family of a member with indices; empty where there is none."""
    return name.partition("[")[0] if "[" in name else ""
