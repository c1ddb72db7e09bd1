"""Expressions in one unknown with known switches: where they are and of what kind, by closed form."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator

# The kind of a function of u at u = 0: its value jumps; its slope does; its slope has no bound; it is not defined on
# one side; it has a pole; or it goes on smoothly, to the first derivative, or with all of them.
JUMP, KINK, CUSP, END, POLE, FLAT, NONE = "jump", "kink", "cusp", "end", "pole", "flat", "none"

# Of each function of u its kind at u = 0, and the innermost function in it that switches there: a root of a square is
# computed as a modulus.
OUTER: tuple[tuple[str, str, str], ...] = (
    ("sign(U)", JUMP, "sign"),
    ("abs(U)/(U)", JUMP, "abs"),
    ("(U)/abs(U)", JUMP, "abs"),
    ("(U)/sqrt((U)**2)", JUMP, "abs"),
    ("max(U, 0)/(U)", JUMP, "max"),
    ("atan2(U, -1)", JUMP, "atan2"),
    ("atan(1/(U))", JUMP, "a quotient"),
    ("norm([U, 0, 0])/(U)", JUMP, "abs"),
    ("abs(U)", KINK, "abs"),
    ("max(U, 0)", KINK, "max"),
    ("min(U, 0)", KINK, "min"),
    ("max(U, 2*(U))", KINK, "max"),
    ("min(3*(U), -(U)/2)", KINK, "min"),
    ("(U)*sign(U)", KINK, "sign"),
    ("sqrt((U)**2)", KINK, "abs"),
    ("((U)**2)**0.5", KINK, "abs"),
    ("norm([U, 0, 0])", KINK, "abs"),
    ("distance([U, 0, 0], [0, 0, 0])", KINK, "abs"),
    ("abs(U)**0.5", CUSP, "abs"),
    ("sqrt(abs(U))", CUSP, "abs"),
    ("sqrt(U)", END, "sqrt"),
    ("(U)**0.5", END, "**"),
    ("asin(1 + (U))", END, "asin"),
    ("acos(1 + (U))", END, "acos"),
    ("log(U)", END, "log"),
    ("1/(U)", POLE, "a quotient"),
    ("(U)**-2", POLE, "a quotient"),
    ("1/abs(U)", POLE, "a quotient"),
    ("tan(pi/2 + (U))", POLE, "tan"),
    ("(U)*abs(U)", FLAT, "abs"),
    ("max(U, 0)**2", FLAT, "max"),
    ("(U)**2*sign(U)", FLAT, "sign"),
    ("(U)**3", NONE, ""),
    ("exp(U)", NONE, ""),
    ("sin(U) + (U)**2", NONE, ""),
    ("atan(U)", NONE, ""),
    ("tanh(U)/2", NONE, ""),
    ("cosh(U) - sinh(U)", NONE, ""),
)
# Functions of X that vanish at X = C, and nowhere else from 0.9 C to 1.1 C.
INNER = (
    "X - C",
    "C - X",
    "X**2 - C**2",
    "X/C - 1",
    "sin(X - C)",
    "exp(X - C) - 1",
    "tanh(2*(X - C))",
    "X**3 - C**3",
)


@dataclasses.dataclass(frozen=True)
class Case:
    """An expression in x, and its one switch near x = at."""

    text: str
    at: float
    kind: str
    word: str


def cases() -> Iterator[Case]:
    """All of them, each with a place of its own between 1 and 2."""
    for number, (outer, kind, word) in enumerate(OUTER):
        for row, inner in enumerate(INNER):
            at = 1.0 + math.modf((1 + number * len(INNER) + row) * (5**0.5 - 1) / 2)[0]
            u = inner.replace("X", "x").replace("C", repr(at))
            yield Case(outer.replace("U", u), at, kind, word)
