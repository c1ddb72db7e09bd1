"""Formulas as presentation MathML, which browsers show without a library."""

from __future__ import annotations

import html

from lagcli.derivation.writing import formula as f
from lagcli.derivation.writing.markup import Markup

_DOTS = {1: "˙", 2: "¨"}
_SPACE, _APPLIED = '<mspace width="0.17em"/>', "<mo>&#x2061;</mo>"


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


def _row(inner: str) -> str:
    return f"<mrow>{inner}</mrow>"


def _closed(inner: str) -> str:
    return _row(f"<mo>(</mo>{inner}<mo>)</mo>")


def _number(digits: str, exponent: str) -> str:
    written = f"<mn>{html.escape(digits)}</mn>"
    power = f"<msup><mn>10</mn><mn>{html.escape(exponent)}</mn></msup>"
    return _row(f"{written}<mo>·</mo>{power}") if exponent else written


def _name(name: str, power: str) -> str:
    written = f'<mi mathvariant="normal">{html.escape(name)}</mi>'
    return f"<msup>{written}{power}</msup>" if power else written


mathml = Markup(
    sign=sign,
    number=_number,
    text=lambda text: f"<mtext>{html.escape(text)}</mtext>",
    name=_name,
    row=_row,
    closed=_closed,
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
