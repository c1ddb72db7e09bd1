"""The functions of the language: all that the program knows of one is its row here. Of a library that is slow to load
a column holds the name that the function has there, or makes it of the library's own, which it is given."""

from __future__ import annotations

import functools
import math
import operator
from collections.abc import Callable
from types import ModuleType
from typing import Any, Final, Literal

import numpy as np

from lagcli.arrays import Floats
from lagcli.frozen import frozen

# A function in a library: its name there, or (library, arguments) -> value.
Meaning = str | Callable[..., object]
Number = Any  # of any kind: a float, an array, an expression
Computed = Callable[..., Number]
MANY: Final = None  # one argument or more


@frozen
class Function:
    """A function of scalars.

    name: in the model format; arguments: how many, or `MANY`.
    value: of floats, with the errors of `math`; array: of NumPy arrays, nan or infinite there; range: the word of its
    rule in `intervals`; slope: the derivative, by each argument where it has two, of `sin`, `cos`, `sinh`, `cosh`,
    `sqrt` and `sign` of such numbers, the arguments and the value.
    operation: its name in CasADi, and so in a `Program`; casadi: what it is made of there, where it is no operation.
    sympy: what it is there; written: its name in derived equations; has_latex: it has a command of this name in LaTeX.

    dimension: of the value as a power of that of the argument, 0 where it is a number; angle: what of it is one.
    domain: least and largest argument, where it has a value at both.
    far: what it makes of an argument that grows: a number, no more than a root or a logarithm of it, an exponential, or
    another value in a narrow range only.
    edge: what happens where it is not smooth, in words.
    is_piecewise: it has a kink or a jump where an argument, or the difference of two, changes its sign; jumps: its
    value does where the first argument changes its sign by going through this; period: an angle jumps at its cut by so
    much; may_jump: its value or slope does for some argument, one that is infinite or a square too; may_be_steep: its
    slope may have no bound, or jump, where it has a value; poles: the function that is zero where it is infinite.
    is_total: finite numbers have a finite value, but for overflow, of which the largest number is no reason.
    is_entire: it is a power series everywhere; is_elementary: it may stand in a first integral.
    """

    name: str
    value: Callable[..., float]
    array: Callable[..., Floats]
    range: str
    arguments: int | None = 1
    slope: Computed | None = None
    operation: str = ""
    casadi: Meaning = ""
    sympy: Meaning = ""
    written: str = ""
    has_latex: bool = False
    dimension: float = 0.0
    angle: Literal["", "argument", "value"] = ""
    domain: tuple[float, float] | None = None
    far: Literal["narrow", "bounded", "root", "exponential"] = "narrow"
    edge: str = ""
    is_piecewise: bool = False
    jumps: Literal["", "zero", "infinity"] = ""
    period: float = 0.0
    may_jump: bool = False
    may_be_steep: bool = False
    poles: str = ""
    is_total: bool = False
    is_entire: bool = False
    is_elementary: bool = True


_UNIT = (-1, 1)  # the arguments of an arcsine


ROWS = (
    Function(
        "sin", math.sin, np.sin, "sine",
        slope=lambda of, x, y: of.cos(x),
        has_latex=True, angle="argument", far="bounded", is_total=True, is_entire=True,
    ),
    Function(
        "cos", math.cos, np.cos, "cosine",
        slope=lambda of, x, y: -of.sin(x),
        has_latex=True, angle="argument", far="bounded", is_total=True, is_entire=True,
    ),
    Function(
        "tan", math.tan, np.tan, "tangent",
        slope=lambda of, x, y: 1 + y * y,
        has_latex=True, angle="argument", poles="cos",
    ),
    Function(
        "asin", math.asin, np.arcsin, "rises",
        slope=lambda of, x, y: 1 / of.sqrt(1 - x * x),
        written="arcsin", has_latex=True, angle="value", domain=_UNIT,
        far="bounded", edge="`asin` comes to an end of its range", may_be_steep=True,
    ),
    Function(
        "acos", math.acos, np.arccos, "falls",
        slope=lambda of, x, y: -1 / of.sqrt(1 - x * x),
        written="arccos", has_latex=True, angle="value", domain=_UNIT,
        far="bounded", edge="`acos` comes to an end of its range", may_be_steep=True,
    ),
    Function(
        "atan", math.atan, np.arctan, "rises",
        slope=lambda of, x, y: 1 / (1 + x * x),
        written="arctan", has_latex=True, angle="value",
        edge="the argument of `atan` goes through infinity", jumps="infinity", period=math.pi, may_jump=True,
        may_be_steep=True, is_total=True,
    ),
    Function(
        "sinh", math.sinh, np.sinh, "rises",
        slope=lambda of, x, y: of.cosh(x),
        has_latex=True, far="exponential", is_entire=True,
    ),
    Function(
        "cosh", math.cosh, np.cosh, "rises both ways",
        slope=lambda of, x, y: of.sinh(x),
        has_latex=True, far="exponential", is_entire=True,
    ),
    Function(
        "tanh", math.tanh, np.tanh, "rises",
        slope=lambda of, x, y: 1 - y * y,
        has_latex=True, may_jump=True, is_total=True,
    ),
    Function(
        "exp", math.exp, np.exp, "rises",
        slope=lambda of, x, y: y,
        has_latex=True, is_entire=True,
    ),
    Function(
        "log", math.log, np.log, "logarithm",
        slope=lambda of, x, y: 1 / x,
        has_latex=True, far="bounded", may_be_steep=True,
    ),
    Function(
        "sqrt", math.sqrt, np.sqrt, "root",
        slope=lambda of, x, y: 1 / (2 * y),
        dimension=0.5, far="root", may_jump=True, may_be_steep=True, is_elementary=False,
    ),
    Function(
        "abs", abs, np.abs, "size",
        slope=lambda of, x, y: of.sign(x),
        operation="fabs", sympy="Abs", dimension=1.0, edge="the argument of `abs` changes its sign",
        is_piecewise=True, may_jump=True, may_be_steep=True, is_total=True,
    ),
    Function(
        "sign", lambda x: math.copysign(1, x) if x else 0.0, np.sign, "sign",
        slope=lambda of, x, y: 0,
        edge="`sign` switches", is_piecewise=True, jumps="zero", may_jump=True, may_be_steep=True,
        is_total=True, is_elementary=False,
    ),
    Function(
        "atan2", math.atan2, np.arctan2, "angle", 2,
        slope=lambda of, y, x, f: (x / (x * x + y * y), -y / (x * x + y * y)),
        angle="value", far="bounded", edge="`atan2` crosses its cut", jumps="zero",
        period=2 * math.pi, may_jump=True, may_be_steep=True,
    ),
    Function(
        "min", lambda *x: min(x), lambda *x: functools.reduce(np.minimum, x), "least", MANY,
        operation="fmin", sympy="Min", has_latex=True, dimension=1.0, edge="`min` switches", is_piecewise=True,
        may_jump=True, may_be_steep=True, is_total=True, is_elementary=False,
    ),
    Function(
        "max", lambda *x: max(x), lambda *x: functools.reduce(np.maximum, x), "largest", MANY,
        operation="fmax", sympy="Max", has_latex=True, dimension=1.0, edge="`max` switches", is_piecewise=True,
        may_jump=True, may_be_steep=True, is_total=True, is_elementary=False,
    ),
)  # fmt: skip

TABLE = {row.name: row for row in ROWS}
# By their names in a `Program` too.
BY_OPERATION = TABLE | {row.operation: row for row in ROWS if row.operation}


# Value and slope of the operations on one number that a formula is compiled to, by their names in a `Program`.
OPERATIONS: dict[str, tuple[Callable[[float], float], Computed]] = {
    **{
        row.operation or row.name: (row.value, row.slope)
        for row in TABLE.values()
        if row.arguments == 1 and row.slope and not row.casadi
    },
    "inv": (lambda x: 1 / x, lambda of, x, y: -y * y),
    "sq": (lambda x: x * x, lambda of, x, y: 2 * x),
    "twice": (lambda x: x + x, lambda of, x, y: 2),
    "assign": (lambda x: x, lambda of, x, y: 1),
    "neg": (lambda x: -x, lambda of, x, y: -1),
    "not": (lambda x: float(x == 0), lambda of, x, y: 0),
    "floor": (lambda x: float(math.floor(x)), lambda of, x, y: 0),
    "ceil": (lambda x: float(math.ceil(x)), lambda of, x, y: 0),
    "asinh": (math.asinh, lambda of, x, y: 1 / of.sqrt(x * x + 1)),
    "acosh": (math.acosh, lambda of, x, y: 1 / of.sqrt(x * x - 1)),
    "atanh": (math.atanh, lambda of, x, y: 1 / (1 - x * x)),
    "log1p": (math.log1p, lambda of, x, y: 1 / (1 + x)),
    "expm1": (math.expm1, lambda of, x, y: y + 1),
}

# Sums, products and powers of any numbers that have Python's operators, by their names in a `Program`.
ARITHMETIC: dict[str, Computed] = {
    "add": operator.add,
    "sub": operator.sub,
    "neg": operator.neg,
    "mul": operator.mul,
    "div": operator.truediv,
    "pow": operator.pow,
}


class SlopeSizes:
    """Functions of floats for the size of a slope, which is that of either side where it jumps."""

    sin, cos, sinh, cosh, sqrt = math.sin, math.cos, math.sinh, math.cosh, math.sqrt
    sign = staticmethod(lambda _: 1)


def named(wanted: Callable[[Function], bool]) -> frozenset[str]:
    """The names of some functions in the model format."""
    return frozenset(row.name for row in TABLE.values() if wanted(row))


def calls(wanted: Callable[[Function], bool]) -> frozenset[str]:
    """The calls of some functions as words of an expression (`tree.words`)."""
    return frozenset(f"{name}(" for name in named(wanted))


def meaning(library: ModuleType, given: Meaning, name: str) -> Computed:
    """The function of a library for a column of it; by default that of this name."""
    return getattr(library, given or name) if isinstance(given, str) else functools.partial(given, library)
